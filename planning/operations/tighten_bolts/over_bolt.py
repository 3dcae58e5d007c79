"""Where the driver stands over a bolt, turned any way about its axis, and how it comes there.

It shares the place with the hand that holds against it, which may come close to the assembly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cell.machines.arm import Unreachable
from cell.simulation.phase import Command
from planning.motion.paths import NoPath
from planning.operations.counter_hold import Coming
from planning.operations.grasping import backed_off
from planning.operations.station import FINE_CLEARANCE, Station

BIT_HOVER = 0.012  # The bit waits this far above the socket [m] [A].
MOST_MET = 2  # [A] Collisions that are told of.


def socket_pose(station: Station, bolt: str) -> RigidTransform:
    """Return the pose of the bit's end when it sits in the drive of a bolt, pointing down."""
    seat = station.cell.product.screws[bolt].bit_seat
    p_WE = station.pose_of(bolt) @ np.array([0.0, 0.0, seat])
    return RigidTransform(RotationMatrix.MakeXRotation(np.pi), p_WE)


def may_come_near(station: Station) -> list[tuple[str, str]]:
    """Return the pairs that may come close while the hand holds the assembly."""
    return [(station.hand, part) for part in station.fixed]


def above(
    station: Station, bolt: str, elsewhere: Mapping[str, np.ndarray] | None = None
) -> np.ndarray:
    """Return the nearest configuration (n,) over a bolt's head; the arguments: `ways_above`.

    Raises:
        Unreachable: There is none.
    """
    driver = station.driver
    near = driver.positions(station.context)
    found = list(ways_above(station, bolt, elsewhere))
    if not found:
        X_WE = backed_off(socket_pose(station, bolt), BIT_HOVER)
        reason = "out of reach, however the driver is turned"
        solutions = driver.configurations(station.context, driver.frame("tool_tip"), X_WE, near)
        if solutions:
            met = station.model.collisions(driver.name, solutions[0])
            reason = f"no turn of the driver keeps clear: {'; '.join(met[:MOST_MET])}"
        raise Unreachable(driver.name, "tool_tip", X_WE, reason)
    return min(found, key=lambda q: float(np.max(np.abs(q - near))))


def is_reached(
    station: Station, bolt: str, elsewhere: Mapping[str, np.ndarray] | None = None
) -> bool:
    """Return whether there is a way over a bolt's head; the arguments: `ways_above`."""
    return any(True for _ in ways_above(station, bolt, elsewhere))


def ways_above(
    station: Station, bolt: str, elsewhere: Mapping[str, np.ndarray] | None = None
) -> Iterator[np.ndarray]:
    """Yield configurations (n,) over a bolt's head, turned any way about its axis.

    Args:
        station: The planner's view of the cell.
        bolt: Name of the bolt.
        elsewhere: See `Station.surroundings`.
    """
    driver, holding = station.driver, may_come_near(station)
    tip, near = driver.frame("tool_tip"), driver.positions(station.context)
    X_WE = backed_off(socket_pose(station, bolt), BIT_HOVER)
    for turn in np.deg2rad(np.arange(0.0, 360.0, 30.0)):
        X = X_WE @ RigidTransform(RotationMatrix.MakeZRotation(turn), np.zeros(3))
        yield from station.configurations(driver, tip, X, near, holding, FINE_CLEARANCE, elsewhere)


def come_beside(station: Station, bolt: str, coming: Coming) -> dict[str, Command]:
    """Return the command that brings the driver over a bolt while the hand comes, too.

    Where they would be in each other's way, there is none: the driver comes when the hand is there.

    Args:
        station: The planner's view of the cell.
        bolt: Name of the bolt.
        coming: What the hand is about to do.
    """
    driver, hand, jaws = station.driver, station.holder.name, {station.hand: coming.jaws}
    try:
        q_above = above(station, bolt, {hand: coming.q_then, **jaws})
        motion = station.move(
            driver,
            q_above,
            may_come_near(station),
            FINE_CLEARANCE,
            elsewhere=jaws,
            beside={hand: coming.motion},
        )
    except (Unreachable, NoPath):
        return {}
    # The last stretch of the hand, with the driver over the bolt; it is as straight as this.
    stretch = np.linspace(coming.motion.q[-1], coming.q_then, 20)
    clear = all(station.model.are_free({driver.name: q_above, hand: q}) for q in stretch)
    return {driver.name: motion} if clear else {}
