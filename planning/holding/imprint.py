"""How a body sinks into the soft bed, and the imprint it leaves: the cell's own bed model, slowly.

The body is pushed straight down into a freshly inflated bag, step by step, until the bed bears the
press force. The posture is kept, as a hand keeps it. The bed is that of the twin on a coarser grid.
Bodies come out 2 to 3 mm deeper than in the twin (the motor's can: 10.5 against 8 mm), where the
arm stops at the first 20 N that it feels.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import trimesh
from scipy import ndimage

from cell.soft_jig import JigParameters, SurfaceSamples
from cell.soft_jig.bed import Bed
from planning.fixing.solids import Solid
from planning.holding.footprint import Footprint, footprint

CELL = 0.002  # [m] [D] 60 cells across: depths within 0.5 mm of those on the default 1.5 mm.
STEP = 0.0005  # [m] Between two looks at the force.
SPACING = 0.0005  # [m] [D] 16 points per cell, so that hardly any cell under a body gets none.
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
        return float((self.under < self.bed + STEP).sum()) * self.cell**2

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
    imprint: Imprint, part: SurfaceSamples, R_JA: np.ndarray, p_middle: np.ndarray, low: float
) -> float:
    """Return how deep a part that joins the body would be inside the frozen bed [m].

    Args:
        imprint: Of the body.
        part: Surface of the part in A.
        R_JA: (3, 3) posture.
        p_middle: (2,) point of the turned body that is over the middle of the bag.
        low: Height of the body's lowest point, turned [m].
    """
    points = part.points @ R_JA.T - [*p_middle, low]
    half = (len(imprint.bed) - 1) // 2
    at = np.rint(points[:, :2] / imprint.cell).astype(int) + half
    inside = np.all((at >= 0) & (at < len(imprint.bed)), axis=1)
    # The height field stands up in every hole of the body; a bag does not enter narrow ones.
    bulging = ndimage.grey_opening(imprint.bed, size=round(NARROW / imprint.cell))
    bed, under = (height[tuple(at[inside].T)] for height in (bulging, imprint.under))
    below = np.minimum(bed, under) - points[inside, 2]  # Above the body there is no bed.
    return float(np.max(below, initial=0.0))


def samples_of(solid: Solid) -> SurfaceSamples:
    """Return points spread over a part's surface in the product frame A, the same every time."""
    mesh = trimesh.Trimesh(solid.vertices, solid.faces, process=False)
    count = max(FEWEST, round(mesh.area / SPACING**2))
    sampled = trimesh.sample.sample_surface(mesh, count, seed=0)
    points, faces = sampled[0], sampled[1]
    areas = np.full(count, mesh.area / count)
    return SurfaceSamples(solid.name, points, mesh.face_normals[faces], areas, SPACING)


def press(
    parts: Iterable[SurfaceSamples],
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
    body = _underside(parts, R_JA, jig.bag.cap_height)
    lowest = float((body.points @ R_JA[2]).min())
    bed, apex = _bed(jig), jig.bag.cap_height
    bed.inflate()
    depth, borne = 0.0, 0.0
    while borne < force and depth < apex - jig.bag.floor:
        step = STEP if borne > force / 2 else 2 * STEP
        depth, dt = depth + step, step / SPEED
        p_JA = np.array([*(-p_middle), apex - depth - lowest])
        pushed = bed.press((R_JA, p_JA), (np.zeros(3), np.array([0, 0, -SPEED])), body, dt)
        bed.settle(dt)
        borne = float(pushed[0][2])
    return _read(bed, body, R_JA, p_JA, depth, borne)


@cache
def _bed(jig: JigParameters) -> Bed:
    """Return one bed for all imprints of a jig: it is inflated anew for each."""
    return Bed(replace(jig.bag, cell=CELL), jig.soil)


def _underside(parts: Iterable[SurfaceSamples], R_JA: np.ndarray, reach: float) -> SurfaceSamples:
    """Return what of a body's surface looks down and can reach the bed."""
    listed = list(parts)
    points = np.concatenate([part.points for part in listed])
    normals = np.concatenate([part.normals for part in listed])
    height = points @ R_JA[2]
    down = (normals @ R_JA[2] < 0.0) & (height <= height.min() + reach)
    areas = np.concatenate([part.areas for part in listed])
    return SurfaceSamples("body", points[down], normals[down], areas[down], SPACING)


def _read(
    bed: Bed, body: SurfaceSamples, R_JA: np.ndarray, p_JA: np.ndarray, depth: float, borne: float
) -> Imprint:
    """Take over the bed's surface and the body's underside over it."""
    cap = Bed(bed.bag, bed.soil).heights
    points = body.points @ R_JA.T + p_JA
    at = np.rint((points[:, :2] - bed.axis[0]) / CELL).astype(int)
    inside = np.all((at >= 0) & (at < len(bed.axis)), axis=1)
    under = np.full(bed.heights.shape, np.inf)
    np.minimum.at(under, tuple(at[inside].T), points[inside, 2])
    low = bed.bag.cap_height - depth
    bearing = bed.active & (under < bed.heights + STEP)
    volume = float(np.maximum(cap - bed.heights, 0.0).sum()) * CELL**2
    outline = footprint(np.column_stack([bed.x[bearing], bed.y[bearing]]))
    return Imprint(
        depth, borne, volume, bed.displaced, CELL, bed.heights - low, under - low, outline
    )
