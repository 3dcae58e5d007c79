"""The phases that fetch a part from the tray, press it into the fixture and let that hold it."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform

from cell.machines.arm import Unreachable
from cell.products.product import Grasp
from cell.simulation.conditions import All, PushesBack, Signal
from cell.simulation.events import fix_part, prepare_fixture, receive_part
from cell.simulation.phase import Phase, after, motion_finished
from cell.simulation.vocabulary import in_programs
from planning.operations.grasping import (
    Reach,
    jaw_to_part,
    let_go,
    lost_grasp,
    no_grasp,
    raised,
    reachable_grasps,
    take,
)
from planning.operations.look import look
from planning.operations.operation import Step
from planning.operations.placement import (
    HOVER,
    RETREAT,
    Placement,
    Suits,
    anywhere,
    brought_to,
    choose_placement,
    reachable_yaws,
    seated,
)
from planning.operations.station import FIXTURE, Station
from planning.operations.waiting import steady_wrist

LIFT = 0.12  # Out of the tray, over its neighbours [m] [A].
PRESS_SPEED = 0.02  # [m/s] [A]; the bed has no rate effect at 10 to 80 mm/s [M].
# Pressing fails if the bed has not resisted this far below its apex [m] [A]: the plate's foot is
# 15 mm deep before its face comes to lie on the bed.
DEEPEST = 0.03
LOOK_TIME = 0.2  # The part comes to rest in the tray [s] [A].
SETTLE_TIME = 1.0


@in_programs
class PlacePhase(Enum):
    """What comes besides taking the part and letting it go."""

    LOOK = "look"
    TRANSFER = "transfer"
    HOVER = "hover"
    PRESS = "press"
    STOP = "stop"
    FIX = "jam"
    SETTLE = "settle"
    LOOK_AGAIN = "look again"
    FREE = "vent"
    READY = "inflate"


def foresee(station: Station, step: Step) -> tuple[str, ...]:
    """Choose grasp and place of a part, and believe it to stand there."""
    (part,) = step.parts
    product = station.cell.product
    _, placement = choose(station, part, product.up, brought_to(product, part), anywhere)
    station.origins[part] = station.pose_of(part)
    station.belief.suppose(part, seated(station, part, placement.X_WP))
    return ()


def yaws_to_place(station: Station, part: str) -> Iterator[float]:
    """Yield the yaws at which the hand reaches over the fixture, by grasp, least turned first."""
    for reach in _top_first(station, part, station.pose_of(part)):
        yield from reachable_yaws(station, part, station.cell.product.up, reach)


def can_place(station: Station, part: str) -> bool:
    """Return whether a part can be put on the fixture, and later parts be brought to it there."""
    product = station.cell.product
    try:
        choose(station, part, product.up, brought_to(product, part), anywhere)
    except Unreachable:
        return False
    return True


def pick_place(
    station: Station,
    part: str,
    up: str,
    later: tuple[str, ...] = (),
    suits: Suits = anywhere,
) -> Iterator[Phase]:
    """Yield the phases that fix a part on the fixture.

    Args:
        station: The planner's view of the cell.
        part: Name of the part.
        up: Axis of the product frame that shall point up.
        later: Names of the parts that will be mated with it: its yaw must suit them.
        suits: Whether its pose on the fixture suits whatever else comes later.
    """
    awake = frozenset([part])
    yield from look(
        station,
        PlacePhase.LOOK,
        part,
        closely=(part,),
        settle=LOOK_TIME,
        start=(prepare_fixture,),
        awake=awake,
    )
    station.origins[part] = station.pose_of(part)
    reach, placement = choose(station, part, up, later, suits)
    station.placements[part] = placement
    yield from take(station, part, reach, LIFT)
    yield from put(station, part, reach, placement)


def put(station: Station, part: str, reach: Reach, placement: Placement) -> Iterator[Phase]:
    """Yield the phases that bring a part in the hand to the fixture, fix it and let it go.

    Args:
        station: The planner's view of the cell.
        part: Name of the part.
        reach: How it is held.
        placement: Where it goes.
    """
    arm, awake = station.holder, frozenset([part])
    holding, frame = lost_grasp(station), arm.frame(reach.grasp.jaw)
    X_WJaw = placement.X_WP @ jaw_to_part(station, part, reach.grasp).inverse()
    may_touch = [("held", FIXTURE)]
    q_hover = station.configuration(arm, frame, X_WJaw, placement.q, may_touch)
    yield Phase(
        PlacePhase.TRANSFER,
        motion_finished,
        timeout=20.0,
        subject=part,
        commands={arm.name: station.move(arm, q_hover, may_touch)},
        guard=holding,
        awake=awake,
    )
    # The wrist is tared at rest: the braking arm feels 2 N of its own [M].
    yield Phase(
        PlacePhase.HOVER, steady_wrist(arm.name), 1.0, subject=part, guard=holding, awake=awake
    )
    down = HOVER + DEEPEST
    force = station.config.placement.press_force
    line = station.line(arm, frame, raised(X_WJaw, -down), speed=PRESS_SPEED, felt=force)
    yield Phase(
        PlacePhase.PRESS,
        PushesBack(arm.name, force),
        timeout=1.0 + down / PRESS_SPEED,
        subject=part,
        commands={arm.name: line},
        guard=holding,
        start=(receive_part(part),),
        awake=awake,
    )
    # The hand comes to rest first: what moves then is not moved by the fixing.
    yield Phase(
        PlacePhase.STOP,
        steady_wrist(arm.name),
        1.0,
        subject=part,
        guard=holding,
        awake=awake,
        tare=False,
    )
    # The bed moves a little as it freezes: the hand waits until that is over.
    yield Phase(
        PlacePhase.FIX,
        All((Signal("fixture fixed"), steady_wrist(arm.name))),
        timeout=5.0,
        subject=part,
        guard=holding,
        start=(fix_part,),
        awake=awake,
        fine_log=True,  # A kick lasts milliseconds.
    )
    yield from let_go(station, part, reach.grasp, RETREAT, awake)
    yield Phase(PlacePhase.SETTLE, after(SETTLE_TIME), timeout=2.0, subject=part, awake=awake)


def choose(
    station: Station, part: str, up: str, later: tuple[str, ...], suits: Suits
) -> tuple[Reach, Placement]:
    """Return the first grasp with a placement, grasps from above first."""
    failure = None
    for reach in _top_first(station, part, station.pose_of(part)):
        try:
            return reach, choose_placement(station, part, up, reach, later, suits)
        except Unreachable as error:
            failure = error
    raise failure or no_grasp(station, part)


def _top_first(station: Station, part: str, X_WP: RigidTransform) -> Iterator[Reach]:
    """Yield reachable grasps: from above first, of these the one nearest to the mass centre.

    What is pressed off the middle of its pads turns in the grip.
    """
    p_PCom = station.part(part).mesh.center_mass

    def rank(grasp: Grasp) -> tuple[float, float]:
        X_WJaw = X_WP @ grasp.X_PJaw
        away = X_WJaw.translation() - X_WP @ p_PCom
        return round(X_WJaw.rotation().matrix()[2, 2], 2), float(np.hypot(away[0], away[1]))

    return reachable_grasps(station, part, X_WP, sorted(station.part(part).grasps, key=rank))
