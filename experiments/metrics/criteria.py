"""When an operation counts as a success: every limit in one table, with its reason."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from planning.operations.sequence import Operation


@dataclass(frozen=True)
class Limit:
    """A bound on one measured quantity.

    Attributes:
        kind: Kind of the operation.
        quantity: Its name.
        limit: Largest magnitude that passes, in the unit of the quantity.
        reason: Why this much.
        each: Whether it holds for every one of the operation's "parts" or of the "riders" on them;
            "": it holds once.
    """

    kind: str
    quantity: str
    limit: float
    reason: str
    each: str = ""


@dataclass(frozen=True)
class FailedCheck:
    """A quantity outside of its limit, or that could not be measured (value None)."""

    quantity: str
    value: float | None
    limit: float
    reason: str


STILL = "the jig is the fixture of every later step, and the plan knows where it holds the part"
IN_HOLE = "3 mm of shank are in the hole at least: what is below it, such as the bed, may lift it"
CAPTIVE = "0.2 mm of play and as much again where a leaning shank crosses the hole's edge"
LEANING = np.deg2rad(5.0)
LOOSE = "its play in the hole allows 4.6 degrees: 0.4 mm over 5 mm"
LIMITS = (
    Limit("pick_place", "position_error_m", 3e-3, "later grasps are planned around the place"),
    Limit("pick_place", "angle_error_rad", np.deg2rad(3.0), "later grasps are planned around it"),
    Limit("pick_place", "upright_tilt_rad", np.deg2rad(5.0), "the wrist still reaches the shaft"),
    Limit("pick_place", "jam_kick_m", 3e-4, "freezing must not move what was placed"),
    Limit("pick_place", "jam_kick_m_per_s", 0.02, "freezing must not kick"),
    Limit("pick_place", "release_kick_m", 3e-4, "the frozen bed carries the weight"),
    Limit("pick_place", "release_kick_m_per_s", 0.02, "opening the hand must not kick"),
    Limit("pick_place", "speed_after_1_s_m_per_s", 1e-3, "a part that creeps is not fixed"),
    Limit("place_loose_bolts", "proud_m", 7e-3, IN_HOLE, each="parts"),
    Limit("place_loose_bolts", "off_hole_m", 5e-4, CAPTIVE, each="parts"),
    Limit("place_loose_bolts", "lean_rad", LEANING, LOOSE, each="parts"),
    Limit("place_loose_bolts", "base_moved_since_placed_m", 1e-3, STILL),
    Limit("place_loose_bolts", "base_moved_since_placed_rad", np.deg2rad(2.0), STILL),
    Limit("set_aside", "return_error_m", 3e-3, "it is taken from there again"),
    Limit("set_aside", "return_angle_rad", np.deg2rad(3.0), "it is taken from there again"),
    Limit("set_aside", "speed_at_rest_m_per_s", 1e-3, "a part that creeps does not stand"),
    Limit("set_aside", "proud_m", 5e-4, "it hangs by its head", each="riders"),
    Limit("set_aside", "off_hole_m", 5e-4, CAPTIVE, each="riders"),
    Limit("set_aside", "lean_rad", LEANING, LOOSE, each="riders"),
    Limit("insert_shaft", "gap_m", 2e-4, "a tightened bolt closes it without bending the plate"),
    Limit("insert_shaft", "tilt_rad", np.deg2rad(1.0), "0.5 mm at the bolt circle: bolts stand"),
    Limit("insert_shaft", "insertion_force_peak_N", 30.0, "less than what pushes parts off jigs"),
    Limit("insert_shaft", "base_moved_since_placed_m", 1e-3, STILL),
    Limit("insert_shaft", "base_moved_since_placed_rad", np.deg2rad(2.0), STILL),
    Limit("insert_shaft", "standing_axial_m", 1e-3, "the bit finds the socket", each="riders"),
    Limit("insert_shaft", "standing_lateral_m", 1e-3, "the bit finds the socket", each="riders"),
    Limit("insert_shaft", "standing_tilt_rad", LEANING, "the thread catches", each="riders"),
    Limit("place_bolts", "standing_axial_m", 1e-3, "the bit finds the socket", each="parts"),
    Limit("place_bolts", "standing_lateral_m", 1e-3, "the bit finds the socket", each="parts"),
    Limit("place_bolts", "standing_tilt_rad", np.deg2rad(5.0), "the thread catches", each="parts"),
    Limit("place_bolts", "base_moved_since_placed_m", 1e-3, STILL),
    Limit("place_bolts", "base_moved_since_placed_rad", np.deg2rad(2.0), STILL),
    Limit("tighten_bolts", "torque_deviation", 0.10, "what clutch drivers repeat", each="parts"),
    Limit("tighten_bolts", "advance_deviation", 0.02, "the bolt follows its helix", each="parts"),
    Limit(
        "tighten_bolts", "clamp_deviation", 0.15, "against T / (K d); K scatters so", each="parts"
    ),
    Limit(
        "tighten_bolts", "clamp_deviation_at_end", 0.15, "later bolts relax earlier ones", "parts"
    ),
    Limit("tighten_bolts", "base_moved_since_placed_m", 1e-3, STILL),
    Limit("tighten_bolts", "base_moved_since_placed_rad", np.deg2rad(2.0), STILL),
)


def failed_checks(operation: Operation, measured: Mapping[str, float]) -> tuple[FailedCheck, ...]:
    """Return every limit of an operation that its measured quantities do not keep."""
    failed = []
    for limit in LIMITS:
        for name in _names(limit, operation):
            value = measured.get(name)
            if value is None or not abs(value) <= limit.limit:
                failed.append(FailedCheck(name, value, limit.limit, limit.reason))
    return tuple(failed)


def _names(limit: Limit, operation: Operation) -> Iterator[str]:
    if limit.kind != operation.kind:
        return
    if limit.each:
        parts: tuple[str, ...] = getattr(operation, limit.each)
        yield from [f"{part}/{limit.quantity}" for part in parts]
    else:
        yield limit.quantity
