"""The phases that drive standing bolts home in star order.

The driver comes down on one head after another: bit into socket, searched for where it is not;
thread caught, run down, seated, tightened until the clutch trips. The gripper holds against it
meanwhile, by the clamped part or by the one that the thread is in, or is out of the way. Screws
that ask for two passes are all tightened to half their torque first.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform

from cell.machines.driver import tightening_speed
from cell.simulation.conditions import All, Below, Either, Height, Signal
from cell.simulation.phase import (
    Command,
    Follow,
    Outcome,
    Phase,
    Spin,
    after,
    motion_finished,
)
from cell.simulation.vocabulary import in_programs
from planning.operations.counter_hold import Coming, from_the_side, hold, park, parking
from planning.operations.grasping import Reach, backed_off, let_go, opened, raised
from planning.operations.look import look
from planning.operations.operation import Step
from planning.operations.station import FINE_CLEARANCE, Station
from planning.operations.tighten_bolts.over_bolt import (
    BIT_HOVER,
    above,
    come_beside,
    is_reached,
    may_come_near,
    socket_pose,
)
from planning.operations.tighten_bolts.search import (
    FIND_SPEED,
    find_socket,
    has_turned,
    stands_on_something,
)
from planning.operations.tighten_bolts.servos import FEED_LIMIT, Clutch, Feed

PLUNGE_SPEED = 0.08  # Of the bit down to the socket [m/s] [A].
SLOW_BELOW = 2.5e-4  # The spindle turns slowly when the head is this close to its seat [m] [A].
FEED_RESERVE = 0.003  # The feed can follow the bolt this far beyond its engaged length [m] [A].
STOP_TIME = 0.05  # Of the spindle [s] [A].
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
    # Of screws that come twice, the first time.
    FIRST_TIGHTEN = "tighten to half"
    FIRST_STOP = "stop at half"
    FIRST_DRIVER_OFF = "driver off at half"
    # And the second time.
    SECOND_LOOK = "look again"
    SECOND_DRIVER_ABOVE = "driver above again"
    SECOND_LOOK_AT_HEAD = "look at the head again"
    SECOND_BIT_IN = "bit into socket again"


@dataclass(frozen=True)
class Pass:
    """One coming of the driver to each screw.

    Attributes:
        share: Of its torque.
        standing: Whether the bolt stands on the mouth of its thread, and is not seated yet.
        look, above, look_at_head, bit_in, tighten, stop, off: Kinds of its phases.
    """

    share: float
    standing: bool
    look: DrivePhase = DrivePhase.LOOK
    above: DrivePhase = DrivePhase.DRIVER_ABOVE
    look_at_head: DrivePhase = DrivePhase.LOOK_AT_HEAD
    bit_in: DrivePhase = DrivePhase.BIT_IN
    tighten: DrivePhase = DrivePhase.TIGHTEN
    stop: DrivePhase = DrivePhase.STOP
    off: DrivePhase = DrivePhase.DRIVER_OFF


ONLY = Pass(1.0, standing=True)
# In two steps, half the torque and then the whole: so each screw finds what it clamps level, and
# takes less from those before it [R] (multiple-pass tightening against elastic interaction:
# boltscience.com, Tightening Sequences; two steps: Tohnichi, Torque Handbook, chapter 2). [A] Half.
FIRST = Pass(
    0.5,
    standing=True,
    tighten=DrivePhase.FIRST_TIGHTEN,
    stop=DrivePhase.FIRST_STOP,
    off=DrivePhase.FIRST_DRIVER_OFF,
)
SECOND = Pass(
    1.0,
    standing=False,
    look=DrivePhase.SECOND_LOOK,
    above=DrivePhase.SECOND_DRIVER_ABOVE,
    look_at_head=DrivePhase.SECOND_LOOK_AT_HEAD,
    bit_in=DrivePhase.SECOND_BIT_IN,
)

# Those in which the bolt turns in its thread, in their order.
DRIVEN = (DrivePhase.RUN_DOWN, DrivePhase.FIRST_TIGHTEN, DrivePhase.TIGHTEN)


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

    def clear_at(q: np.ndarray) -> bool:
        return _clear_at(station, order, q)

    if station.config.driver.counter_hold:
        held = yield from hold(station, holdable(station, step), meanwhile, leaves_room, clear_at)
        yield from _tighten_all(station, order)
        if held is not None:
            yield from let_go(station, *held, RETREAT, assembly)
    else:
        yield from park(station, meanwhile, clear_at)
        yield from _tighten_all(station, order)
    # Nothing holds the assembly now but the fixture: what it measures here is what the user gets.
    yield Phase(DrivePhase.REST, after(REST_TIME), timeout=1.0, subject="assembly", awake=assembly)


def foresee(station: Station, step: Step) -> tuple[str, ...]:
    """See whether the driver reaches every bolt, beside the hand that holds against it."""
    parts, holds = holdable(station, step), station.config.driver.counter_hold
    sides = from_the_side(station, parts) if holds else ()
    if any(_leaves_room(station, step.parts, reach) for _, reach in sides):
        return ()
    q_park = parking(station, lambda q: _clear_at(station, step.parts, q))
    away = {station.holder.name: q_park}
    for bolt in step.parts:
        if not is_reached(station, bolt, away):
            above(station, bolt, away)  # Raises what is said of it.
    if not holds:
        return ()
    alone = "leaves room for the driver: the jig alone bears the torque"
    either = " or ".join(f"'{part}'" for part in parts)
    return (f"no grasp of {either} from the side {alone}",)


def holdable(station: Station, step: Step) -> tuple[str, str]:
    """Return the parts by which the hand may hold against the driver: best the one under the heads.

    The torque of a head goes into what it clamps; the part with the thread takes it from there.
    """
    screw = station.cell.product.screws[step.parts[0]]
    return screw.clamps, screw.into


def _clear_at(station: Station, bolts: Sequence[str], q: np.ndarray) -> bool:
    """Return whether the driver reaches bolts while the holder is at joint angles (n,) [rad]."""
    return all(is_reached(station, bolt, {station.holder.name: q}) for bolt in bolts)


def _leaves_room(station: Station, bolts: Sequence[str], reach: Reach) -> bool:
    """Return whether the driver reaches bolts while the hand holds what they clamp."""
    jaws = opened(station.cell.gripper.model, reach.grasp).opening / 2
    hand = {station.holder.name: reach.q_at, station.hand: np.full(2, jaws)}
    return all(is_reached(station, bolt, hand) for bolt in bolts)


def _tighten_all(station: Station, order: Sequence[str]) -> Generator[Phase, Outcome, None]:
    """Yield the phases that drive bolts home, those that ask for two passes in two."""
    screws = station.cell.product.screws
    twice = [bolt for bolt in order if screws[bolt].passes > 1]
    for bolt in twice:
        yield from tighten_bolt(station, bolt, FIRST)
    for bolt in order:
        yield from tighten_bolt(station, bolt, SECOND if bolt in twice else ONLY)


def tighten_bolt(station: Station, bolt: str, kinds: Pass) -> Generator[Phase, Outcome, None]:
    """Yield the phases of one pass on one bolt."""
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

    yield from look(station, kinds.look, bolt, awake=_awake(station))
    holding = may_come_near(station)
    q_above = above(station, bolt)
    yield Phase(
        kinds.above,
        motion_finished,
        timeout=20.0,
        subject=bolt,
        commands={
            driver.name: station.move(driver, q_above, holding, clearance=FINE_CLEARANCE),
            spindle: Spin(0.0),
        },
        awake=_awake(station),
    )
    yield from look(station, kinds.look_at_head, bolt, [bolt], awake=_awake(station))
    R_WE = station.tool_pose(driver, "tool_tip").rotation()
    X_WE = RigidTransform(R_WE, socket_pose(station, bolt).translation())
    plunge = station.line(driver, tip, X_WE, speed=PLUNGE_SPEED)
    # That the hex has dropped into the socket is told by the model of the joint between them, like
    # a sensor in the bit: in the socket they do not touch, so nothing is felt. Beside it the bit
    # stands on the head, or on nothing.
    in_bit = Signal(f"{bolt} in bit")
    missed = stands_on_something(station), has_turned(station, bolt, plunge.duration)
    outcome = yield Phase(
        kinds.bit_in,
        Either((All((motion_finished, in_bit)), *missed)),
        timeout=5.0,
        subject=bolt,
        commands={driver.name: plunge, spindle: Spin(FIND_SPEED)},
        awake=awake,
    )
    if not in_bit(outcome.sensed):
        outcome = yield from find_socket(station, bolt, outcome, awake)

    # The bolt stood on the mouth of its thread, or was seated, when the bit dropped in: how far it
    # has to sink is known from then on, wherever it was seen to stand.
    bit = driver.frame("bit_tip")
    mouth = outcome.sensed.X_WF(bit).translation()[2]
    depth = (screw.thread_depth if kinds.standing else 0.0) + FEED_RESERVE
    down = raised(station.tool_pose(driver, "tool_tip"), -depth)
    line = station.line(driver, tip, down, speed=FEED_LIMIT)
    feed = Follow(Feed(spindle, line, depth, config.driver.push_force, config.simulation.time_step))
    if kinds.standing:
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
    torque = kinds.share * screw.torque
    speed = min(config.driver.seat_speed, tightening_speed(torque, screw.diameter))
    yield Phase(
        kinds.tighten,
        Clutch(spindle, torque),
        timeout=5.0,
        subject=bolt,
        commands={driver.name: feed, spindle: Spin(speed)},
        awake=awake,
        mating=mating,
        fine_log=True,
    )
    yield Phase(
        kinds.stop,
        after(STOP_TIME),
        timeout=1.0,
        subject=bolt,
        commands={spindle: Spin(0.0)},
        awake=awake,
        mating=mating,
    )
    off = backed_off(station.tool_pose(driver, "tool_tip"), BIT_HOVER + depth)
    yield Phase(
        kinds.off,
        motion_finished,
        timeout=5.0,
        subject=bolt,
        commands={driver.name: station.line(driver, tip, off, felt=config.driver.push_force)},
        awake=awake,
    )


def _awake(station: Station, *bolts: str) -> frozenset[str]:
    """Return what bears a tightening: the assembly, the bolts driven so far, and others."""
    return frozenset([*station.fixed, *station.driven, *bolts])
