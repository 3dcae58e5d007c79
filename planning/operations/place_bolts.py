"""Operation place_bolts: bolts from the tray into their holes.

The left hand sets each bolt upright into its hole, where it stands on the mouth of the thread.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydrake.math import RigidTransform

from cell.phase import Phase, after, motion_finished
from planning.operations.grasping import (
    Reach,
    let_go,
    lost_grasp,
    no_grasp,
    reachable_grasps,
    take,
)
from planning.operations.insert_shaft import raised
from planning.operations.station import FINE_CLEARANCE, Station

LIFT = 0.06
ABOVE = 0.012  # A bolt hovers this far above where it will stand: its tip is over the hole [m] [A].
ENTRY = 0.006  # From here on the shank can touch the clamped part [m] [D].
TOUCH_FORCE = 1.5  # The bolt stands when it pushes back this hard [N] [A].
SLOW = 0.02  # [m/s] [A]
RETREAT = 0.05


def place_bolt(station: Station, bolt: str) -> Iterator[Phase]:
    """Yield the phases that stand a bolt in its hole.

    Args:
        station: The planner's view of the cell.
        bolt: Name of a fastener of the product.
    """
    yield Phase(f"{bolt}: look", after(0.05), 1.0, awake=frozenset([bolt]))
    reach = _grasp_for_hole(station, bolt)
    yield from take(station, bolt, reach, LIFT)
    jaw = station.arm("left").frame(reach.grasp.jaw)
    X_JawP = station.pose("left", reach.grasp.jaw).inverse() @ station.sense(bolt)
    X_WStand = standing_pose(station, bolt)
    holding, held = lost_grasp(station.held_opening), frozenset([bolt])
    above = raised(X_WStand, ABOVE) @ X_JawP.inverse()
    may_touch = [("held", "*")]
    q_above = station.configuration(
        "left", jaw, above, reach.q_before, may_touch, clearance=FINE_CLEARANCE
    )
    yield Phase(
        f"{bolt}: transfer",
        motion_finished,
        timeout=20.0,
        left=station.move("left", q_above, may_touch, clearance=FINE_CLEARANCE),
        guard=holding,
        awake=held,
    )
    X_JawP = station.pose("left", reach.grasp.jaw).inverse() @ station.sense(bolt)
    yield Phase(
        f"{bolt}: align",
        motion_finished,
        timeout=5.0,
        left=station.line("left", jaw, raised(X_WStand, ENTRY) @ X_JawP.inverse(), speed=SLOW),
        guard=holding,
        awake=held,
    )
    awake = held | _assembled(station, bolt)
    yield Phase(
        f"{bolt}: lower",
        lambda sensed: sensed.finished or sensed.wrench["left"][5] > TOUCH_FORCE,
        timeout=10.0,
        left=station.line("left", jaw, raised(X_WStand, -2e-4) @ X_JawP.inverse(), speed=SLOW),
        guard=holding,
        awake=awake,
    )
    yield from let_go(station, bolt, reach.grasp, RETREAT, awake)


def standing_pose(station: Station, bolt: str) -> RigidTransform:
    """Return X_WP of a bolt that stands on the mouth of its thread, from the sensed parts."""
    fastener = station.cell.product.fasteners[bolt]
    into = station.part(fastener.into)
    X_WA = station.sense(fastener.into) @ into.X_AP.inverse()
    out = RigidTransform([0.0, 0.0, fastener.thread_depth])
    return X_WA @ station.part(bolt).X_AP @ out


def _assembled(station: Station, bolt: str) -> frozenset[str]:
    """Return the parts that a bolt at its hole can touch."""
    fastener = station.cell.product.fasteners[bolt]
    return frozenset([fastener.into, fastener.clamps])


def _grasp_for_hole(station: Station, bolt: str) -> Reach:
    """Return a grasp with which the hand also fits between the neighbours of the hole."""
    X_WStand = standing_pose(station, bolt)
    part = station.part(bolt)
    may_touch = [("left_tool", bolt), ("held", "*")]
    for reach in reachable_grasps(station, bolt, station.sense(bolt), part.grasps):
        jaw = station.arm("left").frame(reach.grasp.jaw)
        X_WJaw = X_WStand @ reach.grasp.X_PJaw
        fits = station.configurations(
            "left", jaw, X_WJaw, reach.q_before, may_touch, clearance=FINE_CLEARANCE
        )
        if fits and np.max(np.abs(fits[0] - reach.q_before)) < np.pi:
            return reach
    raise no_grasp(station, bolt)
