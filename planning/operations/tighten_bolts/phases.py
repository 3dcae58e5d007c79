"""The phases that drive standing bolts home in star order.

The driver comes down on one head after another: bit into socket, thread caught, run down, seated,
tightened until the clutch trips. The gripper holds the clamped part meanwhile, or is out of the
way.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cell.machines.arm import Unreachable
from cell.simulation.conditions import All, Below, Height, Signal
from cell.simulation.phase import (
    Command,
    Follow,
    Outcome,
    Phase,
    Sensed,
    Spin,
    after,
    motion_finished,
)
from cell.simulation.vocabulary import in_programs
from planning.motion.paths import NoPath
from planning.motion.timing import JointMotion
from planning.operations.counter_hold import Coming, from_the_side, hold, park
from planning.operations.grasping import Reach, backed_off, let_go, opened, raised
from planning.operations.look import look
from planning.operations.operation import Step
from planning.operations.station import FINE_CLEARANCE, Station

BIT_HOVER = 0.012  # The bit waits this far above the socket [m] [A].
PLUNGE_SPEED = 0.08  # Of the bit down to the socket [m/s] [A].
FIND_SPEED = 3.0  # The bit turns this slowly until its hex drops into the socket [rad/s] [A].
SLOW_BELOW = 2.5e-4  # The spindle turns slowly when the head is this close to its seat [m] [A].
FEED_RESERVE = 0.003  # The feed can follow the bolt this far beyond its engaged length [m] [A].
FEED_GAIN = 0.02  # Feed speed per missing thrust [m/s per N] [A].
FEED_LIMIT = 0.02  # [m/s] [A]
STOP_TIME = 0.05  # Of the spindle [s] [A].
CLUTCH_TIME = 0.002  # The clutch does not feel shorter shocks [s] [A].
REST_TIME = 0.2  # [s] [A]
RETREAT = 0.05  # Of the gripper from what it held [m] [A].


@in_programs
class DrivePhase(Enum):
    """What comes besides holding the clamped part."""

    LOOK = "look"
    DRIVER_ABOVE = "driver above"
    LOOK_AT_HEAD = "look at the head"
    BIT_IN = "bit into socket"
    RUN_DOWN = "run down"
    TIGHTEN = "tighten"
    STOP = "stop"
    DRIVER_OFF = "driver off"
    REST = "rest"


# Those in which the bolt turns in its thread, in their order.
DRIVEN = (DrivePhase.RUN_DOWN, DrivePhase.TIGHTEN)


def star_order(station: Station, bolts: Sequence[str]) -> list[str]:
    """Return the bolts so that each is as far as possible from those before it.

    Ties go to the one farthest from the latest bolt: 1, 4, then across again, as on a wheel.
    """
    place = {bolt: station.part(bolt).X_AP.translation() for bolt in bolts}
    order, remaining = [bolts[0]], list(bolts[1:])
    while remaining:

        def spread(bolt: str) -> tuple[float, float]:
            distances = [float(np.linalg.norm(place[bolt] - place[done])) for done in order]
            return round(min(distances), 6), distances[-1]

        order.append(max(remaining, key=spread))
        remaining.remove(order[-1])
    return order


@in_programs
@dataclass
class Feed:
    """Servo of the driver's arm: sink so that the bit holder's spring pushes with a set force.

    Attributes:
        tool: Name of the driver.
        line: Motion straight down, as a path to be followed at the servo's own pace.
        length: Of that path [m].
        thrust: Wanted axial force on the bit [N].
        dt: Time step [s].
        progress: Time on the line reached so far [s].
    """

    tool: str
    line: JointMotion
    length: float
    thrust: float
    dt: float
    progress: float = 0.0

    def __call__(self, sensed: Sensed) -> tuple[np.ndarray, np.ndarray]:
        """Return the joint target for the next step."""
        missing = self.thrust - sensed.drivers[self.tool].push
        speed = float(np.clip(FEED_GAIN * missing, -FEED_LIMIT, FEED_LIMIT))
        rate = speed * self.line.duration / self.length
        self.progress = float(np.clip(self.progress + rate * self.dt, 0.0, self.line.duration))
        q, v = self.line.at(self.progress)
        return q, v * rate


@in_programs
@dataclass
class Clutch:
    """End condition: the spindle has kept up a torque; a shock does not trip it.

    Attributes:
        tool: Name of the driver.
        torque: To trip at [N m].
    """

    tool: str
    torque: float
    _reached: float | None = None

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether the clutch trips."""
        if sensed.drivers[self.tool].torque < self.torque:
            self._reached = None
        elif self._reached is None:
            self._reached = sensed.time
        # Times are multiples of the step, so half a microsecond only absorbs rounding.
        return self._reached is not None and sensed.time >= self._reached + CLUTCH_TIME - 5e-7

    def missing(self, sensed: Sensed) -> str:
        """Return what it is waiting for."""
        torque = sensed.drivers[self.tool].torque
        return f"the spindle turns with {torque:.2f} N m, not with {self.torque:g} N m"


def carry_out(station: Station, step: Step) -> Generator[Phase, Outcome, None]:
    """Yield the phases that tighten every bolt of a step."""
    clamped = station.cell.product.screws[step.parts[0]].clamps
    assembly = frozenset([*station.fixed, *step.parts])
    order = star_order(station, step.parts)
    yield from look(station, DrivePhase.LOOK, clamped, closely=(clamped,))

    def meanwhile(coming: Coming) -> dict[str, Command]:
        return come_beside(station, order[0], coming)

    def leaves_room(reach: Reach) -> bool:
        return _leaves_room(station, order, reach)

    if station.config.driver.counter_hold:
        grasp = yield from hold(station, clamped, meanwhile, leaves_room)
        for bolt in order:
            yield from tighten_bolt(station, bolt)
        if grasp is not None:
            yield from let_go(station, clamped, grasp, RETREAT, assembly)
    else:
        yield from park(station, meanwhile)
        for bolt in order:
            yield from tighten_bolt(station, bolt)
    # Nothing holds the assembly now but the fixture: what it measures here is what the user gets.
    yield Phase(DrivePhase.REST, after(REST_TIME), timeout=1.0, subject="assembly", awake=assembly)


def foresee(station: Station, step: Step) -> tuple[str, ...]:
    """See whether the driver reaches every bolt, beside the hand that holds against it."""
    clamped = station.cell.product.screws[step.parts[0]].clamps
    holds = station.config.driver.counter_hold
    if holds and any(_leaves_room(station, step.parts, r) for r in from_the_side(station, clamped)):
        return ()
    away = {station.holder.name: station.holder.home}
    for bolt in step.parts:
        if not ways_above(station, bolt, away):
            _above(station, bolt, away)  # Raises what is said of it.
    if not holds:
        return ()
    alone = "leaves room for the driver: the jig alone bears the torque"
    return (f"no grasp of '{clamped}' from the side {alone}",)


def _leaves_room(station: Station, bolts: Sequence[str], reach: Reach) -> bool:
    """Return whether the driver reaches bolts while the hand holds what they clamp."""
    jaws = opened(station.cell.gripper.model, reach.grasp).opening / 2
    hand = {station.holder.name: reach.q_at, station.hand: np.full(2, jaws)}
    return all(ways_above(station, bolt, hand) for bolt in bolts)


def tighten_bolt(station: Station, bolt: str) -> Generator[Phase, Outcome, None]:
    """Yield the phases that drive one bolt home."""
    driver, spindle = station.driver, station.driver.tool.name
    config = station.config
    tip, screw = driver.frame("tool_tip"), station.cell.product.screws[bolt]
    awake = _awake(station, bolt)
    # What the bolt clamps together slips into place meanwhile. Once another bolt clamps it, it does
    # so under the torque only: it stays on its seat while this one is run down.
    seat = frozenset([screw.into, screw.clamps])
    mating = frozenset([seat])
    driven = [station.cell.product.screws[name] for name in station.driven]
    clamped = any(seat == {other.into, other.clamps} for other in driven)

    yield from look(station, DrivePhase.LOOK, bolt, awake=_awake(station))
    holding = _holding(station)
    above = _above(station, bolt)
    yield Phase(
        DrivePhase.DRIVER_ABOVE,
        motion_finished,
        timeout=20.0,
        subject=bolt,
        commands={
            driver.name: station.move(driver, above, holding, clearance=FINE_CLEARANCE),
            spindle: Spin(0.0),
        },
        awake=_awake(station),
    )
    yield from look(station, DrivePhase.LOOK_AT_HEAD, bolt, [bolt], awake=_awake(station))
    R_WE = station.tool_pose(driver, "tool_tip").rotation()
    X_WE = RigidTransform(R_WE, _socket_pose(station, bolt).translation())
    outcome = yield Phase(
        DrivePhase.BIT_IN,
        # That the hex has dropped into the socket is told by the model of the joint between them,
        # like a sensor in the bit: bit and socket do not touch otherwise, so nothing is felt.
        All((motion_finished, Signal(f"{bolt} in bit"))),
        timeout=5.0,
        subject=bolt,
        commands={
            driver.name: station.line(driver, tip, X_WE, speed=PLUNGE_SPEED),
            spindle: Spin(FIND_SPEED),
        },
        awake=awake,
    )

    # The bolt stood on the mouth of its thread when the bit dropped in: how far it has to sink is
    # known from then on, wherever it was seen to stand.
    bit = driver.frame("bit_tip")
    mouth = outcome.sensed.X_WF(bit).translation()[2]
    depth = screw.thread_depth + FEED_RESERVE
    down = raised(station.tool_pose(driver, "tool_tip"), -depth)
    line = station.line(driver, tip, down, speed=FEED_LIMIT)
    feed = Follow(Feed(spindle, line, depth, config.driver.push_force, config.simulation.time_step))
    nearly_seated = Below(Height(bit), float(mouth) - (screw.thread_depth - SLOW_BELOW))
    yield Phase(
        DrivePhase.RUN_DOWN,
        nearly_seated,
        timeout=10.0,
        subject=bolt,
        commands={driver.name: feed, spindle: Spin(config.driver.free_speed)},
        awake=awake,
        mating=frozenset() if clamped else mating,
    )
    station.driven += (bolt,)
    yield Phase(
        DrivePhase.TIGHTEN,
        Clutch(spindle, screw.torque),
        timeout=5.0,
        subject=bolt,
        commands={driver.name: feed, spindle: Spin(config.driver.seat_speed)},
        awake=awake,
        mating=mating,
        fine_log=True,
    )
    yield Phase(
        DrivePhase.STOP,
        after(STOP_TIME),
        timeout=1.0,
        subject=bolt,
        commands={spindle: Spin(0.0)},
        awake=awake,
        mating=mating,
    )
    off = backed_off(station.tool_pose(driver, "tool_tip"), BIT_HOVER + depth)
    yield Phase(
        DrivePhase.DRIVER_OFF,
        motion_finished,
        timeout=5.0,
        subject=bolt,
        commands={driver.name: station.line(driver, tip, off, felt=config.driver.push_force)},
        awake=awake,
    )


def _awake(station: Station, *bolts: str) -> frozenset[str]:
    """Return what bears a tightening: the assembly, the bolts driven so far, and others."""
    return frozenset([*station.fixed, *station.driven, *bolts])


def _socket_pose(station: Station, bolt: str) -> RigidTransform:
    """Return the pose of the bit's end when it sits in the drive of a bolt, pointing down."""
    seat = station.cell.product.screws[bolt].bit_seat
    p_WE = station.pose_of(bolt) @ np.array([0.0, 0.0, seat])
    return RigidTransform(RotationMatrix.MakeXRotation(np.pi), p_WE)


def _holding(station: Station) -> list[tuple[str, str]]:
    """Return the pairs that may come close while the hand holds the assembly."""
    return [(station.hand, part) for part in station.fixed]


def _above(
    station: Station, bolt: str, elsewhere: Mapping[str, np.ndarray] | None = None
) -> np.ndarray:
    """Return the nearest configuration (n,) over a bolt's head; the arguments: `ways_above`.

    Raises:
        Unreachable: There is none.
    """
    driver = station.driver
    near = driver.positions(station.context)
    found = ways_above(station, bolt, elsewhere)
    if not found:
        X_WE = backed_off(_socket_pose(station, bolt), BIT_HOVER)
        reason = "no turn of the driver keeps clear there"
        raise Unreachable(driver.name, "tool_tip", X_WE, reason)
    return min(found, key=lambda q: float(np.max(np.abs(q - near))))


def ways_above(
    station: Station, bolt: str, elsewhere: Mapping[str, np.ndarray] | None = None
) -> list[np.ndarray]:
    """Return configurations (n,) over a bolt's head, turned any way about its axis.

    Args:
        station: The planner's view of the cell.
        bolt: Name of the bolt.
        elsewhere: See `Station.surroundings`.
    """
    driver, holding = station.driver, _holding(station)
    tip, near = driver.frame("tool_tip"), driver.positions(station.context)
    X_WE = backed_off(_socket_pose(station, bolt), BIT_HOVER)
    found: list[np.ndarray] = []
    for turn in np.deg2rad(np.arange(0.0, 360.0, 30.0)):
        X = X_WE @ RigidTransform(RotationMatrix.MakeZRotation(turn), np.zeros(3))
        found += station.configurations(driver, tip, X, near, holding, FINE_CLEARANCE, elsewhere)
    return found


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
        above = _above(station, bolt, {hand: coming.q_then, **jaws})
        motion = station.move(
            driver,
            above,
            _holding(station),
            FINE_CLEARANCE,
            elsewhere=jaws,
            beside={hand: coming.motion},
        )
    except (Unreachable, NoPath):
        return {}
    # The last stretch of the hand, with the driver over the bolt; it is as straight as this.
    stretch = np.linspace(coming.motion.q[-1], coming.q_then, 20)
    clear = all(station.model.are_free({driver.name: above, hand: q}) for q in stretch)
    return {driver.name: motion} if clear else {}
