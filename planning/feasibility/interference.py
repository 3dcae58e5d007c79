"""Interference-free matrices M_j: which part can leave along j without hitting which other part.

Part i, moved along +d to infinity, hits the stationary part k exactly if, over some point p of the
plane perpendicular to d, the top of k lies above the bottom of i. Only i's down-faces and k's
up-faces matter, the motion is not discretised, and faces that slide on each other do not block.
Moving k along -d meets the same pair of faces, so M_-d is the transpose of M_+d: three axes
suffice.

A part blocks only by more than a tolerance: the region of p where the tops exceed the bottoms by
more than ``FIT_TOLERANCE`` must be wide enough for a disc of that radius. So a shaft drawn line to
line with its hole, or a bolt with its thread, leaves along its axis although the facets of the two
surfaces cross by their sagitta.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planning.feasibility.blocking import FRAGILE, Decision, decisions
from planning.feasibility.coarse import coarsened
from planning.feasibility.directions import DIRECTIONS, axis_index, opposite, unit_vector
from planning.feasibility.envelope import PLANE, Envelope, Faces, envelope
from planning.feasibility.face_pairs import heights_over
from planning.feasibility.solids import Solid

# [m] [A] Above the sagitta r (1 - cos(pi / n)) of usual facets (7 um for r 6 mm, n 64) and the
# rounding of mesh files, below any overlap that matters: the decisions for the motor unit stay the
# same from 1e-7 to 5e-4 m.
FIT_TOLERANCE = 5e-5

HALF = 0.5  # [M] Of the faces: where fewer are left, all are compared sooner than probed.


@dataclass(frozen=True)
class Blocker:
    """Evidence that one part cannot leave along a direction.

    Attributes:
        moving: Name of the part that is moved.
        staying: Name of the stationary part that it hits.
        direction: In A, "+x" ... "-z".
        p_AoQ: Point of the stationary part that is hit [m].
        travel: Distance that the moving part travels until it hits at that point [m].
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
            infinity does not hit the stationary part k; diagonals 0.
        blockers: One per 0 off the diagonals.
        margin: Per direction an (n, n) float matrix [m]: change of the tolerance, up or down, at
            which the decision flips, capped at ``FRAGILE`` times the tolerance.
    """

    free: Mapping[str, np.ndarray]
    blockers: tuple[Blocker, ...]
    margin: Mapping[str, np.ndarray]


def interference(
    solids: Sequence[Solid],
    tolerance: float | np.ndarray = FIT_TOLERANCE,
    tell: Callable[[int], None] = lambda done: None,
    wanted: np.ndarray | None = None,
) -> Interference:
    """Return the six matrices M_j of n parts in matrix order.

    Args:
        solids: The parts.
        tolerance: Height of overlap and radius of the region that do not count [m]; one for all, or
            (n, n), symmetric, one per pair.
        tell: Is told how many pairs have been decided, each once along every axis.
        wanted: (n, n) bool, symmetric: pairs to decide, others count as free; None for all.
    """
    count = len(solids)
    tolerances = np.broadcast_to(tolerance, (count, count))
    free = {j: 1 - np.eye(count, dtype=int) for j in DIRECTIONS}
    margin = {j: FRAGILE * tolerances for j in DIRECTIONS}
    blockers = []
    levels = [float(level) for level in np.unique(tolerances)]
    shapes = {level: [coarsened(solid, level) for solid in solids] for level in levels}
    every, done = ~np.eye(count, dtype=bool), 0
    every &= True if wanted is None else wanted
    for forward in ("+x", "+y", "+z"):
        axis = axis_index(forward)
        own = {solid: envelope(solid, axis) for solid in solids}
        for level in levels:
            views = [own.get(shape) or envelope(shape, axis) for shape in shapes[level]]
            now = (tolerances == level) & every
            decided = decisions(
                views,
                level,
                simplified=_faces(shapes[level]) < HALF * _faces(solids),
                wanted=now,
                tell=lambda own, before=done: tell((before + own) // 2),
            )
            done += int(np.count_nonzero(now))
            for (i, k), decision in decided.items():
                blocked = decision.point is not None
                margin[forward][i, k] = margin[opposite(forward)][k, i] = decision.margin
                free[forward][i, k] = free[opposite(forward)][k, i] = int(not blocked)
            for hit in evidence_of_hits(views, forward, decided, level):
                blockers += [hit, hit.reversed()]
    return Interference(free, tuple(blockers), margin)


def _faces(solids: Sequence[Solid]) -> int:
    return sum(len(solid.faces) for solid in solids)


def first_hit(
    moving: Envelope, staying: Envelope, direction: str, tolerance: float = FIT_TOLERANCE
) -> Blocker | None:
    """Return where a part moved along +x, +y or +z hits another, or None if it is free.

    Args:
        moving: Envelope along the axis of the direction.
        staying: The same for the stationary part.
        direction: "+x", "+y" or "+z".
        tolerance: Height of overlap and radius of the region that do not count [m].
    """
    views = [moving, staying]
    decided = {parts: d for parts, d in decisions(views, tolerance).items() if parts == (0, 1)}
    return next(evidence_of_hits(views, direction, decided, tolerance), None)


def evidence_of_hits(
    views: Sequence[Envelope],
    direction: str,
    decided: Mapping[tuple[int, int], Decision],
    tolerance: float,
) -> Iterator[Blocker]:
    """Yield the point that is hit, for each pair that is blocked.

    Args:
        views: The parts' envelopes along one axis.
        direction: "+x", "+y" or "+z".
        decided: What ``decisions`` returned for them.
        tolerance: Overlap that does not count [m].
    """
    points = {parts: d.point for parts, d in decided.items() if d.point is not None}
    seen = list(PLANE[axis_index(direction)])
    floors = _heights([view.up for view in views], points, 0)
    ceilings = _heights([view.down for view in views], points, 1)
    tops = _heights([view.up for view in views], points, 1)
    for (i, k), point in points.items():
        height, travel = _nearest(floors[i, k], ceilings[i, k], tolerance)
        if not np.isfinite(travel):  # The two share volume over this point: no free travel.
            height, travel = float(np.max(tops[i, k], initial=views[k].low[2])), 0.0
        p_AoQ = np.empty(3)
        p_AoQ[seen] = [*point, height]
        x, y, z = (float(value) for value in p_AoQ)
        yield Blocker(views[i].name, views[k].name, direction, (x, y, z), travel)


def _heights(
    faces: Sequence[Faces], points: Mapping[tuple[int, int], np.ndarray], place: int
) -> dict[tuple[int, int], np.ndarray]:
    """Return the heights over each pair's point, of the faces of its part at place 0 or 1."""
    own: dict[int, list[tuple[int, int]]] = {}
    for parts in points:
        own.setdefault(parts[place], []).append(parts)
    found: dict[tuple[int, int], np.ndarray] = {}
    for part, pairs in own.items():
        over = heights_over(faces[part], np.array([points[parts] for parts in pairs]))
        found |= dict(zip(pairs, over, strict=True))
    return found


def _nearest(floors: np.ndarray, ceilings: np.ndarray, tolerance: float) -> tuple[float, float]:
    """Return height and distance of the nearest ceiling above any floor [m]; infinity if none.

    Args:
        floors: Heights of the moving part's up-faces over a point [m].
        ceilings: Heights of the stationary part's down-faces over it [m].
        tolerance: Overlap that does not count [m].
    """
    gaps = ceilings[None] - floors[:, None]
    ahead = np.where(gaps >= -tolerance, gaps, np.inf)
    if not ahead.size or not np.isfinite(ahead).any():
        return 0.0, np.inf
    nearest = np.unravel_index(int(ahead.argmin()), ahead.shape)
    return float(ceilings[nearest[1]]), max(0.0, float(ahead[nearest]))
