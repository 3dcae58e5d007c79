"""How a body sinks into the soft bed, and its imprint: quasi-static, with the cell's bed model.

The body is pushed straight down into a freshly inflated bag until the bed bears the press force,
without tilting. Bed model and grid are those of the simulation, the steps are longer. The bed
updates its collar and its strength after each step, so that the force lags by one step; a short
step therefore precedes each reading of the force. Under 20 N the motor standing on its terminals
sinks 15.9 mm; in simulation 16.3 mm, tilted by 1.7 degrees, under the hand on a carriage, and
14.4 mm under the arm, which stops at the first 20 N that it measures. [M]
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
SHARE = 0.4  # Share of the extrapolated remaining depth that the next step takes.
OVERSHOOT = 1.02  # A step that ends above this multiple of the force is repeated at half the size.
BEARING = 0.0005  # [m] [A] Elastic recovery of the bed: surfaces less than that apart bear.
SPACING = 0.0005  # [m] [D] 9 points per cell of 1.5 mm: hardly any cell under a body has none.
NARROW = 0.008  # [m] [A] Beads of 1 mm under a membrane of 1 mm do not rise into such a hole.
FEWEST = 500  # Points of a small part.
SPEED = 0.010  # [m/s] [A] Of the hand; the bed hardly depends on it.


@dataclass(frozen=True, eq=False)
class Imprint:
    """A body pressed into the bed; the origin of the plane is the middle of the bag.

    Attributes:
        depth: Of the lowest point below the apex of the undisturbed bag [m].
        force: That the bed bears [N]; below the press force if the body reached the base plate.
        volume: Of the imprint below the surface of the undisturbed bag [m3].
        excess: Volume of displaced beads that the bed around the body could not take up [m3].
        cell: Edge of a cell [m].
        bed: (n, n) height of the soft bed above the body's lowest point, collar included [m].
        frozen: (n, n) the same when frozen: lower beside the body, which has dragged it down.
        under: (n, n) height of the body's underside above its lowest point [m]; inf where none.
        contact: Outline of the bearing area, or None if it has no extent.
    """

    depth: float
    force: float
    volume: float
    excess: float
    cell: float
    bed: np.ndarray
    frozen: np.ndarray
    under: np.ndarray
    contact: Footprint | None

    @property
    def contact_area(self) -> float:
        """Bearing area, seen from above [m2]."""
        return float((self.under < self.bed + BEARING).sum()) * self.cell**2

    def walls(self, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return heights [m] and lower edges [m] of the imprint's walls ahead of a push.

        A wall is between a cell that the body fills and the next one along the push; it reaches
        from the body's underside up to the frozen bed, or to an overhanging underside, in that
        cell.
        Lower edges are above the body's lowest point.

        Args:
            direction: (2,) along an axis of the plane.

        Returns:
            Two (m,) arrays; each wall is one cell wide.
        """
        axis, sign = int(np.argmax(np.abs(direction))), int(np.sign(direction @ [1, 1]))
        ahead = np.minimum(self.frozen, self.under)
        ahead = np.roll(ahead, -sign, axis=axis)  # The border of the grid is outside the bag.
        height = np.where(np.isfinite(self.under), ahead - self.under, 0.0)
        inside = height > 0.0
        return height[inside], self.under[inside]


def depth_in_bed(
    imprint: Imprint, part: PartSurface, R_JA: np.ndarray, p_middle: np.ndarray, low: float
) -> float:
    """Return how deep a part that is added to the body would penetrate the frozen bed [m].

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
    # The height field rises into every hole of the body; a real bag does not enter narrow ones.
    bulging = ndimage.grey_opening(imprint.bed, size=round(NARROW / imprint.cell))
    bed, under = (height[tuple(at[inside].T)] for height in (bulging, imprint.under))
    below = np.minimum(bed, under) - points[inside, 2]  # Above the body there is no bed.
    return float(np.max(below, initial=0.0))


@dataclass(frozen=True, eq=False)
class PartSurface:
    """Points spread over a part's surface, and a cache of those that face down per posture.

    Attributes:
        samples: In the product frame A.
        below: Per posture and cell size the points that face down, turned, and one per cell.
    """

    samples: SurfaceSamples
    below: dict[tuple[bytes, float], tuple[np.ndarray, SurfaceSamples]] = field(
        default_factory=dict
    )

    def facing_down(self, R_JA: np.ndarray, cell: float) -> tuple[np.ndarray, SurfaceSamples]:
        """Return points (m, 3) that face down in a posture, turned, and one sample per cell."""
        key = R_JA.tobytes(), cell
        if key not in self.below:
            own = self.samples
            down = np.flatnonzero(own.normals @ R_JA[2] < 0.0)
            points, normals = own.points[down] @ R_JA.T, own.normals[down] @ R_JA.T
            turned = SurfaceSamples(own.name, points, normals, own.areas[down])
            self.below[key] = points, _one_per_cell(turned, cell)
        return self.below[key]


def samples_of(solid: Solid) -> PartSurface:
    """Return points spread over a part's surface in the product frame A, with a fixed seed."""
    mesh = trimesh.Trimesh(solid.vertices, solid.faces, process=False)
    count = max(FEWEST, round(mesh.area / SPACING**2))
    sampled = trimesh.sample.sample_surface(mesh, count, seed=0)
    points, faces = sampled[0], sampled[1]
    areas = np.full(count, mesh.area / count)
    normals = mesh.face_normals[faces]
    return PartSurface(SurfaceSamples(solid.name, points, normals, areas))


def _one_per_cell(samples: SurfaceSamples, cell: float) -> SurfaceSamples:
    """Return a turned surface as the bed model samples it."""
    if not len(samples.points):
        return samples
    under = samples.underside(np.eye(3), cell)
    normals = np.column_stack([under.slopes, -np.ones(len(under.slopes))])
    lengths = np.linalg.norm(normals, axis=1)
    normals, areas = normals / lengths[:, None], under.areas * lengths
    return SurfaceSamples(samples.name, under.points, normals, areas)


@dataclass(frozen=True, eq=False)
class Pressed:
    """A body that has been pressed into a bed.

    Attributes:
        bed: Soft, with the body in it; the next body is pressed into the same one, inflated anew.
        cap: (n, n) its surface before [m].
        p_JA: (3,) place of the product frame; its rotation is the posture [m].
        points: (m, 3) points of the body that face down, in J [m].
        depth: Of the lowest point below the apex [m].
        force: That the bed bears [N].
    """

    bed: Bed
    cap: np.ndarray
    p_JA: np.ndarray
    points: np.ndarray
    depth: float
    force: float


def pressed(
    parts: Iterable[PartSurface],
    R_JA: np.ndarray,
    p_middle: np.ndarray,
    jig: JigParameters,
    force: float,
) -> Pressed:
    """Press a body into the bed.

    Args:
        parts: Surfaces of its parts in A.
        R_JA: (3, 3) posture.
        p_middle: (2,) point of the turned body, in the plane, that goes to the middle of the bag.
        jig: Bag and beads.
        force: At which the pressing ends [N].
    """
    seen = [part.facing_down(R_JA, jig.bag.cell) for part in parts]
    points = np.concatenate([points for points, _ in seen])
    samples = [under for _, under in seen]
    body = SurfaceSamples(
        "body",
        np.concatenate([part.points for part in samples]),
        np.concatenate([part.normals for part in samples]),
        np.concatenate([part.areas for part in samples]),
    )
    lowest = float(points[:, 2].min())
    points = points[points[:, 2] <= lowest + jig.bag.cap_height]
    bed, apex = _bed_of(jig), jig.bag.cap_height
    bed.inflate()
    cap = bed.heights.copy()
    descent = _Descent(bed, body, p_middle, apex - lowest)
    depth, borne = descent.down_to(force, apex - jig.bag.floor)
    p_JA = np.array([*(-p_middle), apex - depth - lowest])
    return Pressed(bed, cap, p_JA, points + p_JA, depth, borne)


def press(
    parts: Iterable[PartSurface],
    R_JA: np.ndarray,
    p_middle: np.ndarray,
    jig: JigParameters,
    force: float,
) -> Imprint:
    """Return the imprint of a body that is pressed into the bed; arguments as of `pressed`."""
    body = pressed(parts, R_JA, p_middle, jig, force)
    return _imprint(body, jig.vacuum.contraction * jig.vacuum.closing(jig.vacuum.pressure))


@dataclass(frozen=True, eq=False)
class _Descent:
    """A body that is pushed down into a bed.

    Attributes:
        bed: Freshly inflated.
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
            if now > OVERSHOOT * force and step > SHORTEST:
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
def _bed_of(jig: JigParameters) -> Bed:
    """Return one bed for all imprints of a jig; it is re-inflated for each."""
    return Bed(jig.bag, jig.soil)


def _imprint(body: Pressed, contraction: float) -> Imprint:
    """Return the imprint: the bed's surface, soft and frozen, and the body's underside above it.

    Args:
        body: In the soft bed, which is frozen.
        contraction: Volumetric shrinkage of the bed when it freezes.
    """
    bed, points = body.bed, body.points
    low, cell = bed.bag.cap_height - body.depth, bed.bag.cell
    at = np.rint((points[:, :2] - bed.axis[0]) / cell).astype(int)
    inside = np.all((at >= 0) & (at < len(bed.axis)), axis=1)
    under = np.full(bed.heights.shape, np.inf)
    np.minimum.at(under, tuple(at[inside].T), points[inside, 2])
    bearing = bed.active & (under < bed.heights + BEARING)
    volume = float(np.maximum(body.cap - bed.heights, 0.0).sum()) * cell**2
    outline = footprint(np.column_stack([bed.x[bearing], bed.y[bearing]]))
    excess, soft = bed.ledger.waiting, bed.heights - low
    bed.jam(contraction)
    frozen = bed.heights - low
    return Imprint(body.depth, body.force, volume, excess, cell, soft, frozen, under - low, outline)
