"""How a body sinks into the soft bed, and the imprint it leaves: the cell's own bed model, slowly.

The body is pushed straight down into a freshly inflated bag until the bed bears the press force.
The posture is kept, as a hand keeps it. The bed is that of the twin on the twin's own grid, with
longer steps: the bed raises its collar and its strength after each, so that the force lags behind
by one, and the step before each look at the force is short. Under 20 N the motor standing on its
terminals sinks 15.9 mm; in the twin 16.3 mm, tilted by 1.7 degrees, under the hand on a carriage,
and 14.4 mm under the arm, which stops at the first 20 N that it feels. [M]
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import trimesh
from scipy import ndimage

from cell.fixtures.soft_jig import JigParameters, SurfaceSamples
from cell.fixtures.soft_jig.soft.bed import Bed
from planning.feasibility.solids import Solid
from planning.fixture_analysis.footprint import Footprint, footprint

SHORTEST, LONGEST = 0.0002, 0.008  # [m] [D] Steps: the last decides the depth's error.
SHARE = 0.4  # Of the way that the force still asks for, judged by the last step, taken in the next.
PAST = 1.02  # A step that ends beyond so much of the force is taken back and halved.
BEARING = 0.0005  # [m] [A] What the bed springs back by: less than that apart bears.
SPACING = 0.0005  # [m] [D] 9 points per cell of 1.5 mm: hardly any under a body gets none.
NARROW = 0.008  # [m] [A] Beads of 1 mm under a membrane of 1 mm do not rise into such a hole.
FEWEST = 500  # Points of a small part.
SPEED = 0.010  # [m/s] [A] of the hand; the bed hardly depends on it.


@dataclass(frozen=True, eq=False)
class Imprint:
    """A body pressed into the bed; the origin of the plane is the middle of the bag.

    Attributes:
        depth: Of the lowest point below the apex of the bare bag [m].
        force: That the bed bears [N]; below the press force if the body reached the base plate.
        volume: Of the imprint below the bare bag [m3].
        homeless: Volume of beads that found no room beside the body [m3].
        cell: Edge of a cell [m].
        bed: (n, n) height of the bed above the body's lowest point, collar included [m].
        under: (n, n) height of the body's underside above its lowest point [m]; inf where none.
        contact: Outline of what bears, or None if it spans no area.
    """

    depth: float
    force: float
    volume: float
    homeless: float
    cell: float
    bed: np.ndarray
    under: np.ndarray
    contact: Footprint | None

    @property
    def contact_area(self) -> float:
        """Of what bears, seen from above [m2]."""
        return float((self.under < self.bed + BEARING).sum()) * self.cell**2

    def walls(self, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return height [m] and lower edge above the lowest point [m] of the walls ahead of a push.

        A wall stands between a cell that the body fills and the next one along the push, as high
        as bed or overhanging underside there reaches above the body's underside.

        Args:
            direction: (2,) along an axis of the plane.

        Returns:
            Two (m,) arrays; each wall is one cell wide.
        """
        axis, sign = int(np.argmax(np.abs(direction))), int(np.sign(direction @ [1, 1]))
        ahead = np.minimum(self.bed, self.under)
        ahead = np.roll(ahead, -sign, axis=axis)  # The border of the grid is outside the bag.
        height = np.where(np.isfinite(self.under), ahead - self.under, 0.0)
        inside = height > 0.0
        return height[inside], self.under[inside]


def depth_in_bed(
    imprint: Imprint, part: Surface, R_JA: np.ndarray, p_middle: np.ndarray, low: float
) -> float:
    """Return how deep a part that joins the body would be inside the frozen bed [m].

    Args:
        imprint: Of the body.
        part: Surface of the part in A.
        R_JA: (3, 3) posture.
        p_middle: (2,) point of the turned body that is over the middle of the bag.
        low: Height of the body's lowest point, turned [m].
    """
    points = part.samples.points @ R_JA.T - [*p_middle, low]
    half = (len(imprint.bed) - 1) // 2
    at = np.rint(points[:, :2] / imprint.cell).astype(int) + half
    inside = np.all((at >= 0) & (at < len(imprint.bed)), axis=1)
    # The height field stands up in every hole of the body; a bag does not enter narrow ones.
    bulging = ndimage.grey_opening(imprint.bed, size=round(NARROW / imprint.cell))
    bed, under = (height[tuple(at[inside].T)] for height in (bulging, imprint.under))
    below = np.minimum(bed, under) - points[inside, 2]  # Above the body there is no bed.
    return float(np.max(below, initial=0.0))


@dataclass(frozen=True, eq=False)
class Surface:
    """Points spread over a part's surface, and what of them looks down in postures asked for.

    Attributes:
        samples: In the product frame A.
        below: Per posture and cell the points that look down, turned, and one of them per cell.
    """

    samples: SurfaceSamples
    below: dict[tuple[bytes, float], tuple[np.ndarray, SurfaceSamples]] = field(
        default_factory=dict
    )

    def seen_from_below(self, R_JA: np.ndarray, cell: float) -> tuple[np.ndarray, SurfaceSamples]:
        """Return points (m, 3) that look down in a posture, turned, and one of them per cell."""
        key = R_JA.tobytes(), cell
        if key not in self.below:
            own = self.samples
            down = np.flatnonzero(own.normals @ R_JA[2] < 0.0)
            points, normals = own.points[down] @ R_JA.T, own.normals[down] @ R_JA.T
            turned = SurfaceSamples(own.name, points, normals, own.areas[down])
            self.below[key] = points, _one_per_cell(turned, cell)
        return self.below[key]


def samples_of(solid: Solid) -> Surface:
    """Return points spread over a part's surface in the product frame A, the same every time."""
    mesh = trimesh.Trimesh(solid.vertices, solid.faces, process=False)
    count = max(FEWEST, round(mesh.area / SPACING**2))
    sampled = trimesh.sample.sample_surface(mesh, count, seed=0)
    points, faces = sampled[0], sampled[1]
    areas = np.full(count, mesh.area / count)
    normals = mesh.face_normals[faces]
    return Surface(SurfaceSamples(solid.name, points, normals, areas))


def _one_per_cell(samples: SurfaceSamples, cell: float) -> SurfaceSamples:
    """Return what a turned surface shows to the bed, as the bed sees it."""
    if not len(samples.points):
        return samples
    under = samples.underside(np.eye(3), cell)
    normals = np.column_stack([under.slopes, -np.ones(len(under.slopes))])
    lengths = np.linalg.norm(normals, axis=1)
    normals, areas = normals / lengths[:, None], under.areas * lengths
    return SurfaceSamples(samples.name, under.points, normals, areas)


def press(
    parts: Iterable[Surface],
    R_JA: np.ndarray,
    p_middle: np.ndarray,
    jig: JigParameters,
    force: float,
) -> Imprint:
    """Press a body into the bed.

    Args:
        parts: Surfaces of its parts in A.
        R_JA: (3, 3) posture.
        p_middle: (2,) point of the turned body, in the plane, that goes to the middle of the bag.
        jig: Bag and beads.
        force: That ends the pressing [N].
    """
    seen = [part.seen_from_below(R_JA, jig.bag.cell) for part in parts]
    points = np.concatenate([points for points, _ in seen])
    lowest = float(points[:, 2].min())
    points = points[points[:, 2] <= lowest + jig.bag.cap_height]
    bed, apex = _bed(jig), jig.bag.cap_height
    bed.inflate()
    cap = bed.heights.copy()
    pushed = _Pushed(bed, _joined([under for _, under in seen]), p_middle, apex - lowest)
    depth, borne = pushed.down_to(force, apex - jig.bag.floor)
    return _read(bed, cap, points + [*(-p_middle), apex - depth - lowest], depth, borne)


def _joined(parts: list[SurfaceSamples]) -> SurfaceSamples:
    """Return the surfaces of several parts as one."""
    points, normals, areas = (
        np.concatenate([getattr(part, field) for part in parts])
        for field in ("points", "normals", "areas")
    )
    return SurfaceSamples("body", points, normals, areas)


@dataclass(frozen=True, eq=False)
class _Pushed:
    """A body on its way down into a bed.

    Attributes:
        bed: That it is pushed into.
        body: Its surface, turned.
        p_middle: (2,) point of it over the middle of the bag [m].
        height: Of the body's frame when it just touches the apex [m].
    """

    bed: Bed
    body: SurfaceSamples
    p_middle: np.ndarray
    height: float

    def down_to(self, force: float, deepest: float) -> tuple[float, float]:
        """Push until the bed bears the force [N]; return the depth [m] and what it bears [N]."""
        depth, borne, step = 0.0, 0.0, SHORTEST
        while borne < force and depth < deepest:
            step = min(step, deepest - depth)
            before = self.bed.state()
            if step > SHORTEST:
                self._bears(depth + step - SHORTEST, step - SHORTEST)
            now = self._bears(depth + step, min(step, SHORTEST))
            if now > PAST * force and step > SHORTEST:
                self.bed.restore(before)
                step = max(step / 2, SHORTEST)
                continue
            wanted = SHARE * step * (force - now) / max(now - borne, 1e-9)
            depth, borne = depth + step, now
            step = float(np.clip(wanted, SHORTEST, min(LONGEST, 3.0 * step)))
        return depth, borne

    def _bears(self, depth: float, step: float) -> float:
        """Return what the bed bears at a depth, after a step down to it [N]."""
        p_JA = np.array([*(-self.p_middle), self.height - depth])
        motion, dt = (np.zeros(3), np.array([0.0, 0.0, -SPEED])), step / SPEED
        force, _ = self.bed.press((np.eye(3), p_JA), motion, self.body, dt)
        self.bed.settle(max(dt, self.bed.soil.settle_period))
        return float(force[2])


@cache
def _bed(jig: JigParameters) -> Bed:
    """Return one bed for all imprints of a jig: it is inflated anew for each."""
    return Bed(jig.bag, jig.soil)


def _read(bed: Bed, cap: np.ndarray, points: np.ndarray, depth: float, borne: float) -> Imprint:
    """Take over the bed's surface and the body's underside over it.

    Args:
        bed: After the push.
        cap: (n, n) its surface before [m].
        points: (m, 3) of the body that look down, in J.
        depth: Of the lowest point below the apex [m].
        borne: What the bed bears [N].
    """
    low, cell = bed.bag.cap_height - depth, bed.bag.cell
    at = np.rint((points[:, :2] - bed.axis[0]) / cell).astype(int)
    inside = np.all((at >= 0) & (at < len(bed.axis)), axis=1)
    under = np.full(bed.heights.shape, np.inf)
    np.minimum.at(under, tuple(at[inside].T), points[inside, 2])
    bearing = bed.active & (under < bed.heights + BEARING)
    volume = float(np.maximum(cap - bed.heights, 0.0).sum()) * cell**2
    outline = footprint(np.column_stack([bed.x[bearing], bed.y[bearing]]))
    return Imprint(
        depth, borne, volume, bed.displaced, cell, bed.heights - low, under - low, outline
    )
