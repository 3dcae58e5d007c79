"""Slanted directions: the matrices M_d of motions at an angle to the axes of the product frame.

The parts are turned until the direction points along z and decided as for the six directions, with
the same tolerance, margins and evidence. A slanted direction d and its opposite are one axis:
M_-d is the transpose of M_d.

The six directions have labels of two characters; that of a slanted one is its vector, for example
"(0.5, 0, 0.866)". Wherever a posture is asked for, which is always one of the six, a slanted
direction counts as the axis nearest to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planning.feasibility.blocking import FRAGILE, Decision, decisions
from planning.feasibility.directions import DIRECTIONS, axis_index, unit_vector
from planning.feasibility.envelope import Envelope, envelope
from planning.feasibility.interference import Blocker, evidence_of_hits
from planning.feasibility.solids import Solid

AS_NEAR = 1e-6  # Cosines this close are equal: at 45 degrees, rounding does not choose the axis.


@dataclass(frozen=True, eq=False)
class Slanted:
    """One slanted direction, and which part leaves which other along it.

    Attributes:
        direction: (3,) unit vector in A.
        free: (n, n) int M_d: M_d[i, k] = 1 if part i moved along the direction to infinity does not
            hit the stationary part k; diagonal 0.
        margin: (n, n) float [m]: change of the tolerance at which the decision flips, capped as for
            the six; None for a plan that was read from a file.
        blockers: One per 0 off the diagonal, with the direction's label.
    """

    direction: tuple[float, float, float]
    free: np.ndarray
    margin: np.ndarray | None
    blockers: tuple[Blocker, ...]

    @cached_property
    def label(self) -> str:
        """Name of the direction, for example "(0.5, 0, 0.866)"."""
        return direction_label(self.direction)


def direction_label(direction: Sequence[float]) -> str:
    """Return a vector as words; directions that differ by a milliradian or more differ here."""
    x, y, z = (round(float(value), 3) + 0.0 for value in direction)  # Turns -0 into 0.
    return f"({x:g}, {y:g}, {z:g})"


def nearest_axis(direction: Sequence[float], up: str) -> str:
    """Return the one of the six directions nearest to a vector; midway, the one along ``up``."""
    cosines = {j: float(np.dot(direction, unit_vector(j))) for j in DIRECTIONS}
    nearest = [j for j in DIRECTIONS if cosines[j] >= max(cosines.values()) - AS_NEAR]
    return next((j for j in nearest if axis_index(j) == axis_index(up)), nearest[0])


def turned_to_z(solid: Solid, axis: np.ndarray) -> Solid:
    """Return a part turned so that an axis (3,) points along +z."""
    R = _rotation(axis)
    return Solid(solid.name, solid.vertices @ R.T, solid.faces, solid.mass, R @ solid.p_AoG)


Decided = Mapping[tuple[int, int], Decision]
"""A decision for each ordered pair (moving, stationary) of parts that is not free at once."""


def decided_along(solids: Sequence[Solid], axis: np.ndarray, tolerance: float) -> Decided:
    """Decide which parts block which others along an axis (3,); others are free."""
    return decisions(_views(solids, axis), tolerance)


def axis_matrix(decided: Decided, count: int, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return M_d (n, n) int and its margins [m] of n parts; those of the other way are transposed.

    Args:
        decided: As ``decided_along`` returned it.
        count: Number n of parts.
        tolerance: As for the six directions [m].
    """
    free = 1 - np.eye(count, dtype=int)
    margin = np.full((count, count), FRAGILE * tolerance)
    for pair, decision in decided.items():
        free[pair] = int(decision.point is None)
        margin[pair] = decision.margin
    return free, margin


def slanted_pair(
    solids: Sequence[Solid], axis: np.ndarray, tolerance: float, decided: Decided | None = None
) -> tuple[Slanted, Slanted]:
    """Return both directions of an axis (3,) with their evidence.

    Args:
        solids: The n parts in matrix order, threads cut out.
        axis: Unit vector in A.
        tolerance: As for the six directions [m].
        decided: What ``decided_along`` returned for all these parts, if it is known already.
    """
    if decided is None:
        decided = decided_along(solids, axis, tolerance)
    free, margin = axis_matrix(decided, len(solids), tolerance)
    ways = [tuple(float(value) + 0.0 for value in sign * axis) for sign in (1.0, -1.0)]
    forward, backward = (direction_label(way) for way in ways)
    there, back = [], []
    for hit in evidence_of_hits(_views(solids, axis), "+z", decided, tolerance):
        p_AoQ = _rotation(axis).T @ np.array(hit.p_AoQ)
        p_start = p_AoQ - hit.travel * axis
        there.append(_blocker(hit.moving, hit.staying, forward, p_AoQ, hit.travel))
        back.append(_blocker(hit.staying, hit.moving, backward, p_start, hit.travel))
    (x, y, z), (u, v, w) = ways
    return (
        Slanted((x, y, z), free, margin, tuple(there)),
        Slanted((u, v, w), free.T.copy(), margin.T.copy(), tuple(back)),
    )


def _rotation(axis: np.ndarray) -> np.ndarray:
    """Return a rotation (3, 3) that brings an axis to +z; its rows are the new axes."""
    side = np.eye(3)[int(np.abs(axis).argmin())]
    across = np.cross(side, axis)
    across /= np.linalg.norm(across)
    return np.array([across, np.cross(axis, across), axis])


def _views(solids: Sequence[Solid], axis: np.ndarray) -> list[Envelope]:
    return [envelope(turned_to_z(solid, axis), axis=2) for solid in solids]


def _blocker(moving: str, staying: str, label: str, p_AoQ: np.ndarray, travel: float) -> Blocker:
    x, y, z = (float(value) for value in p_AoQ)
    return Blocker(moving, staying, label, (x, y, z), travel)
