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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planning.fixing.blocking import FRAGILE, decisions
from planning.fixing.directions import DIRECTIONS, axis_index, opposite, unit_vector
from planning.fixing.envelope import PLANE, Envelope, envelope
from planning.fixing.solids import Solid

# [m] [A] Above the sagitta r (1 - cos(pi / n)) of usual facets (7 um for r 6 mm, n 64) and the
# rounding of mesh files, below any overlap that matters: the decisions for the motor unit stay the
# same from 1e-7 to 5e-4 m.
FIT_TOLERANCE = 5e-5


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
        margin: Per direction an (n, n) float matrix [m]: by how much the tolerance can change, up
            or down, before the decision flips; what is ``FRAGILE`` of the tolerance or more is
            given as that.
    """

    free: Mapping[str, np.ndarray]
    blockers: tuple[Blocker, ...]
    margin: Mapping[str, np.ndarray]


def interference(solids: Sequence[Solid], tolerance: float = FIT_TOLERANCE) -> Interference:
    """Return the six matrices M_j of n parts in matrix order."""
    count = len(solids)
    free = {j: 1 - np.eye(count, dtype=int) for j in DIRECTIONS}
    margin = {j: np.full((count, count), FRAGILE * tolerance) for j in DIRECTIONS}
    blockers = []
    for forward in ("+x", "+y", "+z"):
        views = [envelope(solid, axis_index(forward)) for solid in solids]
        for (i, k), decision in decisions(views, tolerance).items():
            margin[forward][i, k] = margin[opposite(forward)][k, i] = decision.margin
            if decision.point is not None:
                hit = _evidence(views[i], views[k], forward, decision.point, tolerance)
                blockers += [hit, hit.reversed()]
                free[forward][i, k] = free[opposite(forward)][k, i] = 0
    return Interference(free, tuple(blockers), margin)


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
    decision = decisions([moving, staying], tolerance).get((0, 1))
    if decision is None or decision.point is None:
        return None
    return _evidence(moving, staying, direction, decision.point, tolerance)


def _evidence(
    moving: Envelope, staying: Envelope, direction: str, point: np.ndarray, tolerance: float
) -> Blocker:
    height, travel = _nearest_faces(moving, staying, point, tolerance)
    p_AoQ = np.empty(3)
    p_AoQ[list(PLANE[axis_index(direction)])] = [*point, height]
    x, y, z = (float(value) for value in p_AoQ)
    return Blocker(moving.name, staying.name, direction, (x, y, z), travel)


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
