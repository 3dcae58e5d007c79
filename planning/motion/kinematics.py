"""Where the joints must be for a tool frame to be at a pose: closed-form kinematics of the UR5e.

The arm's frames follow the maker's Denavit-Hartenberg convention: B is the base (``base_link``) and
F the flange. A pose has up to eight solutions (shoulder left or right, elbow up or down, wrist
flipped or not), each joint of which may also be turned by a full circle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import Context

from cell.errors import CellError
from cell.machines.arm import Arm

# Denavit-Hartenberg parameters of the UR5e [m], [rad]
# [R Universal_Robots_ROS2_Description, commit 2221ec0f].
DH_D = np.array([0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996])
DH_A = np.array([0.0, -0.425, -0.3922, 0.0, 0.0, 0.0])
DH_ALPHA = np.array([np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0])

LIMIT_MARGIN = 0.05  # Kept from each joint's limit [rad] [A].
# A cosine this far beyond 1 is rounding at the edge of the workspace, not out of reach.
ROUNDING = 1e-9
# Below this sine of wrist 2, wrist 1 and wrist 3 turn about the same axis.
SINGULAR = 1e-7


class Unreachable(CellError):
    """A pose that no acceptable joint configuration reaches, with the reason."""

    def __init__(self, arm: str, frame: str, X_WT: RigidTransform, reason: str) -> None:
        place = ", ".join(f"{value:.3f}" for value in X_WT.translation())
        turn = ", ".join(f"{a:.0f}" for a in np.rad2deg(RollPitchYaw(X_WT.rotation()).vector()))
        super().__init__(
            f"The {arm} arm cannot bring frame '{frame}' to ({place}) m, "
            f"roll-pitch-yaw ({turn}) deg: {reason}."
        )


def flange_pose(q: np.ndarray) -> RigidTransform:
    """Return X_BF for joint angles ``q`` (6,)."""
    return RigidTransform(_chain(q, 0, 6))


def inverse(X_BF: RigidTransform, wrist_3: float = 0.0) -> np.ndarray:
    """Return all joint angles that put the flange at X_BF.

    Args:
        X_BF: Pose of the flange in the base.
        wrist_3: Angle to use where wrist 1 and wrist 3 are aligned and only their sum counts.

    Returns:
        (n, 6) with n in 0..8, every angle in (-pi, pi].
    """
    T_BF = X_BF.GetAsMatrix4()
    solutions = []
    for pan, flip in product(_pan_angles(T_BF), (1.0, -1.0)):
        wrist = _wrist_angles(T_BF, pan, flip, wrist_3)
        if wrist is not None:
            solutions += _elbow_solutions(T_BF, pan, *wrist)
    return np.array([_wrapped(q) for q in solutions]).reshape(-1, 6)


def tool_pose(arm: Arm, context: Context, frame: Frame, q: np.ndarray) -> RigidTransform:
    """Return X_WT with the arm at ``q`` (6,), whatever the context has for it.

    The joints of the tool count as they are in the context (of the plant), which is not changed.
    """
    X_WB, X_FT = _ends(arm, context, frame)
    return X_WB @ flange_pose(q) @ X_FT


def ik_solutions(
    arm: Arm, context: Context, frame: Frame, X_WT: RigidTransform, near: np.ndarray
) -> list[np.ndarray]:
    """Return the joint angles (6,) that put a tool frame T at X_WT, nearest to ``near`` first.

    Every joint is turned by full circles to be as close to ``near`` as its limits allow;
    solutions that cannot keep ``LIMIT_MARGIN`` from the limits are left out.

    Args:
        arm: The arm.
        context: Plant context; the joints of the tool itself count as they are in it.
        frame: Any frame fixed to the flange or to the tool.
        X_WT: Where the frame shall be.
        near: (6,) joint angles.
    """
    X_WB, X_FT = _ends(arm, context, frame)
    X_BF = X_WB.inverse() @ X_WT @ X_FT.inverse()
    turned = [_nearest_turn(arm, q, near) for q in inverse(X_BF, wrist_3=float(near[5]))]
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
    """Return the joint angles (6,) nearest to ``near`` that put the tool frame at X_WT.

    Args:
        arm: The arm.
        context: Plant context; the joints of the tool itself count as they are in it.
        frame: Any frame fixed to the flange or to the tool.
        X_WT: Where the frame shall be.
        near: (6,) joint angles.
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
    """Return lower and upper joint limits (6,) with ``LIMIT_MARGIN`` taken off."""
    lower = np.array([joint.position_lower_limits()[0] for joint in arm.joints])
    upper = np.array([joint.position_upper_limits()[0] for joint in arm.joints])
    return lower + LIMIT_MARGIN, upper - LIMIT_MARGIN


def _ends(arm: Arm, context: Context, frame: Frame) -> tuple[RigidTransform, RigidTransform]:
    """Return X_WB of the base and X_FT of the tool frame on the flange."""
    base = arm.plant.GetFrameByName("base_link", arm.instance)
    flange = arm.plant.GetFrameByName("flange", arm.instance)
    return base.CalcPoseInWorld(context), frame.CalcPose(context, flange)


def _nearest_turn(arm: Arm, q: np.ndarray, near: np.ndarray) -> np.ndarray | None:
    """Return q plus full turns: as near as the limits allow, or None where they do not."""
    lower, upper = joint_limits(arm)
    candidates = q + 2 * np.pi * np.array([-2, -1, 0, 1, 2])[:, None]
    allowed = (candidates >= lower) & (candidates <= upper)
    if not allowed.any(axis=0).all():
        return None
    distance = np.where(allowed, abs(candidates - near), np.inf)
    return candidates[distance.argmin(axis=0), np.arange(6)]


def _wrapped(q: Sequence[float]) -> np.ndarray:
    """Return the angles in (-pi, pi]."""
    return np.pi - np.mod(np.pi - np.asarray(q), 2 * np.pi)


def _link_transform(joint: int, angle: float) -> np.ndarray:
    """Return the 4x4 transform of one Denavit-Hartenberg row."""
    c, s = np.cos(angle), np.sin(angle)
    ca, sa = np.cos(DH_ALPHA[joint]), np.sin(DH_ALPHA[joint])
    a, d = DH_A[joint], DH_D[joint]
    return np.array(
        [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1.0]]
    )


def _chain(q: Sequence[float] | np.ndarray, start: int, end: int) -> np.ndarray:
    """Return the product of link transforms ``start`` .. ``end`` - 1."""
    T = np.eye(4)
    for joint, angle in zip(range(start, end), q, strict=True):
        T = T @ _link_transform(joint, angle)
    return T


def _arccos(value: float) -> float | None:
    """Return the arc cosine, or None where there is none."""
    if abs(value) > 1.0 + ROUNDING:
        return None
    return float(np.arccos(np.clip(value, -1.0, 1.0)))


def _pan_angles(T_BF: np.ndarray) -> tuple[float, ...]:
    """Shoulder pan: the wrist centre stands d4 beside the plane of the arm."""
    x, y = (T_BF[:3, 3] - DH_D[5] * T_BF[:3, 2])[:2]
    spread = _arccos(DH_D[3] / np.hypot(x, y)) if np.hypot(x, y) > 0 else None
    if spread is None:
        return ()
    middle = np.arctan2(y, x) + np.pi / 2
    return (middle + spread, middle - spread)


def _wrist_angles(
    T_BF: np.ndarray, pan: float, flip: float, wrist_3: float
) -> tuple[float, float] | None:
    """Wrist 2 and wrist 3: the flange's distance and direction beside the plane of the arm."""
    aside = np.array([np.sin(pan), -np.cos(pan), 0.0])
    tilt = _arccos((aside @ T_BF[:3, 3] - DH_D[3]) / DH_D[5])
    if tilt is None:
        return None
    wrist_2 = flip * tilt
    sine = np.sin(wrist_2)
    if abs(sine) < SINGULAR:
        return wrist_2, wrist_3
    return wrist_2, float(np.arctan2(-aside @ T_BF[:3, 1] / sine, aside @ T_BF[:3, 0] / sine))


def _elbow_solutions(
    T_BF: np.ndarray, pan: float, wrist_2: float, wrist_3: float
) -> list[tuple[float, ...]]:
    """Lift, elbow and wrist 1: a planar arm of two links with the elbow up or down."""
    T_14 = np.linalg.solve(_chain([pan], 0, 1), T_BF) @ np.linalg.inv(
        _chain([wrist_2, wrist_3], 4, 6)
    )
    p_13 = T_14[:3, 3] - DH_D[3] * T_14[:3, 1]
    reach = float(np.hypot(p_13[0], p_13[1]))
    a2, a3 = DH_A[1], DH_A[2]
    bend = _arccos((reach**2 - a2**2 - a3**2) / (2 * a2 * a3))
    if bend is None:
        return []
    solutions = []
    for elbow in (bend, -bend):
        lift = np.arctan2(-p_13[1], -p_13[0]) + np.arcsin(a3 * np.sin(elbow) / reach)
        T_34 = np.linalg.solve(_chain([lift, elbow], 1, 3), T_14)
        wrist_1 = np.arctan2(T_34[1, 0], T_34[0, 0])
        solutions.append((pan, lift, elbow, wrist_1, wrist_2, wrist_3))
    return solutions
