"""The phases that bring a part from above to one on the fixture, until it is seated.

The hand carries the part over its place, then goes soft: an impedance centred where the parts meet
lets it comply sideways and tilt, pushes with a limited force, and searches on a spiral if a shaft
has not found its hole. It ends when the part stands still; whether it is seated is measured, not
assumed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import Frame

from cell.configuration.config import InsertionConfig
from cell.simulation.conditions import All, Below, FirstOf, Height, Steady, TooMuchForce
from cell.simulation.phase import Condition, Impedance, Outcome, Phase, after, motion_finished
from cell.simulation.vocabulary import in_programs
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
from planning.operations.station import FINE_CLEARANCE, Station
from planning.operations.targets import Descent, Spiral, There
from planning.operations.waiting import steady_wrist

LIFT = 0.12
ABOVE = 0.045  # Transfers end this far above the seat, clear of the shaft [m] [A].
NEAR = 0.002  # The hand goes soft this far before shaft and hole can meet [m] [A].
LANDING = 0.001  # Slow from this far above the seat to this far below it [m] [A].
BEYOND = 0.004  # The soft target ends this far below the seat, so that the hand presses [m] [A].
RETREAT = 0.08
STALL_TIME = 0.25
STALLED = 1.25e-4  # What moves less than this in the stall time stands: 0.5 mm/s [m].
PATIENCE = 5.0  # For coming to a stand under the whole force [s] [A].
YAW_STIFFNESS = 40.0  # About the axis of the hole; the bolt holes must meet [N m/rad] [A].
LATERAL_LIMIT = 15.0  # [N] [A]
TORQUE_LIMIT = 1.0  # [N m] [A]
TOO_MUCH = 30.0  # Insertion fails above this force [N].

Target = Callable[[float], RigidTransform]  # X_WD of the compliance centre over time [s].


@dataclass(frozen=True)
class Mating:
    """What is brought to what.

    Attributes:
        part: Name of the part in the hand.
        on: Name of the part on the fixture.
        p_AoC: Compliance centre C, in the product frame A [m]: the mouth of the hole in the hand,
            the tip of the shaft in the hand, or the middle of the face that comes to rest.
        depth: How far before its seat it meets what guides it, as a shaft its hole [m]; 0: nothing
            does.
        axis: (3,) direction out of the seat, in A.
    """

    part: str
    on: str
    p_AoC: np.ndarray
    depth: float
    axis: np.ndarray


@in_programs
class MatePhase(Enum):
    """What comes besides taking the part and letting it go."""

    LOOK = "look"
    TRANSFER = "transfer"
    LOOK_OVER_SHAFT = "look over the shaft"
    ALIGN = "align"
    HOVER = "hover"
    INSERT = "insert"
    SEARCH = "search"
    INSERT_AGAIN = "insert again"
    PRESS = "press"


# Those in which the hand is soft, in their order.
SOFT = (MatePhase.INSERT, MatePhase.SEARCH, MatePhase.INSERT_AGAIN, MatePhase.PRESS)


def mate(station: Station, mating: Mating, riders: tuple[str, ...] = ()) -> Iterator[Phase]:
    """Yield the phases that bring a part to its seat and let it go.

    Bolts that ride in its holes reach beyond its underside: they come to stand on the mouths of
    their threads, and their heads stay behind as the part sinks to its seat.
    """
    arm, part = station.holder, mating.part
    riding = frozenset(riders)
    held = riding | {part}
    # What bears the part that it comes to has to be there, too: nothing stands on what sleeps.
    both = held | {mating.on, *station.fixed}
    yield from look(station, MatePhase.LOOK, part, closely=(part, mating.on))
    X_WGoal = goal_pose(station, mating)
    reach = useful_grasp(station, mating, X_WGoal)
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
    yield from _insert(station, mating, X_WGoal, jaw, X_JawP, both)
    yield from let_go(station, part, reach.grasp, RETREAT, both)
    # Who cannot see a bolt knows it by what it has come to stand on, not by the hand it rode in.
    for bolt in riders:
        if bolt in station.cell.product.screws:
            station.belief.rest(bolt, standing_pose(station, bolt))


def foresee_mating(station: Station, mating: Mating) -> None:
    """Choose a grasp that fits where a part is taken and where it is put; believe it to be there.

    Raises:
        Unreachable: There is none.
    """
    X_WGoal = goal_pose(station, mating)
    useful_grasp(station, mating, X_WGoal)
    station.belief.suppose(mating.part, X_WGoal)


def goal_pose(station: Station, mating: Mating) -> RigidTransform:
    """Return the pose X_WP at which the part is seated, from what is believed."""
    on, part = station.part(mating.on), station.part(mating.part)
    return station.pose_of(mating.on) @ on.X_AP.inverse() @ part.X_AP


def useful_grasp(station: Station, mating: Mating, X_WGoal: RigidTransform) -> Reach:
    """Return the first of the `useful_grasps`.

    Raises:
        Unreachable: There is none; it says at which end.
    """
    for reach in useful_grasps(station, mating, X_WGoal):
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


def _insert(
    station: Station,
    mating: Mating,
    X_WGoal: RigidTransform,
    jaw: Frame,
    X_JawP: RigidTransform,
    awake: frozenset[str],
) -> Iterator[Phase]:
    """Yield the soft phases: insert, search if it did not go in, press."""
    config = station.config.insertion
    # C: the compliance centre, with the axes of the part.
    X_PC = RigidTransform(station.part(mating.part).X_AP.inverse() @ mating.p_AoC)
    X_JawC, X_WSeat = X_JawP @ X_PC, X_WGoal @ X_PC
    arm = station.holder.name
    guard = FirstOf((lost_grasp(station), TooMuchForce(arm, TOO_MUCH, "insertion force")))
    # It slides on whatever it touches there, not only on what it comes to.
    others = {mating.on, *station.fixed} - {mating.part}
    pairs = frozenset(frozenset([mating.part, other]) for other in others)

    def soft(
        kind: MatePhase, force: float, target: Target, until: Condition, timeout: float
    ) -> Phase:
        return Phase(
            kind,
            until,
            timeout=timeout,
            subject=mating.part,
            commands={arm: impedance(config, jaw, X_JawC, target, force)},
            guard=guard,
            awake=awake,
            mating=pairs,
            fine_log=True,
            tare=kind is MatePhase.INSERT,
        )

    height = Height(jaw, X_JawC)

    def gap(outcome: Outcome) -> float:
        return float(height(outcome.sensed)[0] - X_WSeat.translation()[2])

    start = mating.depth + NEAR
    descending = descent(X_WSeat, start, config, height)
    outcome = yield soft(MatePhase.INSERT, config.force_limit, *descending)
    if mating.depth > 0.0 and gap(outcome) > mating.depth / 2:
        mouth = gap(outcome)
        pitch, speed = config.search_pitch, config.search_speed
        search = Spiral(raised(X_WSeat, mouth - BEYOND), pitch, speed)
        around = 1e3 * config.search_radius
        stuck = f"{mating.part} does not slide onto {mating.on}, tried up to {around:g} mm aside"
        found = Below(height, float(X_WSeat.translation()[2]) + mouth - 1e-3, stuck)
        length = config.search_radius**2 * np.pi / config.search_pitch
        yield soft(
            MatePhase.SEARCH, config.search_force, search, found, length / config.search_speed
        )
        again = descent(X_WSeat, mouth - 1e-3, config, height)
        outcome = yield soft(MatePhase.INSERT_AGAIN, config.force_limit, *again)
    # Where the part has found its place: a spring that still pulls sideways would wedge it there.
    X_WC = RigidTransform(X_WSeat.rotation(), (outcome.sensed.X_WF(jaw) @ X_JawC).translation())
    yield soft(MatePhase.PRESS, config.force_limit, *pressing(X_WC, height))


def impedance(
    config: InsertionConfig, jaw: Frame, X_JawC: RigidTransform, target: Target, force: float
) -> Impedance:
    """Return the impedance about the hole, with a limited downward force."""
    turn, side = config.rotational_stiffness, config.lateral_stiffness
    return Impedance(
        jaw,
        X_JawC,
        target,
        stiffness=np.array([turn, turn, YAW_STIFFNESS, side, side, side]),
        limit=np.array([TORQUE_LIMIT] * 3 + [LATERAL_LIMIT, LATERAL_LIMIT, force]),
    )


def descent(
    X_WSeat: RigidTransform,
    start: float,
    config: InsertionConfig,
    height: Height,
) -> tuple[Target, Condition, float]:
    """Return target, end condition and time-out of a descent from ``start`` above the seat [m].

    The target slows down around the seat, where metal meets metal, and then builds up the force.
    Only what stands still under the whole force has come to its end: a part that leans on an edge
    stands still before.
    """
    heights = [start, LANDING, -LANDING, -BEYOND]
    speeds = [config.speed, config.landing_speed, config.speed]
    times = np.cumsum([0.0, *(-np.diff(heights) / speeds)])
    stands = All((Steady(height, STALLED, STALL_TIME), after(float(times[-1]) + STALL_TIME)))
    target = Descent(X_WSeat, times, np.array(heights))
    return target, stands, float(times[-1]) + PATIENCE


def pressing(X_WC: RigidTransform, height: Height) -> tuple[Target, Condition, float]:
    """Return target, end condition and time-out of a push straight down from where the part is."""
    return There(raised(X_WC, -BEYOND)), Steady(height, STALLED, STALL_TIME), PATIENCE
