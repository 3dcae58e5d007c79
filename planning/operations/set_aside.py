"""Operation set_aside: what stands on the jig goes back to where its lowest part was taken from.

Bolts that lie loose in its holes ride along: nothing holds them but the holes and their heads. The
place in the tray is open below, so that their shanks hang free there.
"""

from __future__ import annotations

from collections.abc import Iterator

from pydrake.math import RigidTransform

from cell.simulation.events import release_from_jig, soften_jig
from cell.simulation.phase import Phase, Sensed, after, motion_finished
from planning.operations.grasping import (
    HAND_SPEED,
    Reach,
    first,
    let_go,
    lift,
    lost_grasp,
    reachable_grasps,
    seize,
)
from planning.operations.insert_shaft import comes_from_above, raised
from planning.operations.station import Station

LIFT = 0.12
ABOVE = 0.045  # Transfers end this far above the place [m] [A].
LANDING = 0.003  # Slow from this far above the place on [m] [A].
SLOW = 0.01  # [m/s] [A]
BELOW = 0.001  # The hand sinks at most this far below where the part stood before [m] [A].
TOUCH_FORCE = 3.0  # The part stands when it pushes back this hard [N] [A].
RETREAT = 0.08
VENTED = 2e3  # The bag is soft below this confining pressure [Pa]: 2 % of the vacuum [A].
SETTLE_TIME = 0.3


def set_aside(station: Station, part: str, riders: tuple[str, ...] = ()) -> Iterator[Phase]:
    """Yield the phases that take a part off the jig and put it back into the tray.

    Args:
        station: The planner's view of the cell; it knows where the part was taken from.
        part: Name of the part that the jig holds.
        riders: Names of the parts that lie loose on it.
    """
    X_WGoal, awake = station.origins[part], frozenset([part, *riders])
    reach = first(_useful(station, part, X_WGoal), part, station)
    yield from seize(station, part, reach, riders)
    holding = lost_grasp(station.held_opening)
    # Air first: pulled out of the frozen bed, the part would take its suction along.
    yield Phase(
        f"{part}: vent",
        lambda sensed: station.cell.soft_jig.pressure < VENTED,
        timeout=5.0,
        guard=holding,
        start=(soften_jig(part),),
        awake=awake,
    )
    yield from lift(station, part, reach, LIFT)
    jaw = station.arm("left").frame(reach.grasp.jaw)
    X_JawP = station.pose("left", reach.grasp.jaw).inverse() @ station.sense(part)
    above = raised(X_WGoal, ABOVE) @ X_JawP.inverse()
    yield Phase(
        f"{part}: transfer",
        motion_finished,
        timeout=20.0,
        left=station.move("left", station.configuration("left", jaw, above, reach.q_before)),
        guard=holding,
        start=(release_from_jig(part),),
        awake=awake,
    )
    # Once more with the part over its place: it may have turned in the grip on the way.
    X_JawP = station.pose("left", reach.grasp.jaw).inverse() @ station.sense(part)
    yield Phase(
        f"{part}: align",
        motion_finished,
        timeout=10.0,
        left=station.line(
            "left", jaw, raised(X_WGoal, LANDING) @ X_JawP.inverse(), speed=HAND_SPEED / 2
        ),
        guard=holding,
        awake=awake,
    )
    yield Phase(
        f"{part}: set down",
        lambda sensed: sensed.finished or touches(sensed),
        timeout=5.0,
        left=station.line("left", jaw, raised(X_WGoal, -BELOW) @ X_JawP.inverse(), speed=SLOW),
        guard=holding,
        awake=awake,
    )
    yield from let_go(station, part, reach.grasp, RETREAT, awake)
    yield Phase(f"{part}: settle", after(SETTLE_TIME), timeout=1.0, awake=awake)


def touches(sensed: Sensed) -> bool:
    """Return whether what is in the hand stands on something."""
    return bool(sensed.wrench["left"][5] > TOUCH_FORCE)


def _useful(station: Station, part: str, X_WGoal: RigidTransform) -> Iterator[Reach]:
    """Yield grasps of the part on the jig with which the hand also reaches its place.

    There, as at every grasp, the fingers are not checked: they are opened for another part by now.
    """
    grasps = station.part(part).grasps
    for reach in reachable_grasps(station, part, station.sense(part), grasps):
        jaw, near = station.arm("left").frame(reach.grasp.jaw), reach.q_before
        X_WAbove, X_WAt = (raised(X_WGoal, height) @ reach.grasp.X_PJaw for height in (ABOVE, 0.0))
        if (
            comes_from_above(X_WGoal, reach.grasp.X_PJaw)
            and station.configurations("left", jaw, X_WAbove, near, [("left_tool", part)])
            and station.configurations("left", jaw, X_WAt, near, [("left_tool", "*")])
        ):
            yield reach
