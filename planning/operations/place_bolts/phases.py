"""The phases that set bolts into their holes.

The hand sets each bolt upright into its hole, where it stands on the mouth of the thread. If the
part with the thread is not there yet, the bolt hangs by its head, or stands on what is below.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform

from cell.simulation.conditions import Either, PushesBack
from cell.simulation.phase import Phase, motion_finished
from cell.simulation.vocabulary import in_programs
from planning.operations.bolts import mouth_pose, standing_pose
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
from planning.operations.station import FINE_CLEARANCE, Station
from planning.operations.waiting import at_rest, steady_wrist

LOOK_TIME = 0.05  # The bolt comes to rest in the tray [s] [A].
LIFT = 0.06
CLEAR_ABOVE = 0.045  # Transfers end this far above where the bolt will stand [m] [A].
ABOVE = 0.006  # The bolt is looked at once more this far above the clamped part [m] [A].
ENTRY = 0.001  # Kept between its tip and the clamped part [m] [A].
TOUCH_FORCE = 1.5  # The bolt stands when it pushes back this hard [N] [A].
SLOW = 0.04  # At most, down to the seat [m/s] [A].
RETREAT = 0.05
ENTERED = 0.001  # A tip this far below the face is in the hole [m] [A].
# Where the hole is felt for, from where it should be [m] [A]: rings closer than the bolt's play of
# 0.2 mm on all sides would find any hole within 0.8 mm; these find it where the tip is cut, too.
PLACES = (
    np.zeros(3),
    *(
        radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        for radius in (3e-4, 6e-4)
        for angle in np.deg2rad(np.arange(0.0, 360.0, 60.0))
    ),
)


@in_programs
class BoltPhase(Enum):
    """What comes besides taking the bolt and letting it go."""

    LOOK = "look"
    TRANSFER = "transfer"
    LOOK_HIGH = "look over the hole"
    COME_DOWN = "come down"
    LOOK_LOW = "look at the hole"
    ALIGN = "align"
    HOVER = "hover"
    LOOK_IN = "look in the hole"
    LOWER = "lower"
    BACK_UP = "back up"
    LOWER_BESIDE = "lower beside"


def carry_out(station: Station, step: Step) -> Iterator[Phase]:
    """Yield the phases that place one bolt after another."""
    # What has the thread is hidden under what is clamped; that one has been seen before it came.
    closely = sorted({station.cell.product.screws[bolt].clamps for bolt in step.parts})
    for bolt in step.parts:
        yield from place_bolt(station, bolt, closely)
        closely = []  # Bolts move nothing that lies on the fixture.


def foresee(station: Station, step: Step) -> tuple[str, ...]:
    """Choose the grasp of every bolt, and believe it to stand in its hole."""
    for bolt in step.parts:
        _grasp_for_hole(station, bolt)
        station.belief.suppose(bolt, standing_pose(station, bolt))
    return ()


def place_bolt(station: Station, bolt: str, closely: Sequence[str] = ()) -> Iterator[Phase]:
    """Yield the phases that stand a bolt in its hole.

    Args:
        station: The planner's view of the cell.
        bolt: Name of a bolt of the product.
        closely: Names of the parts with holes that are to be looked at before, see `look`.
    """
    arm, held = station.holder, frozenset([bolt])
    yield from look(station, BoltPhase.LOOK, bolt, closely=closely, settle=LOOK_TIME, awake=held)
    reach = _grasp_for_hole(station, bolt)
    yield from take(station, bolt, reach, LIFT)
    jaw, holding = arm.frame(reach.grasp.jaw), lost_grasp(station)
    # Heights are those of a bolt that stands on the mouth of its thread. From the lowest of them
    # on, its shank can touch the clamped part.
    length = -float(station.part(bolt).mesh.bounds[0][2])
    entry = length - station.cell.product.screws[bolt].thread_depth + ENTRY
    X_WMouth, X_WStand = mouth_pose(station, bolt), standing_pose(station, bolt)

    def at(X_WP: RigidTransform) -> RigidTransform:
        return X_WP @ jaw_to_part(station, bolt, reach.grasp).inverse()

    above = station.configuration(
        arm, jaw, at(raised(X_WMouth, CLEAR_ABOVE)), reach.q_before, [(station.hand, bolt)]
    )
    yield Phase(
        BoltPhase.TRANSFER,
        motion_finished,
        timeout=20.0,
        subject=bolt,
        commands={arm.name: station.move(arm, above)},
        guard=holding,
        awake=held,
    )
    for look_kind, kind, height in (
        (BoltPhase.LOOK_HIGH, BoltPhase.COME_DOWN, entry + ABOVE),
        (BoltPhase.LOOK_LOW, BoltPhase.ALIGN, entry),
    ):
        yield from look(station, look_kind, bolt, [bolt], awake=held, guard=holding)
        line = station.line(arm, jaw, at(raised(X_WMouth, height)))
        yield Phase(
            kind,
            motion_finished,
            timeout=5.0,
            subject=bolt,
            commands={arm.name: line},
            guard=holding,
            awake=held,
        )
    # The wrist is tared at rest.
    yield Phase(
        BoltPhase.HOVER, steady_wrist(arm.name), 1.0, subject=bolt, guard=holding, awake=held
    )
    # What a bolt at its hole can touch, and what bears that.
    awake = held | frozenset(station.fixed)
    yield from look(station, BoltPhase.LOOK_IN, bolt, [bolt], awake=awake, guard=holding)
    under, hover = at(raised(X_WStand, -2e-4)), at(raised(X_WMouth, entry))

    def beside(X_WJaw: RigidTransform, offset: np.ndarray) -> RigidTransform:
        return RigidTransform(X_WJaw.rotation(), X_WJaw.translation() + offset)

    for place, offset in enumerate(PLACES):
        if place > 0:
            # Its tip is on the face beside the hole: it leans in the grip, or was not seen well.
            line = station.line(arm, jaw, beside(hover, offset), speed=SLOW)
            yield Phase(
                BoltPhase.BACK_UP,
                at_rest(arm.name),
                timeout=5.0,
                subject=bolt,
                commands={arm.name: line},
                guard=holding,
                awake=awake,
            )
        down = station.line(arm, jaw, beside(under, offset), speed=SLOW, felt=TOUCH_FORCE)
        yield Phase(
            BoltPhase.LOWER if place == 0 else BoltPhase.LOWER_BESIDE,
            Either((motion_finished, PushesBack(arm.name, TOUCH_FORCE))),
            timeout=10.0,
            subject=bolt,
            commands={arm.name: down},
            guard=holding,
            awake=awake,
        )
        height = (station.pose_of(bolt).translation() - X_WMouth.translation())[2]
        if height < entry - ENTRY - ENTERED:
            break
    yield from let_go(station, bolt, reach.grasp, RETREAT, awake)
    # Who cannot see the bolt knows it by what holds it, better than by the hand that was there.
    station.belief.rest(bolt, standing_pose(station, bolt))


def _grasp_for_hole(station: Station, bolt: str) -> Reach:
    """Return a grasp with which the hand also fits between the neighbours of the hole.

    Raises:
        Unreachable: There is none.
    """
    arm, X_WStand = station.holder, standing_pose(station, bolt)
    may_touch = [(station.hand, bolt), ("held", "*")]
    grasps = station.part(bolt).grasps
    for reach in reachable_grasps(station, bolt, station.pose_of(bolt), grasps):
        fits = station.configurations(
            arm,
            arm.frame(reach.grasp.jaw),
            X_WStand @ reach.grasp.X_PJaw,
            reach.q_before,
            may_touch,
            clearance=FINE_CLEARANCE,
        )
        if fits and np.max(np.abs(fits[0] - reach.q_before)) < np.pi:
            return reach
    raise no_grasp(station, bolt)
