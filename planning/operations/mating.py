"""The phases that bring a part from above to one on the fixture, until it is seated.

The hand carries the part over its place, then goes soft, see `planning.operations.soft_hand`, and
lets go of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from pydrake.math import RigidTransform

from cell.products.joints import Fit, Press
from cell.products.product import Grasp, Product
from cell.simulation.phase import Phase, motion_finished
from planning.feasibility.directions import unit_vector
from planning.operations.bolts import standing_pose
from planning.operations.grasping import (
    Reach,
    comes_from_above,
    jaw_to_part,
    let_go,
    lost_grasp,
    no_grasp,
    opened,
    raised,
    reachable_grasps,
    take,
)
from planning.operations.look import look
from planning.operations.soft_hand import NEAR, MatePhase, Mating, SoftHand, insert
from planning.operations.station import FINE_CLEARANCE, Station
from planning.operations.waiting import steady_wrist

LIFT = 0.12
ABOVE = 0.045  # Transfers end this far above the seat, clear of the shaft [m] [A].
RETREAT = 0.08

Suits = Callable[[Grasp], bool]  # Whether a grasp bears what comes.


def mating_at_hole(product: Product, joint: Fit | Press, part: str) -> Mating:
    """Return what it takes to bring one part of a shaft in its hole to the other.

    The compliance centre is where the part in the hand meets the other one first: at the mouth of
    its hole, or at the tip of its shaft.
    """
    up = unit_vector(product.up)
    if part == joint.hole:
        return Mating(joint.hole, joint.shaft, joint.p_AoF, joint.depth, up)
    return Mating(joint.shaft, joint.hole, joint.p_AoF - joint.depth * up, joint.depth, up)


def mate(
    station: Station,
    mating: Mating,
    riders: tuple[str, ...] = (),
    soft: Callable[[SoftHand], Iterator[Phase]] = insert,
    suits: Suits | None = None,
) -> Iterator[Phase]:
    """Yield the phases that bring a part to its seat and let it go.

    Bolts that ride in its holes reach beyond its underside: they come to stand on the mouths of
    their threads, and their heads stay behind as the part sinks to its seat.

    Args:
        station: The planner's view of the cell.
        mating: What is brought to what.
        riders: Names of the parts that lie loose on it.
        soft: Yields the phases in which the hand is soft.
        suits: See `useful_grasp`.
    """
    arm, part = station.holder, mating.part
    riding = frozenset(riders)
    held = riding | {part}
    # What bears the part that it comes to has to be there, too: nothing stands on what sleeps.
    both = held | {mating.on, *station.fixed}
    yield from look(station, MatePhase.LOOK, part, closely=(part, mating.on))
    X_WGoal = goal_pose(station, mating)
    reach = useful_grasp(station, mating, X_WGoal, suits)
    yield from take(station, part, reach, LIFT, riders)
    jaw, holding = arm.frame(reach.grasp.jaw), lost_grasp(station)
    above = raised(X_WGoal, ABOVE) @ jaw_to_part(station, part, reach.grasp).inverse()
    q_above = station.configuration(arm, jaw, above, reach.q_before, [("held", "*")])
    yield Phase(
        MatePhase.TRANSFER,
        motion_finished,
        timeout=20.0,
        subject=part,
        commands={arm.name: station.move(arm, q_above)},
        guard=holding,
        awake=held,
        riding=riding,
    )
    # Once more with the part over its place: it may have turned in the grip on the way.
    seen = (*station.in_hand, mating.on)
    yield from look(
        station,
        MatePhase.LOOK_OVER_SHAFT,
        part,
        seen,
        awake=held,
        guard=holding,
        riding=riding,
    )
    X_JawP, X_WGoal = jaw_to_part(station, part, reach.grasp), goal_pose(station, mating)
    near = raised(X_WGoal, mating.depth + NEAR) @ X_JawP.inverse()
    yield Phase(
        MatePhase.ALIGN,
        motion_finished,
        timeout=10.0,
        subject=part,
        commands={arm.name: station.line(arm, jaw, near)},
        guard=holding,
        awake=held,
        riding=riding,
    )
    # The wrist is tared at rest.
    yield Phase(
        MatePhase.HOVER,
        steady_wrist(arm.name),
        timeout=1.0,
        subject=part,
        guard=holding,
        awake=held,
        riding=riding,
    )
    yield from soft(SoftHand(station, mating, X_WGoal, reach.grasp, X_JawP, both))
    yield from let_go(station, part, reach.grasp, RETREAT, both)
    # Who cannot see a bolt knows it by what it has come to stand on, not by the hand it rode in.
    for bolt in riders:
        if bolt in station.cell.product.screws:
            station.belief.rest(bolt, standing_pose(station, bolt))


def foresee_mating(station: Station, mating: Mating, suits: Suits | None = None) -> None:
    """Choose a grasp that fits where a part is taken and where it is put; believe it to be there.

    Raises:
        Unreachable: There is none.
    """
    X_WGoal = goal_pose(station, mating)
    useful_grasp(station, mating, X_WGoal, suits)
    station.belief.suppose(mating.part, X_WGoal)


def goal_pose(station: Station, mating: Mating) -> RigidTransform:
    """Return the pose X_WP at which the part is seated, from what is believed."""
    on, part = station.part(mating.on), station.part(mating.part)
    return station.pose_of(mating.on) @ on.X_AP.inverse() @ part.X_AP


def useful_grasp(
    station: Station, mating: Mating, X_WGoal: RigidTransform, suits: Suits | None = None
) -> Reach:
    """Return the first of the `useful_grasps` that suits; None: any does.

    Raises:
        Unreachable: There is none; it says at which end.
    """
    for reach in useful_grasps(station, mating, X_WGoal):
        if suits is None or suits(reach.grasp):
            return reach
    part = station.part(mating.part)
    X_WP = station.pose_of(part.name)
    above = [g for g in part.grasps if comes_from_above(X_WGoal, g.X_PJaw)]
    if not above:
        raise no_grasp(station, part.name, f"part '{part.name}' has no grasp from above")
    if next(reachable_grasps(station, part.name, X_WP, above), None) is None:
        raise no_grasp(station, part.name)
    reason = f"no grasp of part '{part.name}' that is reached there suits its place on {mating.on}"
    raise no_grasp(station, part.name, reason)


def useful_grasps(station: Station, mating: Mating, X_WGoal: RigidTransform) -> Iterator[Reach]:
    """Yield grasps of the part in the tray with which the hand also fits where it is seated."""
    arm, part = station.holder, station.part(mating.part)
    gripper = station.cell.gripper
    for reach in reachable_grasps(station, part.name, station.pose_of(part.name), part.grasps):
        frame = arm.frame(reach.grasp.jaw)
        X_WAbove, X_WAt = (raised(X_WGoal, h) @ reach.grasp.X_PJaw for h in (ABOVE, 0.0))
        may_touch = [(station.hand, part.name), ("held", "*")]
        # Beside its seat the opened jaws come as close to the neighbours as they fit.
        jaws = {station.hand: np.full(2, opened(gripper.model, reach.grasp).opening / 2)}
        if (
            comes_from_above(X_WGoal, reach.grasp.X_PJaw)
            and station.configurations(arm, frame, X_WAbove, reach.q_before, may_touch)
            and station.configurations(
                arm, frame, X_WAt, reach.q_before, may_touch, FINE_CLEARANCE, jaws
            )
        ):
            yield reach
