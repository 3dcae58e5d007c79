"""The phases that take what stands on the fixture off it and set it down in the tray.

Bolts that lie loose in its holes ride along: nothing holds them but the holes and their heads. The
place in the tray is open below, so that their shanks hang free there.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum

from pydrake.math import RigidTransform

from cell.simulation.conditions import Either, PushesBack, Signal
from cell.simulation.events import free_part, release_part
from cell.simulation.phase import Phase, after, motion_finished
from cell.simulation.vocabulary import in_programs
from planning.operations.grasping import (
    Reach,
    comes_from_above,
    first,
    jaw_to_part,
    let_go,
    lift,
    lost_grasp,
    raised,
    reachable_grasps,
    seize,
)
from planning.operations.look import look
from planning.operations.operation import Step
from planning.operations.present import present
from planning.operations.station import Station

LIFT = 0.12
ABOVE = 0.045  # Transfers end this far above the place [m] [A].
LANDING = 0.003  # Slow from this far above the place on [m] [A].
SLOW = 0.005  # 0.01 mm a coarse step, by which the touch is felt too late [m/s] [A].
BELOW = 0.001  # The hand sinks at most this far below where the part stood before [m] [A].
TOUCH_FORCE = 3.0  # The part stands when it pushes back this hard [N] [A].
RETREAT = 0.08
SETTLE_TIME = 0.3


@in_programs
class AsidePhase(Enum):
    """What comes besides taking the part and letting it go."""

    LOOK = "look"
    FREE = "vent"
    TRANSFER = "transfer"
    LOOK_OVER_PLACE = "look over its place"
    ALIGN = "align"
    SET_DOWN = "set down"
    SETTLE = "settle"


def carry_out(station: Station, step: Step) -> Iterator[Phase]:
    """Yield the phases that take a part off the fixture and put it back into the tray."""
    ((part,), riders) = step.parts, step.riders
    arm = station.holder
    X_WGoal, riding = station.origins[part], frozenset(riders)
    awake = riding | {part}
    yield from look(station, AsidePhase.LOOK, part, closely=(part,))
    reach = first(_useful(station, part, X_WGoal), part, station)
    yield from seize(station, part, reach, riders)
    holding, jaw = lost_grasp(station), arm.frame(reach.grasp.jaw)
    # Freed first: pulled out of a frozen bed, the part would take its suction along.
    yield Phase(
        AsidePhase.FREE,
        Signal("fixture freed"),
        timeout=5.0,
        subject=part,
        guard=holding,
        start=(free_part,),
        awake=awake,
    )
    yield from lift(station, part, reach, LIFT)
    # On what it does not lie flat or squarely in its place, it tips over or jams there.
    forget = (release_part(part),)
    yield from present(station, part, guard=holding, awake=awake, riding=riding, start=forget)
    above = raised(X_WGoal, ABOVE) @ jaw_to_part(station, part, reach.grasp).inverse()
    q_above = station.configuration(arm, jaw, above, reach.q_before)
    yield Phase(
        AsidePhase.TRANSFER,
        motion_finished,
        timeout=20.0,
        subject=part,
        commands={arm.name: station.move(arm, q_above)},
        guard=holding,
        start=forget,
        awake=awake,
        riding=riding,
    )
    # Once more with the part over its place: it may have turned in the grip on the way.
    yield from look(
        station,
        AsidePhase.LOOK_OVER_PLACE,
        part,
        station.in_hand,
        awake=awake,
        guard=holding,
        riding=riding,
    )
    X_PJaw = jaw_to_part(station, part, reach.grasp).inverse()
    near, under = raised(X_WGoal, LANDING) @ X_PJaw, raised(X_WGoal, -BELOW) @ X_PJaw
    yield Phase(
        AsidePhase.ALIGN,
        motion_finished,
        timeout=10.0,
        subject=part,
        commands={arm.name: station.line(arm, jaw, near)},
        guard=holding,
        awake=awake,
        riding=riding,
    )
    yield Phase(
        AsidePhase.SET_DOWN,
        Either((motion_finished, PushesBack(arm.name, TOUCH_FORCE))),
        timeout=5.0,
        subject=part,
        commands={arm.name: station.line(arm, jaw, under, speed=SLOW, felt=TOUCH_FORCE)},
        guard=holding,
        awake=awake,
        riding=riding,
    )
    yield from let_go(station, part, reach.grasp, RETREAT, awake, riding)
    yield Phase(
        AsidePhase.SETTLE,
        after(SETTLE_TIME),
        timeout=1.0,
        subject=part,
        awake=awake,
        riding=riding,
    )


def _useful(station: Station, part: str, X_WGoal: RigidTransform) -> Iterator[Reach]:
    """Yield grasps of the part on the fixture with which the hand also reaches its place.

    There, as at every grasp, the fingers are not checked: they are opened for another part by now.
    """
    arm, hand, grasps = station.holder, station.hand, station.part(part).grasps
    for reach in reachable_grasps(station, part, station.pose_of(part), grasps):
        jaw, near = arm.frame(reach.grasp.jaw), reach.q_before
        X_WAbove, X_WAt = (raised(X_WGoal, height) @ reach.grasp.X_PJaw for height in (ABOVE, 0.0))
        if (
            comes_from_above(X_WGoal, reach.grasp.X_PJaw)
            and station.configurations(arm, jaw, X_WAbove, near, [(hand, part)])
            and station.configurations(arm, jaw, X_WAt, near, [(hand, "*")])
        ):
            yield reach
