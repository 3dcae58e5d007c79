"""Operation pick_place: a part from the tray onto the soft jig, pressed in and frozen there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydrake.math import RigidTransform

from cell.fixtures.soft_jig import JigState
from cell.products.product import Grasp
from cell.simulation.events import evacuate_jig, inflate_jig, soften_jig
from cell.simulation.phase import Condition, Phase, Sensed, after, motion_finished
from planning.motion.kinematics import Unreachable
from planning.operations.grasping import (
    Reach,
    let_go,
    lost_grasp,
    no_grasp,
    reachable_grasps,
    take,
)
from planning.operations.placement import (
    HOVER,
    RETREAT,
    Placement,
    Suits,
    anywhere,
    choose_placement,
)
from planning.operations.station import Station

LIFT = 0.12  # Out of the tray, over its neighbours [m] [A].
PRESS_SPEED = 0.01  # [m/s] [A]; the bed has no rate effect at 10 to 80 mm/s [M].
# Pressing fails if the bed has not resisted this far below its apex [m] [A]: the plate's foot is
# 15 mm deep before its face comes to lie on the bed.
DEEPEST = 0.03
HOVER_TIME, STOP_TIME = 0.1, 0.2  # [s] [A]
JAM_TIME = 1.5  # [s] [D] a pump of 30 L/min is at 90 kPa after 0.5 to 1.5 s.
SETTLE_TIME = 1.0


def pick_place(
    station: Station,
    part: str,
    up: str,
    later: tuple[str, ...] = (),
    suits: Suits = anywhere,
) -> Iterator[Phase]:
    """Yield the phases that fix a part on the jig.

    Args:
        station: The planner's view of the cell.
        part: Name of the part.
        up: Axis of the product frame that shall point up.
        later: Names of the parts that will be mated with it: its yaw must suit them.
        suits: Whether its pose on the jig suits whatever else comes later.
    """
    yield Phase(f"{part}: look", after(0.2), 1.0, start=(inflate_jig,), awake=frozenset([part]))
    station.origins[part] = station.sense(part)
    reach, placement = _choose(station, part, up, later, suits)
    yield from take(station, part, reach, LIFT)
    awake, holding = frozenset([part]), lost_grasp(station.held_opening)
    frame = station.arm("left").frame(reach.grasp.jaw)
    # The pose in the hand is measured, not assumed: the part may have slipped in the grip.
    X_JawP = station.pose("left", reach.grasp.jaw).inverse() @ station.sense(part)
    X_WJaw = placement.X_WP @ X_JawP.inverse()
    q_hover = station.configuration("left", frame, X_WJaw, placement.q, [("held", "jig_base")])
    yield Phase(
        f"{part}: transfer",
        motion_finished,
        timeout=20.0,
        left=station.move("left", q_hover, [("held", "jig_base")]),
        guard=holding,
        awake=awake,
    )
    # The wrist is tared at rest: the braking arm feels 2 N of its own [M].
    yield Phase(f"{part}: hover", after(HOVER_TIME), 1.0, guard=holding, awake=awake)
    down = HOVER + DEEPEST
    deep = RigidTransform(X_WJaw.rotation(), X_WJaw.translation() - [0.0, 0.0, down])
    yield Phase(
        f"{part}: press",
        pressed(station.config.placement.press_force),
        timeout=1.0 + down / PRESS_SPEED,
        left=station.line("left", frame, deep, speed=PRESS_SPEED),
        guard=holding,
        start=(soften_jig(part),),
        awake=awake,
    )
    # The hand comes to rest first: what moves then is not moved by the freezing.
    yield Phase(f"{part}: stop", after(STOP_TIME), 1.0, guard=holding, awake=awake, tare=False)
    yield Phase(
        f"{part}: jam",
        jammed(station, JAM_TIME),
        timeout=5.0,
        guard=holding,
        start=(evacuate_jig,),
        awake=awake,
    )
    yield from let_go(station, part, reach.grasp, RETREAT, awake)
    yield Phase(f"{part}: settle", after(SETTLE_TIME), timeout=2.0, awake=awake)


def _choose(
    station: Station, part: str, up: str, later: tuple[str, ...], suits: Suits
) -> tuple[Reach, Placement]:
    """Return the first grasp with a placement, grasps from above first."""
    failure = None
    for reach in _top_first(station, part, station.sense(part)):
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


def pressed(force: float) -> Condition:
    """End condition: the bed pushes the hand up with this force [N]."""
    return lambda sensed: sensed.wrench["left"][5] >= force


def jammed(station: Station, least: float) -> Condition:
    """End condition: the jig is frozen and the pump has run for ``least`` [s].

    With no vacuum at all there is nothing to freeze.
    """
    jig = station.cell.soft_jig

    def condition(sensed: Sensed) -> bool:
        frozen = jig.state is JigState.JAMMED or jig.params.vacuum.pressure == 0
        return sensed.time >= least and frozen

    return condition
