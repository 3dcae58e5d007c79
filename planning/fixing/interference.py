"""Interference-free matrices M_j: which part can leave along j without hitting which other part.

Part i moved along +d to infinity hits part k, which stays, exactly when over some point p of the
plane across d the top of k lies above the bottom of i. Only i's down-faces and k's up-faces matter,
nothing is stepped, faces that slide on each other do not block, and since the same pair (i below,
k above) is met by moving k along -d, M_-d is the transpose of M_+d: three axes suffice.

Blocked is what blocks by more than a tolerance: the region of p where the tops exceed the bottoms
by more than ``FIT_TOLERANCE`` must be wide enough for a disc of that radius. So a shaft drawn line
to line with its hole, or a bolt with its thread, leaves along its axis although the facets of the
two surfaces cross by their sagitta.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planning.fixing.clipping import Polygons, point_in_wide_union, triangle_overlaps
from planning.fixing.directions import DIRECTIONS, axis_index, opposite, unit_vector
from planning.fixing.envelope import PLANE, Envelope, Faces, envelope
from planning.fixing.solids import Solid

# [m] [A] Above the sagitta r (1 - cos(pi / n)) of usual facets (7 um for r 6 mm, n 64) and the
# rounding of mesh files, below any overlap that matters: the decisions for the motor unit stay the
# same from 1e-7 to 5e-4 m.
FIT_TOLERANCE = 5e-5

FIRST_BATCH = 64  # Most blocked pairs of parts show it in their largest face pairs.
BATCH = 8192  # Bounds the memory of clipping to some MB.
MASK_SIZE = 2_000_000  # Bounds the memory of the search for face pairs to some MB.


@dataclass(frozen=True)
class Blocker:
    """Evidence that one part cannot leave along a direction.

    Attributes:
        moving: Name of the part that is moved.
        staying: Name of the part that it hits.
        direction: In A, "+x" ... "-z".
        p_AoQ: Point of the staying part that is hit [m].
        travel: How far the moving part gets before it hits at that point [m].
    """

    moving: str
    staying: str
    direction: str
    p_AoQ: tuple[float, float, float]
    travel: float

    def reversed(self) -> Blocker:
        """Return the same hit with the other part moving the other way."""
        p_AoQ = np.array(self.p_AoQ) - self.travel * unit_vector(self.direction)
        x, y, z = (float(value) for value in p_AoQ)
        other_way = opposite(self.direction)
        return Blocker(self.staying, self.moving, other_way, (x, y, z), self.travel)


@dataclass(frozen=True, eq=False)
class Interference:
    """Interference-free matrices with their evidence.

    Attributes:
        free: Per direction j an (n, n) int matrix M_j: M_j[i, k] = 1 if part i moved along j to
            infinity does not hit part k, which stays; diagonals 0.
        blockers: One per 0 off the diagonals.
    """

    free: Mapping[str, np.ndarray]
    blockers: tuple[Blocker, ...]


def interference(solids: Sequence[Solid], tolerance: float = FIT_TOLERANCE) -> Interference:
    """Return the six matrices M_j of n parts in matrix order."""
    free = {j: 1 - np.eye(len(solids), dtype=int) for j in DIRECTIONS}
    index = {solid.name: i for i, solid in enumerate(solids)}
    blockers = []
    for forward in ("+x", "+y", "+z"):
        for hit in _hits(solids, forward, tolerance):
            blockers += [hit, hit.reversed()]
    for blocker in blockers:
        free[blocker.direction][index[blocker.moving], index[blocker.staying]] = 0
    return Interference(free, tuple(blockers))


def _hits(solids: Sequence[Solid], direction: str, tolerance: float) -> Iterator[Blocker]:
    envelopes = [envelope(solid, axis_index(direction)) for solid in solids]
    for moving in envelopes:
        for staying in envelopes:
            hit = moving is not staying and first_hit(moving, staying, direction, tolerance)
            if hit:
                yield hit


def first_hit(
    moving: Envelope, staying: Envelope, direction: str, tolerance: float = FIT_TOLERANCE
) -> Blocker | None:
    """Return where a part moved along +x, +y or +z hits another, or None if it is free.

    Args:
        moving: Envelope along the axis of the direction.
        staying: The same for the part that stays.
        direction: "+x", "+y" or "+z".
        tolerance: Height of overlap and radius of the region that do not count [m].
    """
    if not _silhouettes_cross(moving, staying, tolerance):
        return None
    point = _blocked_point(moving.down, staying.up, tolerance)
    if point is None:
        return None
    height, travel = _nearest_faces(moving, staying, point, tolerance)
    p_AoQ = np.empty(3)
    p_AoQ[list(PLANE[axis_index(direction)])] = [*point, height]
    x, y, z = (float(value) for value in p_AoQ)
    return Blocker(moving.name, staying.name, direction, (x, y, z), travel)


def _silhouettes_cross(moving: Envelope, staying: Envelope, tolerance: float) -> bool:
    overlap = np.minimum(moving.high, staying.high) - np.maximum(moving.low, staying.low)
    above = staying.high[2] > moving.low[2] + tolerance
    return bool(above and np.all(overlap[:2] > 2.0 * tolerance))


def _blocked_point(down: Faces, up: Faces, tolerance: float) -> np.ndarray | None:
    """Return a point (2,) of the plane over which ``up`` lies above ``down``, if there is one.

    A single pair of faces that overlaps widely enough settles it; only regions made of slivers need
    their union.
    """
    pairs = _crossing_pairs(down, up, tolerance)
    slivers: list[np.ndarray] = []
    start, size = 0, FIRST_BATCH
    while start < len(pairs):
        regions = _blocked_regions(down, up, pairs[start : start + size], tolerance)
        widths = regions.inradius_bounds()
        if len(widths) and widths.max() >= tolerance:
            return regions.centre(int(widths.argmax()))
        slivers += regions.outlines()
        start, size = start + size, BATCH
    return point_in_wide_union(slivers, tolerance) if slivers else None


def _crossing_pairs(down: Faces, up: Faces, tolerance: float) -> np.ndarray:
    """Return (p, 2) indices of faces whose boxes overlap with up above down, widest first."""
    near_down, near_up = _near(down, up), _near(up, down)
    rows = max(1, MASK_SIZE // max(1, len(near_up)))
    found = [np.empty((0, 2), int)]
    for first in range(0, len(near_down), rows):
        d, u = near_down[first : first + rows, None], near_up[None]
        mask = up.high[u, 2] > down.low[d, 2] + tolerance
        for axis in (0, 1):
            mask &= down.low[d, axis] < up.high[u, axis]
            mask &= down.high[d, axis] > up.low[u, axis]
        row, column = np.nonzero(mask)
        found.append(np.stack([near_down[first + row], near_up[column]], axis=1))
    pairs = np.concatenate(found)
    d, u = pairs.T
    low = np.maximum(down.low[d, :2], up.low[u, :2])
    sizes = np.prod(np.minimum(down.high[d, :2], up.high[u, :2]) - low, axis=1)
    return pairs[np.argsort(-sizes, kind="stable")]


def _near(faces: Faces, others: Faces) -> np.ndarray:
    """Return indices of the faces that meet the others' common bounding rectangle."""
    if not len(others.low):
        return np.empty(0, int)
    low, high = others.low[:, :2].min(axis=0), others.high[:, :2].max(axis=0)
    return np.flatnonzero(np.all((faces.low[:, :2] < high) & (faces.high[:, :2] > low), axis=1))


def _blocked_regions(down: Faces, up: Faces, pairs: np.ndarray, tolerance: float) -> Polygons:
    """Return where each up-face lies above its down-face by more than the tolerance."""
    d, u = pairs.T
    regions = triangle_overlaps(down.corners[d], up.corners[u])
    excess = up.planes[u] - down.planes[d]
    slope, offset = excess[:, None, :2], excess[:, 2] - tolerance
    regions = regions.clipped((regions.corners * slope).sum(axis=2) + offset[:, None])
    return regions.chosen((regions.count >= 3) & (regions.areas() > 0.0))


def _nearest_faces(
    moving: Envelope, staying: Envelope, point: np.ndarray, tolerance: float
) -> tuple[float, float]:
    """Return the height of the staying face that is hit over a point, and the travel to it [m]."""
    ceilings = staying.down.heights_over(point)
    gaps = ceilings[None] - moving.up.heights_over(point)[:, None]
    ahead = np.where(gaps >= -tolerance, gaps, np.inf)
    if not np.isfinite(ahead).any():  # Over this point the two share volume: they start blocked.
        return float(np.max(staying.up.heights_over(point), initial=staying.low[2])), 0.0
    nearest = np.unravel_index(int(ahead.argmin()), ahead.shape)
    return float(ceilings[nearest[1]]), max(0.0, float(ahead[nearest]))
