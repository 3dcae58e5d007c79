"""Where the joints of an arm in the cell must be for a frame of its tool to be at a pose.

What an arm itself can do, from base B to flange F, its model knows (`cell.machines.arms`); here the
base stands somewhere in the world, a tool is on the flange, and joint limits hold.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import Context

from cell.errors import RunFailure
from cell.machines.arm import Arm
from cell.machines.arms.base import LIMIT_MARGIN


class Unreachable(RunFailure):
    """A pose that no acceptable joint configuration reaches, with the reason."""

    def __init__(self, arm: str, frame: str, X_WT: RigidTransform, reason: str) -> None:
        place = ", ".join(f"{value:.3f}" for value in X_WT.translation())
        turn = ", ".join(f"{a:.0f}" for a in np.rad2deg(RollPitchYaw(X_WT.rotation()).vector()))
        super().__init__(
            f"The {arm} arm cannot bring frame '{frame}' to ({place}) m, "
            f"roll-pitch-yaw ({turn}) deg: {reason}."
        )


def tool_pose(arm: Arm, context: Context, frame: Frame, q: np.ndarray) -> RigidTransform:
    """Return X_WT with the arm at ``q`` (dof,) [rad], whatever the context has for it.

    The joints of the tool count as they are in the context (of the plant), which is not changed.
    """
    X_WB, X_FT = _ends(arm, context, frame)
    return X_WB @ arm.model.flange_pose(q) @ X_FT


def ik_solutions(
    arm: Arm, context: Context, frame: Frame, X_WT: RigidTransform, near: np.ndarray
) -> list[np.ndarray]:
    """Return the joint angles (dof,) that put a tool frame T at X_WT, nearest to ``near`` first.

    Every joint whose range allows it is turned by full circles to be as close to ``near`` as its
    limits allow; solutions that cannot keep ``LIMIT_MARGIN`` from the limits are left out.

    Args:
        arm: The arm.
        context: Plant context; the joints of the tool itself count as they are in it.
        frame: Any frame fixed to the flange or to the tool.
        X_WT: Where the frame shall be.
        near: (dof,) joint angles [rad].
    """
    X_WB, X_FT = _ends(arm, context, frame)
    X_BF = X_WB.inverse() @ X_WT @ X_FT.inverse()
    turned = [_nearest_turn(arm, q, near) for q in arm.model.inverse(X_BF, near)]
    inside = [q for q in turned if q is not None]
    return sorted(inside, key=lambda q: float(np.linalg.norm(q - near)))


def solve_ik(
    arm: Arm,
    context: Context,
    frame: Frame,
    X_WT: RigidTransform,
    *,
    near: np.ndarray,
    is_free: Callable[[np.ndarray], bool] | None = None,
) -> np.ndarray:
    """Return the joint angles (dof,) nearest to ``near`` that put the tool frame at X_WT.

    Args:
        arm: The arm.
        context: Plant context; the joints of the tool itself count as they are in it.
        frame: Any frame fixed to the flange or to the tool.
        X_WT: Where the frame shall be.
        near: (dof,) joint angles [rad].
        is_free: Which joint angles are acceptable, for example free of collision; None: all.

    Raises:
        Unreachable: Nothing acceptable; the message says which test failed.
    """
    solutions = ik_solutions(arm, context, frame, X_WT, near)
    for q in solutions:
        if is_free is None or is_free(q):
            return q
    reason = (
        f"all {len(solutions)} joint configurations collide"
        if solutions
        else "out of reach or beyond the joint limits"
    )
    raise Unreachable(arm.name, frame.name(), X_WT, reason)


def joint_limits(arm: Arm) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper joint limits (dof,) [rad] with ``LIMIT_MARGIN`` taken off."""
    lower = np.array([joint.position_lower_limits()[0] for joint in arm.joints])
    upper = np.array([joint.position_upper_limits()[0] for joint in arm.joints])
    return lower + LIMIT_MARGIN, upper - LIMIT_MARGIN


def _ends(arm: Arm, context: Context, frame: Frame) -> tuple[RigidTransform, RigidTransform]:
    """Return X_WB of the base and X_FT of the tool frame on the flange."""
    base = arm.plant.GetFrameByName(arm.model.base_frame, arm.instance)
    flange = arm.plant.GetFrameByName(arm.model.flange_frame, arm.instance)
    return base.CalcPoseInWorld(context), frame.CalcPose(context, flange)


def _nearest_turn(arm: Arm, q: np.ndarray, near: np.ndarray) -> np.ndarray | None:
    """Return q plus full turns: as near as the limits allow, or None where they do not."""
    lower, upper = joint_limits(arm)
    candidates = q + 2 * np.pi * np.array([-2, -1, 0, 1, 2])[:, None]
    allowed = (candidates >= lower) & (candidates <= upper)
    if not allowed.any(axis=0).all():
        return None
    distance = np.where(allowed, abs(candidates - near), np.inf)
    return candidates[distance.argmin(axis=0), np.arange(len(q))]
