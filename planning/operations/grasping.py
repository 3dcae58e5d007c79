"""Grasping with the gripper: where the jaw goes, and the phases that take and let go."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform

from cell.machines.arm import Unreachable
from cell.machines.grippers import GripperModel
from cell.products.product import Grasp
from cell.simulation.conditions import LostGrasp
from cell.simulation.phase import Guard, Jaw, Outcome, Phase, PhaseFailed, motion_finished
from cell.simulation.vocabulary import in_programs
from planning.motion.timing import JointMotion
from planning.operations.look import look
from planning.operations.station import Station
from planning.operations.waiting import at_rest, steady_jaws

APPROACH = 0.05  # The jaw comes the last stretch straight along its own z [m] [A].
CLEARANCE = 0.004  # The jaws open this much wider than the part [m] [A].
CLEAR = 0.012  # The jaws have left the part when they are this far back [m] [A].
SHARES = (1.0, 0.75, 0.5)  # Of the way back, tried in this order [A].
# A jaw that closes this much further than when it gripped holds nothing any more [m].
LOST = 0.0015
# A part that is seen this far from where the hand would have it did not come along [m] [A]: more
# than it can slip between the pads, less than any lift.
LEFT_BEHIND = 0.03


@in_programs
class HandPhase(Enum):
    """Taking a part and letting it go, in any operation."""

    APPROACH = "approach"
    DESCEND = "descend"
    GRIP = "grip"
    LIFT = "lift"
    LOOK_IN_HAND = "look in hand"
    RELEASE = "release"
    CLEAR = "clear"
    RETREAT = "retreat"


@dataclass(frozen=True)
class Reach:
    """A grasp that the arm can carry out.

    Attributes:
        grasp: Which one.
        q_before: Joint angles (n,) with the jaw `APPROACH` away [rad].
        q_at: Joint angles (n,) at the grasp [rad].
        X_WJaw: Pose of the jaw at the grasp.
    """

    grasp: Grasp
    q_before: np.ndarray
    q_at: np.ndarray
    X_WJaw: RigidTransform


def backed_off(X_WJaw: RigidTransform, distance: float) -> RigidTransform:
    """Return the jaw pose moved back along its approach direction."""
    return X_WJaw @ RigidTransform([0.0, 0.0, -distance])


def raised(X_WP: RigidTransform, height: float) -> RigidTransform:
    """Return the pose moved up along +z of W."""
    return RigidTransform(X_WP.rotation(), X_WP.translation() + [0.0, 0.0, height])


def comes_from_above(X_WP: RigidTransform, X_PJaw: RigidTransform) -> bool:
    """Return whether the hand points down at the part: it must not meet what the part comes to."""
    return bool((X_WP @ X_PJaw).rotation().matrix()[2, 2] < -0.9)


def tip_opening(gripper: GripperModel, grasp: Grasp) -> float:
    """Return the opening of the tip pads at which the grasp's jaws touch the part [m]."""
    return grasp.width - gripper.setback[grasp.jaw]


def opened(gripper: GripperModel, grasp: Grasp) -> Jaw:
    """Return the command that opens the jaws around the part."""
    return Jaw(min(tip_opening(gripper, grasp) + CLEARANCE, gripper.stroke))


def reachable_grasps(
    station: Station, part: str, X_WP: RigidTransform, grasps: Sequence[Grasp]
) -> Iterator[Reach]:
    """Yield the grasps of a part at a pose that the holder reaches without collision.

    The hand may come close to the part itself; everything else is kept clear of.
    """
    arm, hand = station.holder, station.hand
    near = arm.positions(station.context)
    may_touch = [(hand, part), (hand, "held")]
    for grasp in grasps:
        X_WJaw = X_WP @ grasp.X_PJaw
        frame = arm.frame(grasp.jaw)
        before = station.configurations(arm, frame, backed_off(X_WJaw, APPROACH), near, may_touch)
        for q_before in before:
            at = station.configurations(arm, frame, X_WJaw, q_before, [(hand, "*")])
            if at and np.max(np.abs(at[0] - q_before)) < 1.0:
                yield Reach(grasp, q_before, at[0], X_WJaw)


def first(reaches: Iterator[Reach], part: str, station: Station) -> Reach:
    """Return the first reachable grasp.

    Raises:
        Unreachable: There is none.
    """
    for reach in reaches:
        return reach
    raise no_grasp(station, part)


def no_grasp(station: Station, part: str, reason: str | None = None) -> Unreachable:
    """Return the error that says that the gripper cannot take a part where it is, and why."""
    reason = reason or f"no grasp of part '{part}' is reachable there"
    return Unreachable(station.holder.name, "jaw", station.pose_of(part), reason)


def lost_grasp(station: Station, held_opening: float | None = None) -> Guard:
    """Return a guard: the jaws have closed further than when they gripped.

    Args:
        station: The planner's view of the cell.
        held_opening: Opening of the tip pads when they gripped [m]; None: as it is remembered now.
    """
    held = station.held_opening if held_opening is None else held_opening
    return LostGrasp(station.holder.tool.name, held - LOST)


def take(
    station: Station, part: str, reach: Reach, height: float, riders: tuple[str, ...] = ()
) -> Iterator[Phase]:
    """Yield the phases that fetch a part and look at it in the hand.

    Args:
        station: The planner's view of the cell.
        part: Name of the part.
        reach: How to grasp it.
        height: How far straight up [m].
        riders: Names of the parts that lie loose on it and come along.
    """
    yield from seize(station, part, reach, riders)
    yield from lift(station, part, reach, height)


def seize(
    station: Station, part: str, reach: Reach, riders: tuple[str, ...] = ()
) -> Iterator[Phase]:
    """Yield the phases after which a part is in the hand, where it stands."""
    arm, gripper = station.holder, station.cell.gripper
    yield Phase(
        HandPhase.APPROACH,
        motion_finished,
        timeout=20.0,
        subject=part,
        commands={
            arm.name: station.move(arm, reach.q_before, [(station.hand, part)]),
            gripper.name: opened(gripper.model, reach.grasp),
        },
    )
    line = station.line(arm, arm.frame(reach.grasp.jaw), reach.X_WJaw)
    yield Phase(
        HandPhase.DESCEND,
        at_rest(arm.name),
        timeout=10.0,
        subject=part,
        commands={arm.name: line},
    )
    yield from grip(station, part, reach.grasp)
    station.carry(part, riders)


def grip(
    station: Station, part: str, grasp: Grasp, awake: frozenset[str] = frozenset()
) -> Generator[Phase, Outcome, None]:
    """Yield the phase that closes the jaws; fails if they find nothing in between."""
    gripper = station.cell.gripper
    opening = tip_opening(gripper.model, grasp)

    outcome: Outcome = yield Phase(
        HandPhase.GRIP,
        steady_jaws(gripper.name),
        timeout=2.0,
        subject=part,
        commands={gripper.name: Jaw(opening, grasp.force)},
        guard=lost_grasp(station, opening),
        awake=awake | {part},
    )
    station.held_opening = outcome.sensed.grippers[gripper.name].opening


def lift(station: Station, part: str, reach: Reach, height: float) -> Iterator[Phase]:
    """Yield the phases that take the part in the hand straight up by a height [m].

    The pose in the hand is looked at, not assumed: the part may have slipped in the grip.
    """
    arm, awake, riding = station.holder, frozenset(station.in_hand), frozenset(station.riders)
    up = raised(station.tool_pose(arm, reach.grasp.jaw), height)
    guard = lost_grasp(station)
    yield Phase(
        HandPhase.LIFT,
        motion_finished,
        timeout=10.0,
        subject=part,
        commands={
            arm.name: station.line(arm, arm.frame(reach.grasp.jaw), up),
        },
        guard=guard,
        awake=awake,
        riding=riding,
    )
    in_hand = station.pose_of(part)
    yield from look(
        station,
        HandPhase.LOOK_IN_HAND,
        part,
        station.in_hand,
        awake=awake,
        guard=guard,
        riding=riding,
    )
    check_lifted(part, in_hand, station.pose_of(part))


def check_lifted(part: str, in_hand: RigidTransform, seen: RigidTransform) -> None:
    """Fail the lift of a part that did not come along.

    Jaws that slid off it are as far apart as before: nothing but a look tells.

    Args:
        part: Name of the part.
        in_hand: X_WP where the hand would have it.
        seen: X_WP where it is seen.

    Raises:
        PhaseFailed: It is not in the hand.
    """
    away = float(np.linalg.norm(seen.translation() - in_hand.translation()))
    if away > LEFT_BEHIND:
        evidence = f"lost grasp: the part is {1e3 * away:.0f} mm from where the hand would have it"
        raise PhaseFailed(f"{part}: {HandPhase.LIFT.value}", evidence)


def let_go(
    station: Station,
    part: str,
    grasp: Grasp,
    retreat: float,
    awake: frozenset[str],
    riding: frozenset[str] = frozenset(),
) -> Iterator[Phase]:
    """Yield the phases that open the jaws and back the hand off straight.

    Args:
        station: The planner's view of the cell.
        part: Name of the part in the hand, or in its grip.
        grasp: How it is held.
        retreat: How far the hand backs off [m].
        awake: Names of the parts that are awake until the jaws are clear.
        riding: As of a phase.
    """
    arm, gripper = station.holder, station.cell.gripper
    yield Phase(
        HandPhase.RELEASE,
        steady_jaws(gripper.name),
        timeout=1.0,
        subject=part,
        commands={gripper.name: opened(gripper.model, grasp)},
        awake=awake,
        riding=riding,
        fine_log=True,  # What springs back does so within milliseconds.
    )
    station.put_down()
    X_WJaw = station.tool_pose(arm, grasp.jaw)
    for kind, distance, stay in (
        (HandPhase.CLEAR, CLEAR, awake),
        (HandPhase.RETREAT, retreat, frozenset[str]()),
    ):
        line = _back(station, grasp.jaw, X_WJaw, distance)
        yield Phase(
            kind,
            motion_finished,
            timeout=10.0,
            subject=part,
            commands={arm.name: line},
            awake=stay,
            riding=riding & stay,
        )


def _back(station: Station, jaw: str, X_WJaw: RigidTransform, distance: float) -> JointMotion:
    """Return the motion straight back to a distance from a jaw pose [m].

    Where the other arm is in the way, the hand stops before; it gets clear of the part in any case.
    """
    arm = station.holder
    shorter = [share * distance for share in SHARES if share * distance > CLEAR]
    for end in (*shorter, CLEAR):
        line = station.line(arm, arm.frame(jaw), backed_off(X_WJaw, end))
        if station.clear_of_arms(arm, line):
            break
    return line


def jaw_to_part(station: Station, part: str, grasp: Grasp) -> RigidTransform:
    """Return X_JawP, how a part is believed to lie in the jaw."""
    return station.tool_pose(station.holder, grasp.jaw).inverse() @ station.pose_of(part)
