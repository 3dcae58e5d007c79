"""Where on the jig a part goes: upright as planned, over the jig's centre, turned to suit the arms.

The posture leaves the yaw about the vertical free. It is chosen so that the left arm can place the
part and, later, bring and hold every part that the plan mates with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from planning.motion.kinematics import Unreachable, ik_solutions
from planning.motion.paths import NoPath, plan_line
from planning.operations.grasping import Reach, backed_off
from planning.operations.station import Station

YAWS = np.deg2rad(np.arange(0.0, 360.0, 15.0))
RETREAT = 0.08  # The hand backs off this far when it has let go [m] [A].
HOVER = 0.008  # The part waits this far above the bag before it is pressed in [m] [A].
# Depth at which later grasps are checked; 20 N press the motor in by 5 to 10 mm [M].
LIKELY_DEPTH = 0.007


@dataclass(frozen=True)
class Placement:
    """A pose for the fixed part that suits all arms.

    Attributes:
        yaw: About the vertical [rad].
        X_WP: Pose of the part while it hovers over the bag.
        q: Joint angles (6,) of the left arm there.
    """

    yaw: float
    X_WP: RigidTransform
    q: np.ndarray


Suits = Callable[[RigidTransform], bool]


def anywhere(X_WP: RigidTransform) -> bool:
    """Suit every pose of the part on the jig."""
    return True


def upright(up: str, yaw: float) -> RotationMatrix:
    """Return R_WA that turns the product's ``up`` axis ("+z" ...) to +z of W, then by ``yaw``."""
    axis = np.zeros(3)
    axis["xyz".index(up[1])] = 1.0 if up[0] == "+" else -1.0
    turn = RotationMatrix.MakeZRotation(yaw)
    if np.allclose(axis, [0, 0, -1]):
        return turn @ RotationMatrix.MakeXRotation(np.pi)
    side = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.5 else np.array([0.0, 1.0, 0.0])
    other = np.cross(axis, side)
    # Rows are the axes of W seen from A.
    return turn @ RotationMatrix(np.array([side, other, axis]))


def pose_on_jig(station: Station, part: str, up: str, yaw: float, height: float) -> RigidTransform:
    """Return X_WP with the part's centre of mass over the jig and its lowest point at a height.

    Args:
        station: The planner's view of the cell.
        part: Name of the part.
        up: Axis of the product frame that points up.
        yaw: About the vertical [rad].
        height: Of the lowest point above the jig frame J [m].
    """
    description = station.part(part)
    R_WP = upright(up, yaw) @ description.X_AP.rotation()
    points = description.mesh.vertices @ R_WP.matrix().T
    centre = R_WP @ description.mesh.center_mass
    offset = np.array([-centre[0], -centre[1], height - points[:, 2].min()])
    return RigidTransform(R_WP, station.cell.X_WJ.translation() + offset)


def choose_placement(
    station: Station,
    part: str,
    up: str,
    reach: Reach,
    later: tuple[str, ...],
    suits: Suits = anywhere,
) -> Placement:
    """Return the first yaw at which the part can be placed and every later part mated.

    Args:
        station: The planner's view of the cell.
        part: Name of the part in the hand (or about to be).
        up: Axis of the product frame that points up.
        reach: The grasp it is held with.
        later: Names of the parts that will be brought to it.
        suits: Whether the pose X_WP of the seated part suits whatever else comes later.
    """
    apex = station.config.jig.bag.cap_height
    for yaw, X_WP, q in _placeable(station, part, up, reach, apex + HOVER):
        seated = pose_on_jig(station, part, up, yaw, apex - LIKELY_DEPTH)
        X_WA = seated @ station.part(part).X_AP.inverse()
        leaves = _leaves(station, reach, seated @ reach.grasp.X_PJaw, q)
        mates = all(_mates(station, name, X_WA) for name in later)
        if leaves and mates and suits(seated):
            return Placement(yaw, X_WP, q)
    goal = pose_on_jig(station, part, up, 0.0, apex + HOVER)
    raise Unreachable("left", reach.grasp.jaw, goal @ reach.grasp.X_PJaw, f"no yaw suits '{part}'")


def _placeable(
    station: Station, part: str, up: str, reach: Reach, height: float
) -> Iterator[tuple[float, RigidTransform, np.ndarray]]:
    frame = station.arm("left").frame(reach.grasp.jaw)
    may_touch = [("held", "*"), ("left_tool", "held"), ("left_tool", part)]
    found = []
    for yaw in YAWS:
        X_WP = pose_on_jig(station, part, up, yaw, height)
        X_WJaw = X_WP @ reach.grasp.X_PJaw
        for q in station.configurations("left", frame, X_WJaw, reach.q_before, may_touch)[:1]:
            found.append((float(np.max(np.abs(q - reach.q_before))), yaw, X_WP, q))
    for _, yaw, X_WP, q in sorted(found, key=lambda item: item[0]):
        yield yaw, X_WP, q


def _leaves(station: Station, reach: Reach, X_WJaw: RigidTransform, q: np.ndarray) -> bool:
    """Return whether the hand can back off straight from a jaw pose, with joints near ``q``."""
    arm, context = station.arm("left"), station.context
    frame = arm.frame(reach.grasp.jaw)
    try:
        for q_at in ik_solutions(arm, context, frame, X_WJaw, q)[:1]:
            plan_line(arm, context, frame, q_at, backed_off(X_WJaw, RETREAT))
            return True
    except (Unreachable, NoPath):
        pass
    return False


def _mates(station: Station, part: str, X_WA: RigidTransform) -> bool:
    """Return whether every grasp of a part that is meant for it is reachable where it ends up."""
    description = station.part(part)
    X_WP = X_WA @ description.X_AP
    arm = station.arm("left")
    reachable = {grasp.name: False for grasp in description.grasps}
    for grasp in description.grasps:
        if not reachable[grasp.name]:
            X_WJaw = X_WP @ grasp.X_PJaw
            frame, near = arm.frame(grasp.jaw), arm.home
            free = station.configurations("left", frame, X_WJaw, near, [("left_tool", part)])
            reachable[grasp.name] = bool(free)
    # Grasps that differ only by a turn share the first part of their name.
    families: dict[str, bool] = {}
    for name, ok in reachable.items():
        family = name.rsplit("_", 1)[0] if name.rsplit("_", 1)[-1].isdigit() else name
        families[family] = families.get(family, False) or ok
    return all(families.values())
