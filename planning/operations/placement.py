"""Where on the fixture a part goes: upright as planned, over its centre, turned to suit the arms.

The posture leaves the yaw about the vertical free. It is chosen so that the holder can place the
part and, later, bring and hold every part that the plan mates with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cell.builder import Cell
from cell.fixtures.base import FixtureError
from cell.machines.arm import Unreachable
from cell.products.joints import Fit, Press, Rest
from cell.products.product import Product
from cell.vectors import rotation_with_up
from planning.motion.paths import NoPath, plan_line
from planning.operations.grasping import Reach, backed_off, raised
from planning.operations.station import FIXTURE, Placement, Station

YAWS = np.deg2rad(np.arange(0.0, 360.0, 15.0))
RETREAT = 0.08  # The hand backs off this far when it has let go [m] [A].
HOVER = 0.008  # The part waits this far above the fixture before it is pressed in [m] [A].
# Depth at which later grasps are checked; 20 N press the motor in by 5 to 10 mm [M].
LIKELY_DEPTH = 0.007
SAME_POSTURE = 0.9999  # Cosine of 0.8 degrees.

Suits = Callable[[RigidTransform], bool]  # Of a pose X_WP on the fixture.


def anywhere(X_WP: RigidTransform) -> bool:
    """Suit every pose of the part on the fixture."""
    return True


def brought_to(product: Product, part: str) -> tuple[str, ...]:
    """Return the names of the parts that come to a part from above, but for bolts."""
    found = []
    for joint in product.joints:
        if isinstance(joint, Rest) and joint.on == part:
            found.append(joint.part)
        elif isinstance(joint, Fit | Press):
            if joint.shaft == part and not product.enters_from_above(joint):
                found.append(joint.hole)
            elif joint.hole == part and product.enters_from_above(joint):
                found.append(joint.shaft)
    return tuple(found)


def upright(up: str, yaw: float) -> RotationMatrix:
    """Return R_WA that turns the product's ``up`` axis ("+z" ...) to +z of W, then by ``yaw``."""
    return RotationMatrix.MakeZRotation(yaw) @ rotation_with_up(up)


def pose_on_jig(station: Station, part: str, up: str, yaw: float, height: float) -> RigidTransform:
    """Return X_WP with the part's centre of mass over the fixture, its lowest point at a height.

    Args:
        station: The planner's view of the cell.
        part: Name of the part.
        up: Axis of the product frame that points up.
        yaw: About the vertical [rad].
        height: Of the lowest point above the fixture's frame J [m].
    """
    description = station.part(part)
    R_WP = upright(up, yaw) @ description.X_AP.rotation()
    points = description.mesh.vertices @ R_WP.matrix().T
    centre = R_WP @ description.mesh.center_mass
    offset = np.array([-centre[0], -centre[1], height - points[:, 2].min()])
    return RigidTransform(R_WP, station.cell.X_WJ.translation() + offset)


def planned_pose(cell: Cell, part: str, placement: Placement) -> RigidTransform:
    """Return where a placement puts a part: its centre of mass below where it hovers, upright.

    The height is left to the pressing.
    """
    description = cell.product.parts[part]
    R_WP = upright(cell.product.up, placement.yaw) @ description.X_AP.rotation()
    x, y, _ = placement.X_WP.translation()
    return RigidTransform(R_WP, [x, y, cell.X_WJ.translation()[2]])


def placement_errors(planned: RigidTransform, placed: RigidTransform) -> dict[str, float]:
    """Return the horizontal distance [m], the angle and the tilt [rad] between plan and outcome."""
    X_PlanP = planned.InvertAndCompose(placed)
    offset = placed.translation() - planned.translation()
    # The vertical of W, seen from both: their angle is the tilt, whatever the yaw.
    tilt = (planned.rotation().inverse().matrix()[:, 2]) @ (placed.rotation().matrix().T[:, 2])
    return {
        "position_error_m": float(np.hypot(offset[0], offset[1])),
        "angle_error_rad": float(abs(X_PlanP.rotation().ToAngleAxis().angle())),
        "upright_tilt_rad": float(np.arccos(np.clip(tilt, -1.0, 1.0))),
    }


def moved_placement(station: Station, part: str, up: str, X_WP: RigidTransform) -> Placement:
    """Return the placement of a part that has come to lie at a pose: upright over that place."""
    description = station.part(part)
    R_turn = X_WP.rotation() @ description.X_AP.rotation().inverse() @ upright(up, 0.0).inverse()
    yaw = float(np.arctan2(R_turn.matrix()[1, 0], R_turn.matrix()[0, 0]))
    meant = station.placements[part]
    hover = pose_on_jig(station, part, up, yaw, station.cell.fixture.entry_height + HOVER)
    away = X_WP @ description.mesh.center_mass - hover @ description.mesh.center_mass
    shift = RigidTransform([away[0], away[1], 0.0])
    return Placement(yaw, shift @ hover, meant.q)


def can_bring(station: Station, part: str, later: Sequence[str], X_WP: RigidTransform) -> bool:
    """Return whether every later part can be brought to a part that lies at a pose."""
    X_WA = X_WP @ station.part(part).X_AP.inverse()
    return all(_mates(station, name, part, X_WA) for name in later)


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
    top = station.cell.fixture.entry_height
    yaws = _yaws(station, part, up)
    for yaw, X_WP, q in _placeable(station, part, up, reach, top + HOVER, yaws):
        X_WSeated = seated(station, part, X_WP)
        leaves = _leaves(station, part, reach, X_WSeated @ reach.grasp.X_PJaw, q)
        mates = can_bring(station, part, later, X_WSeated)
        if leaves and mates and suits(X_WSeated):
            return Placement(yaw, X_WP, q)
    X_WJaw = pose_on_jig(station, part, up, 0.0, top + HOVER) @ reach.grasp.X_PJaw
    raise Unreachable(station.holder.name, reach.grasp.jaw, X_WJaw, f"no yaw suits '{part}'")


def _yaws(station: Station, part: str, up: str) -> np.ndarray:
    """Return the yaws [rad] at which the fixture takes a part.

    Raises:
        FixtureError: It does not take the part, or not in this posture.
    """
    fixture = station.cell.fixture
    X_JP = fixture.seat(part)
    if X_JP is None:
        return YAWS
    R_JA = X_JP.rotation() @ station.part(part).X_AP.rotation().inverse()
    R_turn = (R_JA @ upright(up, 0.0).inverse()).matrix()
    if R_turn[2, 2] < SAME_POSTURE:
        raise FixtureError(f"The {fixture.name} does not hold '{part}' with {up} up.")
    return np.array([np.arctan2(R_turn[1, 0], R_turn[0, 0])])


def seated(station: Station, part: str, X_WP: RigidTransform) -> RigidTransform:
    """Return where a part that hovers at X_WP comes to lie."""
    X_JP = station.cell.fixture.seat(part)
    if X_JP is None:
        return raised(X_WP, -(HOVER + LIKELY_DEPTH))
    return station.cell.X_WJ @ X_JP


def reachable_yaws(station: Station, part: str, up: str, reach: Reach) -> list[float]:
    """Return the yaws of a part over the fixture that the hand reaches, least turned first.

    They are those at which a fixture that is made for the part may be set up.
    """
    height = station.cell.fixture.entry_height + HOVER
    return [yaw for yaw, _, _ in _placeable(station, part, up, reach, height, YAWS)]


def _placeable(
    station: Station, part: str, up: str, reach: Reach, height: float, yaws: np.ndarray
) -> Iterator[tuple[float, RigidTransform, np.ndarray]]:
    """Yield yaw, X_WP and joint angles (n,) with the part over the fixture, least turned first."""
    arm, hand = station.holder, station.hand
    frame, near = arm.frame(reach.grasp.jaw), reach.q_before
    may_touch = [("held", "*"), (hand, "held"), (hand, part)]
    found = []
    for yaw in yaws:
        X_WP = pose_on_jig(station, part, up, yaw, height)
        X_WJaw = X_WP @ reach.grasp.X_PJaw
        for q in station.configurations(arm, frame, X_WJaw, near, may_touch)[:1]:
            found.append((float(np.max(np.abs(q - near))), yaw, X_WP, q))
    for _, yaw, X_WP, q in sorted(found, key=lambda item: item[0]):
        yield yaw, X_WP, q


def _leaves(
    station: Station, part: str, reach: Reach, X_WJaw: RigidTransform, q: np.ndarray
) -> bool:
    """Return whether the hand can press at a jaw pose and back off, with joints near ``q``.

    Beside the fixture, which gives way, it keeps clear of everything down there.
    """
    arm, context = station.holder, station.context
    frame = arm.frame(reach.grasp.jaw)
    may_touch = [(station.hand, FIXTURE), (station.hand, "held"), ("held", "*")]
    may_touch.append((station.hand, part))
    try:
        for q_at in station.configurations(arm, frame, X_WJaw, q, may_touch)[:1]:
            plan_line(arm, context, frame, q_at, backed_off(X_WJaw, RETREAT))
            return True
    except (Unreachable, NoPath):
        pass
    return False


def _mates(station: Station, part: str, onto: str, X_WA: RigidTransform) -> bool:
    """Return whether every grasp of a part that is meant for it is reachable where it ends up.

    What it is to come onto may be there already: how close the hand comes to it is seen when
    the part is brought.
    """
    description, arm = station.part(part), station.holder
    X_WP = X_WA @ description.X_AP
    # Grasps that differ only by a turn share the first part of their name.
    families: dict[str, bool] = {}
    for grasp in description.grasps:
        base, _, turn = grasp.name.rpartition("_")
        family = base if turn.isdigit() else grasp.name
        if not families.get(family):
            X_WJaw, frame = X_WP @ grasp.X_PJaw, arm.frame(grasp.jaw)
            touch = [(station.hand, part), (station.hand, onto)]
            families[family] = bool(station.configurations(arm, frame, X_WJaw, arm.home, touch))
    return all(families.values())
