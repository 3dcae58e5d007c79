"""The left hand beside a tightening: it holds the clamped part, or keeps out of the way."""

from __future__ import annotations

from collections.abc import Generator, Iterator

from cell.products.product import Grasp
from cell.simulation.phase import Outcome, Phase, motion_finished
from planning.operations.grasping import (
    HAND_SPEED,
    Reach,
    first,
    grip,
    let_go,
    opened,
    reachable_grasps,
)
from planning.operations.station import Station

RETREAT = 0.05


def hold(station: Station, part: str) -> Generator[Phase, Outcome, Grasp]:
    """Yield the phases with which the left hand grips an assembled part; return the grasp."""
    reach = first(_from_the_side(station, part), part, station)
    frame = station.arm("left").frame(reach.grasp.jaw)
    yield Phase(
        f"{part}: approach to hold",
        motion_finished,
        timeout=20.0,
        left=station.move("left", reach.q_before, [("left_tool", part)]),
        jaw=opened(reach.grasp),
    )
    yield Phase(
        f"{part}: reach to hold",
        motion_finished,
        timeout=10.0,
        left=station.line("left", frame, reach.X_WJaw, speed=HAND_SPEED),
    )
    yield from grip(station, part, reach.grasp, awake=frozenset(station.fixed))
    return reach.grasp


def _from_the_side(station: Station, part: str) -> Iterator[Reach]:
    """Yield grasps that leave the space above the part to the driver."""
    X_WP = station.sense(part)
    grasps = [
        grasp
        for grasp in station.part(part).grasps
        if abs((X_WP @ grasp.X_PJaw).rotation().matrix()[2, 2]) < 0.5
    ]
    return reachable_grasps(station, part, X_WP, grasps)


def release_hold(
    station: Station, part: str, grasp: Grasp, awake: frozenset[str]
) -> Iterator[Phase]:
    """Yield the phases that let go of a part held by `hold`."""
    yield from let_go(station, part, grasp, RETREAT, awake)


def park(station: Station) -> Iterator[Phase]:
    """Yield the phase that takes the left arm home, out of the driver's way."""
    home = station.arm("left").home
    yield Phase("left arm: park", motion_finished, 20.0, left=station.move("left", home))
