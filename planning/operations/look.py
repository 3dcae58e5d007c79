"""Looking: the phases in which everything stands still, at whose end the belief is refreshed.

A source that is carried by the hand, such as a camera, goes round what a look is about first: the
hand stops on a few sides of it. What it does not see then fails the look: nothing else takes its
place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import Enum

import numpy as np

from cell.simulation.phase import Event, Guard, Phase, PhaseFailed, after
from cell.simulation.vocabulary import in_programs
from planning.motion.paths import NoPath
from planning.motion.timing import JointMotion
from planning.operations.station import Station
from planning.operations.waiting import at_rest
from planning.perception.belief import CarriedSource
from planning.perception.viewpoints import sector

SIDES = np.deg2rad([0.0, 120.0, 240.0])  # From which a camera looks [rad].
FEWEST_SIDES = 2  # With fewer a round part may slide along the line of sight [A].
TRIED = 3  # Configurations of a side to which a path is searched, the nearest first [A].


@in_programs
class ViewPhase(Enum):
    """Stops of the hand with a camera."""

    VIEW_1 = "view 1"
    VIEW_2 = "view 2"
    VIEW_3 = "view 3"
    VIEW_4 = "view 4"
    VIEW_5 = "view 5"
    VIEW_6 = "view 6"


def look(
    station: Station,
    kind: Enum,
    subject: str,
    parts: Sequence[str] = (),
    *,
    closely: Sequence[str] = (),
    settle: float = 0.0,
    start: tuple[Event, ...] = (),
    awake: frozenset[str] = frozenset(),
    guard: Guard | None = None,
    riding: frozenset[str] = frozenset(),
) -> Iterator[Phase]:
    """Yield the phases of a look, and refresh the belief at its end.

    A source that sees at once takes no time: without ``settle`` there is no phase then.

    Args:
        station: The planner's view of the cell.
        kind: Which look it is.
        subject: Name of the part that it is about.
        parts: Names of what is looked at; empty for all parts.
        closely: Names of what the next phases rely on: a carried source goes to see these, with an
            empty hand, and these alone.
        settle: How long everything stands still at least [s].
        start: Events at the start.
        awake: Names of the parts that are awake.
        guard: As of a phase.
        riding: As of a phase.

    Raises:
        PhaseFailed: A carried source does not see what it has gone to see.
    """
    source = station.source
    duration = max(settle, source.duration)
    if duration > 0.0 or start:
        yield Phase(
            kind,
            after(duration),
            timeout=duration + 1.0,
            subject=subject,
            guard=guard,
            start=start,
            awake=awake,
            riding=riding,
        )
    if not closely or not isinstance(source, CarriedSource):
        station.look(*parts)
        return
    yield from _go_round(station, source, f"{subject}, {kind.value}", closely)
    unseen = set(closely) - station.look(*closely)
    if unseen:
        evidence = f"the camera does not see {', '.join(sorted(unseen))} where it should be"
        raise PhaseFailed(f"{subject}: {kind.value}", evidence)


def _go_round(
    station: Station, source: CarriedSource, subject: str, parts: Sequence[str]
) -> Iterator[Phase]:
    """Yield the phases that carry a source round parts; it takes in what it sees on every side."""
    kinds, arm = iter(ViewPhase), station.holder
    for p_WTarget in source.targets(parts, station.belief.now):
        sides = 0
        for azimuth in SIDES:
            motion = _motion_to_side(station, source, p_WTarget, float(azimuth))
            if motion is None:
                continue
            sides += 1
            yield Phase(
                next(kinds),
                at_rest(arm.name),
                timeout=20.0,
                subject=subject,
                commands={arm.name: motion},
            )
            source.take()
        if sides < FEWEST_SIDES:
            place = ", ".join(f"{value:.3f}" for value in p_WTarget)
            evidence = f"the camera reaches {sides} of {len(SIDES)} sides of ({place}) m"
            raise PhaseFailed(f"{subject}: look", evidence)


def _motion_to_side(
    station: Station, source: CarriedSource, p_WTarget: np.ndarray, azimuth: float
) -> JointMotion | None:
    """Return the motion to the nearest place from which a point is seen from about one side.

    Args:
        station: The planner's view of the cell.
        source: That is carried.
        p_WTarget: (3,) [m].
        azimuth: Of the side [rad].
    """
    arm = station.holder
    near = arm.positions(station.context)
    for group in sector(p_WTarget, azimuth):
        found = [
            q for X_WC in group for q in station.configurations(arm, source.frame, X_WC, near)[:1]
        ]
        for q in sorted(found, key=lambda q: float(np.max(np.abs(q - near))))[:TRIED]:
            try:
                return station.move(arm, q)
            except NoPath:
                continue
    return None
