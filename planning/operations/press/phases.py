"""The phases that press a shaft into a hole that is narrower, or the hole onto the shaft.

The hand finds the mouth as it does for a fit. Then it pushes straight down at a constant speed,
soft in all other directions, until it feels the seat: a force beyond that of the fit. It stops
where it stands still under all the force that it may push with; how deep the part is then is
measured, not assumed.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator

import numpy as np
from pydrake.math import RigidTransform

from cell.machines.grippers.pads import borne_along
from cell.products.joints import Press
from cell.products.product import Grasp, Product
from cell.simulation.conditions import All, Below, Either, PushesBack, Steady
from cell.simulation.phase import Condition, Outcome, Phase, after
from planning.operations.mating import foresee_mating, mate, mating_at_hole
from planning.operations.operation import Step
from planning.operations.press.strength import (
    borne_by_arm,
    check_strength,
    needed,
)
from planning.operations.soft_hand import (
    BEYOND,
    NEAR,
    PATIENCE,
    STALL_TIME,
    STALLED,
    MatePhase,
    Mating,
    SoftHand,
    Target,
)
from planning.operations.station import Station
from planning.operations.targets import Descent

ENTERED = 1e-3  # A tip this deep is in its hole, or less where that takes the search's force [m].
SURGE = 1.3  # The push fails above its limit by this factor: it lands on a stiff seat [A].


def carry_out(station: Station, step: Step) -> Iterator[Phase]:
    """Yield the phases of a step.

    Raises:
        NoOperation: It takes more force than the hand has.
    """
    press, mating = press_of(step), mating_of(station.cell.product, step)
    check_strength(station, press, mating.part)

    def soft(hand: SoftHand) -> Iterator[Phase]:
        return press_in(hand, press)

    yield from mate(station, mating, step.riders, soft, _suits(station, press))


def foresee(station: Station, step: Step) -> tuple[str, ...]:
    """Choose a grasp that bears the force of a step, and believe the part to be seated.

    Raises:
        NoOperation: There is none, or the arm does not bear it.
    """
    press, mating = press_of(step), mating_of(station.cell.product, step)
    check_strength(station, press, mating.part)
    foresee_mating(station, mating, _suits(station, press))
    return ()


def press_of(step: Step) -> Press:
    """Return the joint that a step makes."""
    assert isinstance(step.joint, Press)
    return step.joint


def mating_of(product: Product, step: Step) -> Mating:
    """Return what a step brings to what."""
    return mating_at_hole(product, press_of(step), step.parts[0])


def press_in(hand: SoftHand, press: Press) -> Generator[Phase, Outcome, None]:
    """Yield the soft phases: find the mouth, search if it is not there, push."""
    config, height, depth = hand.config, hand.height, hand.mating.depth
    entered = min(ENTERED, depth * config.search_force / (2.0 * press.force))
    seat = float(hand.X_WSeat.translation()[2])
    target, stands, timeout = _down(hand, hand.X_WSeat, depth + NEAR, depth - BEYOND, config.speed)
    until = Either((Below(height, seat + depth - entered), stands))
    outcome = yield hand.phase(MatePhase.INSERT, config.force_limit, target, until, timeout)
    if hand.gap(outcome) > depth - entered:
        outcome = yield hand.search(hand.gap(outcome), entered)
    station, felt = hand.station, needed(config, press)
    most = min(borne_by_arm(station), borne_along(hand.grasp.force))
    # Straight down from where the part has found its hole, as far as draws with all the force,
    # and further by what the part may slip in the grip.
    x, y, _ = hand.here(outcome).translation()
    X_WSeat = RigidTransform(hand.X_WSeat.rotation(), [x, y, seat])
    end = -most / config.lateral_stiffness - BEYOND
    target, stands, timeout = _down(hand, X_WSeat, hand.gap(outcome), end, config.landing_speed)
    until = Either((PushesBack(station.holder.name, felt), stands))
    yield hand.phase(MatePhase.PRESS, most, target, until, timeout, SURGE * most)


def _down(
    hand: SoftHand, X_WSeat: RigidTransform, start: float, end: float, speed: float
) -> tuple[Target, Condition, float]:
    """Return target, end condition and time-out of a way down at a constant speed [m/s].

    From and to heights over the seat [m]. Only what stands still when the target has come to its
    end stands under the whole force.
    """
    lasts = (start - end) / speed
    stands = All((Steady(hand.height, STALLED, STALL_TIME), after(lasts + STALL_TIME)))
    target = Descent(X_WSeat, np.array([0.0, lasts]), np.array([start, end]))
    return target, stands, lasts + PATIENCE


def _suits(station: Station, press: Press) -> Callable[[Grasp], bool]:
    """Return whether the pads do not slip, by grasp."""
    takes = needed(station.config.insertion, press)
    return lambda grasp: borne_along(grasp.force) >= takes
