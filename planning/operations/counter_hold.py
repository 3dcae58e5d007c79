"""The gripper beside a tightening: it holds against the driver, or keeps out of the way."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from cell.products.product import Grasp
from cell.simulation.phase import Command, Outcome, Phase, motion_finished
from cell.simulation.vocabulary import in_programs
from planning.motion.timing import JointMotion
from planning.operations.grasping import (
    Reach,
    grip,
    opened,
    reachable_grasps,
)
from planning.operations.station import Station
from planning.operations.waiting import at_rest


@dataclass(frozen=True)
class Coming:
    """What the holder is about to do, for whoever moves beside it.

    Attributes:
        motion: Its planned motion.
        q_then: Joint angles (n,) to which it goes on straight, if it does.
        jaws: Positions (2,) of the fingers from soon after the start [m].
    """

    motion: JointMotion
    q_then: np.ndarray
    jaws: np.ndarray


# [A] Of the holder's first joint from home, where it waits, tried in this order [rad].
PARK_TURNS = np.deg2rad([0.0, -30.0, 30.0, -60.0, 60.0])

# What another arm does while the holder moves.
Meanwhile = Callable[[Coming], Mapping[str, Command]]


@in_programs
class HoldPhase(Enum):
    """Coming to an assembled part to hold it, or getting out of the way."""

    APPROACH = "approach to hold"
    REACH = "reach to hold"
    PARK = "park"


def hold(
    station: Station,
    parts: Sequence[str],
    meanwhile: Meanwhile,
    suits: Callable[[Reach], bool],
    clear_at: Callable[[np.ndarray], bool],
) -> Generator[Phase, Outcome, tuple[str, Grasp] | None]:
    """Yield the phases with which the hand grips an assembled part; return which, and the grasp.

    Where no grasp from the side can be reached that suits the driver, the hand gets out of the way,
    and None is returned: the fixture alone bears the torque. The belief about everything is fresh.
    `planning.operations.grasping.let_go` lets go of the part.

    Args:
        station: The planner's view of the cell.
        parts: Names of those that may be held, best first.
        meanwhile: What the driver does beside it.
        suits: Whether the driver reaches the bolts beside the hand.
        clear_at: Whether the driver reaches them while the holder is at joint angles (n,) [rad].
    """
    arm, gripper = station.holder, station.cell.gripper
    found = (pair for pair in from_the_side(station, parts) if suits(pair[1]))
    part, reach = next(found, ("", None))
    if reach is None:
        yield from park(station, meanwhile, clear_at)
        return None
    motion = station.move(arm, reach.q_before, [(station.hand, part)])
    jaw = opened(gripper.model, reach.grasp)
    yield Phase(
        HoldPhase.APPROACH,
        motion_finished,
        timeout=20.0,
        subject=part,
        commands={
            arm.name: motion,
            gripper.name: jaw,
            **meanwhile(Coming(motion, reach.q_at, np.full(2, jaw.opening / 2))),
        },
    )
    line = station.line(arm, arm.frame(reach.grasp.jaw), reach.X_WJaw)
    yield Phase(
        HoldPhase.REACH,
        at_rest(arm.name),
        timeout=10.0,
        subject=part,
        commands={arm.name: line},
    )
    yield from grip(station, part, reach.grasp, awake=frozenset(station.fixed))
    return part, reach.grasp


def from_the_side(station: Station, parts: Sequence[str]) -> Iterator[tuple[str, Reach]]:
    """Yield grasps that leave the space above each part to the driver, with the part's name."""
    for part in parts:
        X_WP = station.pose_of(part)
        grasps = [
            grasp
            for grasp in station.part(part).grasps
            if abs((X_WP @ grasp.X_PJaw).rotation().matrix()[2, 2]) < 0.5
        ]
        for reach in reachable_grasps(station, part, X_WP, grasps):
            yield part, reach


def parking(station: Station, clear_at: Callable[[np.ndarray], bool]) -> np.ndarray:
    """Return joint angles (n,) of the holder that leave the driver room; home if none do [rad].

    It goes home, or turns further away about its base. Arguments as of `hold`.
    """
    arm = station.holder
    for turn in PARK_TURNS:
        q = arm.home.copy()
        q[0] += turn
        station.model.arrange(station.surroundings())
        if station.model.is_free(arm.name, q) and clear_at(q):
            return q
    return arm.home


def park(
    station: Station, meanwhile: Meanwhile, clear_at: Callable[[np.ndarray], bool]
) -> Iterator[Phase]:
    """Yield the phase that takes the holder out of the driver's way; arguments as of `hold`."""
    arm, q_park = station.holder, parking(station, clear_at)
    motion = station.move(arm, q_park)
    jaws = station.cell.plant.GetPositions(station.context, arm.tool_instance)
    yield Phase(
        HoldPhase.PARK,
        motion_finished,
        20.0,
        subject=f"{arm.name} arm",
        commands={arm.name: motion, **meanwhile(Coming(motion, q_park, jaws))},
    )
