"""Showing what is in the hand to a camera that stands still, before it matters how it lies there.

A part may turn in the grip as it is lifted, and how it was gripped is no better known than where
it stood. The arm brings it to where most of it is in sight past the hand, and stops there; what is
seen then replaces what the kinematics of the hand say.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum

import numpy as np

from cell.simulation.phase import Event, Guard, Phase, PhaseFailed
from cell.simulation.vocabulary import in_programs
from planning.motion.paths import NoPath
from planning.motion.timing import JointMotion
from planning.operations.station import Station
from planning.operations.waiting import at_rest
from planning.perception.belief import WatchingSource

LEAST = 0.1  # Share of a part's surface in sight, below which it is not worth going there [A].
AS_GOOD = 0.7  # Of the largest share in sight: among such stops the nearest is tried first [A].
TRIED = 8  # Stops to which a way is searched [A].


@in_programs
class PresentPhase(Enum):
    """The stop in front of a camera."""

    SHOW = "show"


def present(
    station: Station,
    part: str,
    *,
    guard: Guard,
    awake: frozenset[str],
    riding: frozenset[str] = frozenset(),
    start: tuple[Event, ...] = (),
) -> Iterator[Phase]:
    """Yield the phases that show the part in the hand, and refresh the belief about it.

    With a source that has no eye for it there are none. Where nothing shows enough of the part, it
    stays as the hand has it, and `Station.recoveries` says so.

    Args:
        station: The planner's view of the cell.
        part: Name of the part in the hand.
        guard: As of a phase.
        awake: As of a phase.
        riding: As of a phase.
        start: Events at the start of the motion.

    Raises:
        PhaseFailed: The part is not where the hand should have it, though it would be in sight.
    """
    source, arm = station.source, station.holder
    if not isinstance(source, WatchingSource):
        return
    motion = _motion_to_stop(station, source, part)
    if motion is None:
        said = f"{part}: no way to show it to the camera: it is taken to lie as it was gripped."
        station.recoveries += (said,)
        return
    yield Phase(
        PresentPhase.SHOW,
        at_rest(arm.name),
        timeout=20.0,
        subject=part,
        commands={arm.name: motion},
        guard=guard,
        start=start,
        awake=awake,
        riding=riding,
    )
    X_HW = station.tool_pose(arm, "tip").inverse()
    source.watch(part, X_HW @ station.pose_of(part))
    if part not in station.look(*station.in_hand):
        evidence = f"the camera does not see {part} where the hand should have it"
        raise PhaseFailed(f"{part}: {PresentPhase.SHOW.value}", evidence)


def _motion_to_stop(station: Station, source: WatchingSource, part: str) -> JointMotion | None:
    """Return the motion to the nearest stop that shows about as much of the part as any does."""
    arm = station.holder
    near, frame = arm.positions(station.context), arm.frame("tip")
    X_HP = station.tool_pose(arm, "tip").inverse() @ station.pose_of(part)
    found = [
        (source.visible(part, X_HP, q), float(np.max(np.abs(q - near))), X_WH)
        for X_WH in source.stops(part, X_HP)
        for q in arm.configurations(station.context, frame, X_WH, near)[:1]
    ]
    found = [stop for stop in found if stop[0] >= LEAST]
    most = max((share for share, _, _ in found), default=0.0)
    found.sort(key=lambda stop: (stop[0] < AS_GOOD * most, stop[1]))
    for _, _, X_WH in found[:TRIED]:
        for q in station.configurations(arm, frame, X_WH, near)[:1]:
            try:
                return station.move(arm, q)
            except NoPath:
                continue
    return None
