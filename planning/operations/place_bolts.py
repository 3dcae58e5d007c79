"""Operation place_bolts: bolts from the tray into their holes.

The left hand sets each bolt upright into its hole, where it stands on the mouth of the thread. If
the part with the thread is not there yet, the bolt hangs by its head, or stands on the bed below.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydrake.math import RigidTransform

from cell.simulation.phase import Phase, after, motion_finished
from planning.operations.grasping import (
    HAND_SPEED,
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
CLEAR_ABOVE = 0.045  # Transfers end this far above where the bolt will stand [m] [A].
ABOVE = 0.012  # The bolt is measured once more this far above, its tip over the hole [m] [A].
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
    # Heights are those of a bolt that stands on the mouth of its thread.
    X_WMouth, X_WStand = mouth_pose(station, bolt), standing_pose(station, bolt)
    holding, held = lost_grasp(station.held_opening), frozenset([bolt])

    def at(X_WP: RigidTransform) -> RigidTransform:
        X_JawP = station.pose("left", reach.grasp.jaw).inverse() @ station.sense(bolt)
        return X_WP @ X_JawP.inverse()

    above = station.configuration(
        "left", jaw, at(raised(X_WMouth, CLEAR_ABOVE)), reach.q_before, [("left_tool", bolt)]
    )
    yield Phase(
        f"{bolt}: transfer",
        motion_finished,
        timeout=20.0,
        left=station.move("left", above),
        guard=holding,
        awake=held,
    )
    for name, height, speed in (("come down", ABOVE, HAND_SPEED), ("align", ENTRY, SLOW)):
        yield Phase(
            f"{bolt}: {name}",
            motion_finished,
            timeout=5.0,
            left=station.line("left", jaw, at(raised(X_WMouth, height)), speed=speed),
            guard=holding,
            awake=held,
        )
    awake = held | _assembled(station, bolt)
    yield Phase(
        f"{bolt}: lower",
        lambda sensed: sensed.finished or sensed.wrench["left"][5] > TOUCH_FORCE,
        timeout=10.0,
        left=station.line("left", jaw, at(raised(X_WStand, -2e-4)), speed=SLOW),
        guard=holding,
        awake=awake,
    )
    yield from let_go(station, bolt, reach.grasp, RETREAT, awake)


def seated_pose(station: Station, bolt: str) -> RigidTransform:
    """Return X_WP of a bolt whose head rests on what it clamps, from the sensed parts.

    It is derived from the part that carries the thread, once that is on the jig.
    """
    fastener = station.cell.product.fasteners[bolt]
    name = fastener.into if fastener.into in station.fixed else fastener.clamps
    X_WA = station.sense(name) @ station.part(name).X_AP.inverse()
    return X_WA @ station.part(bolt).X_AP


def mouth_pose(station: Station, bolt: str) -> RigidTransform:
    """Return X_WP of a bolt that stands on the mouth of its thread, be it there or not."""
    out = RigidTransform([0.0, 0.0, station.cell.product.fasteners[bolt].thread_depth])
    return seated_pose(station, bolt) @ out


def standing_pose(station: Station, bolt: str) -> RigidTransform:
    """Return X_WP at which a bolt will stand: on its thread, or by its head where there is none.

    Something else below the hole, such as the bed, may stop a bolt without a thread before.
    """
    if station.cell.product.fasteners[bolt].into in station.fixed:
        return mouth_pose(station, bolt)
    return seated_pose(station, bolt)


def _assembled(station: Station, bolt: str) -> frozenset[str]:
    """Return the parts on the jig that a bolt at its hole can touch."""
    fastener = station.cell.product.fasteners[bolt]
    return frozenset([fastener.into, fastener.clamps]) & frozenset(station.fixed)


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
