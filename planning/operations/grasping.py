"""Grasping with the left hand: where the jaw goes, and the phases that take and let go."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from cell.machines.tools import JAW_SETBACK
from cell.products.product import Grasp
from cell.simulation.phase import Jaw, Outcome, Phase, Sensed, after, motion_finished
from planning.motion.kinematics import Unreachable
from planning.operations.station import Station

APPROACH = 0.05  # The jaw comes the last stretch straight along its own z [m] [A].
CLEARANCE = 0.004  # The jaws open this much wider than the part [m] [A].
WIDEST = 0.050  # Stroke of the gripper [m] [R].
HAND_SPEED = 0.08  # Of the hand on straight stretches [m/s] [A].
RELEASE_TIME = 0.15  # Opening by twice the clearance takes half of it at 0.15 m/s [D].
CLEAR = 0.012  # The jaws have left the part when they are this far back [m] [A].
GRIP_TIME = 0.25  # Closing and building up the force [s] [A].
# A jaw that closes this much further than when it gripped holds nothing any more [m].
LOST = 0.0015


@dataclass(frozen=True)
class Reach:
    """A grasp that the arm can carry out.

    Attributes:
        grasp: Which one.
        q_before: Joint angles (6,) with the jaw `APPROACH` away.
        q_at: Joint angles (6,) at the grasp.
        X_WJaw: Pose of the jaw at the grasp.
    """

    grasp: Grasp
    q_before: np.ndarray
    q_at: np.ndarray
    X_WJaw: RigidTransform


def backed_off(X_WJaw: RigidTransform, distance: float) -> RigidTransform:
    """Return the jaw pose moved back along its approach direction."""
    return X_WJaw @ RigidTransform([0.0, 0.0, -distance])


def tip_opening(grasp: Grasp) -> float:
    """Return the opening of the tip pads at which the grasp's jaws touch the part [m]."""
    return grasp.width - JAW_SETBACK[grasp.jaw]


def opened(grasp: Grasp) -> Jaw:
    """Return the command that opens the jaws around the part."""
    return Jaw(min(tip_opening(grasp) + CLEARANCE, WIDEST))


def reachable_grasps(
    station: Station, part: str, X_WP: RigidTransform, grasps: Sequence[Grasp]
) -> Iterator[Reach]:
    """Yield the grasps of a part at a pose that the left arm reaches without collision.

    The hand may come close to the part itself; everything else is kept clear of.
    """
    arm = station.arm("left")
    near = arm.positions(station.context)
    may_touch = [("left_tool", part), ("left_tool", "held")]
    for grasp in grasps:
        X_WJaw = X_WP @ grasp.X_PJaw
        frame = arm.frame(grasp.jaw)
        before = station.configurations(
            "left", frame, backed_off(X_WJaw, APPROACH), near, may_touch
        )
        for q_before in before:
            at = station.configurations("left", frame, X_WJaw, q_before, [("left_tool", "*")])
            if at and np.max(np.abs(at[0] - q_before)) < 1.0:
                yield Reach(grasp, q_before, at[0], X_WJaw)


def lost_grasp(held_opening: float) -> Callable[[Sensed], str | None]:
    """Return a guard: the jaws have closed further than when they gripped."""

    def guard(sensed: Sensed) -> str | None:
        if sensed.jaw_opening < held_opening - LOST:
            return f"lost grasp: jaws at {1e3 * sensed.jaw_opening:.2f} mm"
        return None

    return guard


def gripped(sensed: Sensed) -> bool:
    """End condition: the jaws have come to rest."""
    return sensed.time >= GRIP_TIME and abs(sensed.jaw_rate) < 1e-3


def take(
    station: Station, part: str, reach: Reach, height: float, riders: tuple[str, ...] = ()
) -> Iterator[Phase]:
    """Yield the phases that fetch a part: approach, descend, grip, lift.

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
    frame = station.arm("left").frame(reach.grasp.jaw)
    yield Phase(
        f"{part}: approach",
        motion_finished,
        timeout=20.0,
        left=station.move("left", reach.q_before, [("left_tool", part)]),
        jaw=opened(reach.grasp),
    )
    yield Phase(
        f"{part}: descend",
        motion_finished,
        timeout=10.0,
        left=station.line("left", frame, reach.X_WJaw, speed=HAND_SPEED),
    )
    yield from grip(station, part, reach.grasp)
    station.held, station.riders = part, riders


def lift(station: Station, part: str, reach: Reach, height: float) -> Iterator[Phase]:
    """Yield the phase that takes the part in the hand straight up by a height [m]."""
    X_WJaw, frame = (
        station.pose("left", reach.grasp.jaw),
        station.arm("left").frame(reach.grasp.jaw),
    )
    up = RigidTransform(X_WJaw.rotation(), X_WJaw.translation() + [0.0, 0.0, height])
    yield Phase(
        f"{part}: lift",
        motion_finished,
        timeout=10.0,
        left=station.line("left", frame, up, speed=HAND_SPEED),
        guard=lost_grasp(station.held_opening),
        awake=frozenset([part, *station.riders]),
    )


def grip(
    station: Station, part: str, grasp: Grasp, awake: frozenset[str] = frozenset()
) -> Generator[Phase, Outcome, None]:
    """Yield the phase that closes the jaws; fails if they find nothing in between."""
    outcome: Outcome = yield Phase(
        f"{part}: grip",
        gripped,
        timeout=2.0,
        jaw=Jaw(tip_opening(grasp), grasp.force),
        guard=lost_grasp(tip_opening(grasp)),
        awake=awake | {part},
    )
    station.held_opening = outcome.sensed.jaw_opening


def let_go(
    station: Station, part: str, grasp: Grasp, retreat: float, awake: frozenset[str]
) -> Iterator[Phase]:
    """Yield the phases that open the jaws and back the hand off straight.

    The part stays awake until the jaws are clear of it.
    """
    yield Phase(
        f"{part}: release", after(RELEASE_TIME), timeout=1.0, jaw=opened(grasp), awake=awake
    )
    station.held, station.riders = None, ()
    X_WJaw, frame = station.pose("left", grasp.jaw), station.arm("left").frame(grasp.jaw)
    for name, distance, stay in (("clear", CLEAR, awake), ("retreat", retreat, frozenset())):
        goal = backed_off(X_WJaw, distance)
        yield Phase(
            f"{part}: {name}",
            motion_finished,
            timeout=10.0,
            left=station.line("left", frame, goal, speed=HAND_SPEED),
            awake=stay,
        )


def first(reaches: Iterator[Reach], part: str, station: Station) -> Reach:
    """Return the first reachable grasp."""
    for reach in reaches:
        return reach
    raise no_grasp(station, part)


def no_grasp(station: Station, part: str) -> Unreachable:
    """Return the error that says that the left hand cannot take a part where it is."""
    reason = f"no grasp of part '{part}' is reachable there"
    return Unreachable("left", "jaw", station.sense(part), reason)
