"""When a step counts as a success: limits on what is measured, each with its reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Limit:
    """A bound on one measured quantity.

    Attributes:
        quantity: Its name.
        limit: Largest magnitude that passes, in the unit of the quantity.
        reason: Why this much.
        each: Whether it holds for every one of the step's "parts" or of the "riders" on them;
            "": it holds once.
        optional: Whether it holds only if the quantity was measured: not every fixture has it.
    """

    quantity: str
    limit: float
    reason: str
    each: str = ""
    optional: bool = False

    def names(self, parts: Mapping[str, Sequence[str]]) -> list[str]:
        """Return the measured names that it bounds, given a step's "parts" and "riders"."""
        if not self.each:
            return [self.quantity]
        return [f"{part}/{self.quantity}" for part in parts[self.each]]


@dataclass(frozen=True)
class FailedCheck:
    """A quantity outside of its limit, or that could not be measured (value None)."""

    quantity: str
    value: float | None
    limit: float
    reason: str


STILL = "the jig is the fixture of every later step, and the plan knows where it holds the part"
CAPTIVE = "0.2 mm of play and as much again where a leaning shank crosses the hole's edge"
LEANING = np.deg2rad(5.0)
LOOSE = "its play in the hole allows 4.6 degrees: 0.4 mm over 5 mm"
# Of every operation on what the fixture holds.
BASE_STAYS = (
    Limit("base_moved_since_placed_m", 1e-3, STILL),
    Limit("base_moved_since_placed_rad", np.deg2rad(2.0), STILL),
)


def standing_limits(each: str) -> tuple[Limit, ...]:
    """Return the limits of bolts that stand on their threads, "parts" or "riders" of the step."""
    return (
        Limit("standing_axial_m", 1e-3, "the bit finds the socket", each),
        Limit("standing_lateral_m", 1e-3, "the bit finds the socket", each),
        Limit("standing_tilt_rad", LEANING, "the thread catches", each),
    )


def failed_checks(
    limits: Mapping[str, Limit], measured: Mapping[str, float]
) -> tuple[FailedCheck, ...]:
    """Return every limit that the measured quantities of a step do not keep.

    Args:
        limits: Of the step, by the names of what they bound.
        measured: Quantity -> value.
    """
    failed = []
    for name, limit in limits.items():
        value = measured.get(name)
        if value is None and limit.optional:
            continue
        if value is None or not abs(value) <= limit.limit:
            failed.append(FailedCheck(name, value, limit.limit, limit.reason))
    return tuple(failed)
