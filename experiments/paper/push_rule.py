"""Where the hand starts its push: one rule for all cases and both hands."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context

from cell.simulation.phase import PhaseFailed
from experiments.paper.postures import AXES, MM, Push
from experiments.paper.reach import Fingers
from experiments.paper.rig.stage import Stage
from planning.operations.push.phases import PushLine
from planning.operations.stroke import Stroke

# Least horizontal part of a unit direction that a push can follow: the part lies 84 deg askew.
LEVEL = 0.1


def push_line(
    stage: Stage, root: Context, push: Push, X_WJ: RigidTransform, X_WP: RigidTransform
) -> PushLine:
    """Return the straight line of the closed hand's frame T that a push takes.

    The one rule for all cases: the fingers' lowest point at `height_fraction` of the exposed height
    of the pushed face where the hand meets it, and `bed_clearance` above the bed at least; the hand
    points down with its fingers' narrow sides ahead and starts `start_gap` before it touches.

    Args:
        stage: Part, jig and hand.
        root: Context of the diagram.
        push: Which push.
        X_WJ: Where the jig is, or is expected to be.
        X_WP: The same of the part.

    Raises:
        PhaseFailed: The hand would not meet the part, or the part lies on the side to be pushed.
    """
    numbers = stage.config.push
    foot, top = (X_WP @ (np.array(point) * MM) for point in (push.foot, push.top))
    direction = X_WP.rotation() @ AXES[push.along]
    if np.hypot(*direction[:2]) < LEVEL:
        raise PhaseFailed("approach", "the part lies on the side it is to be pushed from")
    direction = np.array([direction[0], direction[1], 0.0]) / np.hypot(*direction[:2])
    bed = bed_height(stage, root, X_WJ, foot[:2])
    low = max(foot[2], bed)
    height = max(low + numbers.height_fraction * (top[2] - low), bed + numbers.bed_clearance)
    fingers = Fingers.of_hand(stage)
    travel = fingers.travel(X_WP @ stage.surface.T, top[:2], height, direction)
    if not np.isfinite(travel):
        raise PhaseFailed("approach", "the closed hand would pass the part without a touch")
    p_WT = np.array([*top[:2], height + fingers.below_tip])
    p_WT += (travel - numbers.start_gap) * direction
    stroke = Stroke(numbers.stroke, numbers.speed, numbers.acceleration)
    return PushLine(RigidTransform(leading(direction), p_WT), direction, stroke)


def leading(direction: np.ndarray) -> RotationMatrix:
    """Return R_WT of a hand that points down and has -y of T along a level direction (3,)."""
    turn = float(np.arctan2(-direction[0], direction[1]))
    return RotationMatrix.MakeZRotation(turn) @ RotationMatrix.MakeXRotation(np.pi)


def bed_height(
    stage: Stage, root: Context, X_WJ: RigidTransform, p_WQ: np.ndarray, radius: float = 5e-3
) -> float:
    """Return the highest the fixture stands in W around a point (2,) [m]."""
    p_JQ = X_WJ.inverse() @ np.array([*p_WQ, X_WJ.translation()[2]])
    ring = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    around = p_JQ[:2] + radius * np.column_stack([np.cos(ring), np.sin(ring)])
    heights = stage.fixture.height_at(root, np.vstack([p_JQ[:2], around]))
    return float(X_WJ.translation()[2] + heights.max())
