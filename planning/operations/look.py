"""Looking: the phase in which everything stands still, at whose end the belief is refreshed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import Enum

from cell.simulation.phase import Event, Guard, Phase, after
from planning.operations.station import Station


def look(
    station: Station,
    kind: Enum,
    subject: str,
    parts: Sequence[str] = (),
    *,
    settle: float = 0.0,
    start: tuple[Event, ...] = (),
    awake: frozenset[str] = frozenset(),
    guard: Guard | None = None,
    riding: frozenset[str] = frozenset(),
) -> Iterator[Phase]:
    """Yield the phase of a look, and refresh the belief at its end.

    A source that sees at once takes no time: without ``settle`` there is no phase then.

    Args:
        station: The planner's view of the cell.
        kind: Which look it is.
        subject: Name of the part that it is about.
        parts: Names of what is looked at; empty for all parts.
        settle: How long everything stands still at least [s].
        start: Events at the start.
        awake: Names of the parts that are awake.
        guard: As of a phase.
        riding: As of a phase.
    """
    duration = max(settle, station.source.duration)
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
    station.look(*parts)
