"""The gripper beside a tightening: it holds the clamped part, or keeps out of the way."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from enum import Enum

from cell.products.product import Grasp
from cell.simulation.phase import Outcome, Phase, motion_finished
from planning.operations.grasping import (
    HAND_SPEED,
    Reach,
    first,
    grip,
    opened,
    reachable_grasps,
)
from planning.operations.station import Station


class HoldPhase(Enum):
    """Coming to an assembled part to hold it, or getting out of the way."""

    APPROACH = "approach to hold"
    REACH = "reach to hold"
    PARK = "park"


def hold(station: Station, part: str) -> Generator[Phase, Outcome, Grasp]:
    """Yield the phases with which the hand grips an assembled part; return the grasp.

    Its belief is fresh. `planning.operations.grasping.let_go` lets go of it.
    """
    arm, gripper = station.holder, station.cell.gripper
    reach = first(_from_the_side(station, part), part, station)
    yield Phase(
        HoldPhase.APPROACH,
        motion_finished,
        timeout=20.0,
        subject=part,
        commands={
            arm.name: station.move(arm, reach.q_before, [(station.hand, part)]),
            gripper.name: opened(gripper.model, reach.grasp),
        },
    )
    line = station.line(arm, arm.frame(reach.grasp.jaw), reach.X_WJaw, speed=HAND_SPEED)
    yield Phase(
        HoldPhase.REACH, motion_finished, timeout=10.0, subject=part, commands={arm.name: line}
    )
    yield from grip(station, part, reach.grasp, awake=frozenset(station.fixed))
    return reach.grasp


def _from_the_side(station: Station, part: str) -> Iterator[Reach]:
    """Yield grasps that leave the space above the part to the driver."""
    X_WP = station.pose_of(part)
    grasps = [
        grasp
        for grasp in station.part(part).grasps
        if abs((X_WP @ grasp.X_PJaw).rotation().matrix()[2, 2]) < 0.5
    ]
    return reachable_grasps(station, part, X_WP, grasps)


def park(station: Station) -> Iterator[Phase]:
    """Yield the phase that takes the holder home, out of the driver's way."""
    arm = station.holder
    yield Phase(
        HoldPhase.PARK,
        motion_finished,
        20.0,
        subject=f"{arm.name} arm",
        commands={arm.name: station.move(arm, arm.home)},
    )
