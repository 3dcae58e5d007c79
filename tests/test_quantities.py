"""Quantities as people read them, and the margin that is left to a limit."""

from __future__ import annotations

import math
import re

import pytest

from experiments.reporting.measured import measured_tables
from experiments.reporting.quantities import shown_as
from planning.operations.limits import Limit
from planning.operations.registry import OPERATIONS

GAP = Limit("gap_m", 2e-4, "a bolt closes it")
TILT = Limit("standing_tilt_rad", math.radians(5.0), "the thread catches", each="parts")


@pytest.mark.parametrize(
    ("quantity", "value", "label", "text"),
    [
        ("gap_m", 1.234e-4, "gap", "0.123 mm"),
        ("bolt_1/standing_tilt_rad", math.radians(1.5), "standing tilt", "1.5°"),
        ("jam_kick_m_per_s", 0.0028, "jam kick", "2.8 mm/s"),
        ("torque_at_trip_N_m", 0.5063, "torque at trip", "0.506 N m"),
        ("clamp_at_end_N", 1234.5, "clamp at end", "1234 N"),
        ("clamp_deviation_at_end", -0.0546, "clamp deviation at end", "-5.46 %"),
        ("jig_torque_share", 0.1377, "jig torque share", "13.8 %"),
        ("gap_m", 5.9e-7, "gap", "< 0.001 mm"),
        ("gap_m", 0.0, "gap", "0 mm"),
        ("turns", 10.04, "turns", "10"),
        ("gap_m", None, "gap", "not measured"),
    ],
)
def test_unit_follows_from_the_name(
    quantity: str, value: float | None, label: str, text: str
) -> None:
    shown = shown_as(quantity)
    assert shown.label == label
    assert shown.text(value).replace("\N{NO-BREAK SPACE}", " ") == text


def text_of(html: str) -> list[str]:
    """Return the cells of a table, in order."""
    return [
        re.sub("<.*?>", "", cell).replace("\N{NO-BREAK SPACE}", " ")
        for cell in re.findall(r"<td.*?>(.*?)</td>", html)
    ]


def test_value_limit_and_margin_stand_side_by_side() -> None:
    cells = text_of(measured_tables("insert", {"gap_m": -5e-5}, {"gap_m": GAP}))
    assert cells == ["gap", "-0.05 mm", "0.2 mm", "75 %", "a bolt closes it"]


def test_margin_beyond_a_limit_is_negative_and_none_where_nothing_was_measured() -> None:
    assert text_of(measured_tables("s", {"gap_m": 3e-4}, {"gap_m": GAP}))[3] == "-50 %"
    assert text_of(measured_tables("s", {}, {"gap_m": GAP}))[1:4] == ["not measured", "0.2 mm", ""]


def test_of_several_bolts_the_worst_is_shown_and_named() -> None:
    measured = {"bolt_1/standing_tilt_rad": 0.01, "bolt_2/standing_tilt_rad": -0.02}
    limits = dict.fromkeys(measured, TILT)
    cells = text_of(measured_tables("place", measured, limits))
    assert cells[0] == "standing tilt, worst of 2 (bolt_2)"
    missing = text_of(measured_tables("place", {"bolt_1/standing_tilt_rad": 0.01}, limits))
    assert missing[:2] == ["standing tilt, worst of 2 (bolt_2)", "not measured"]


def test_what_has_no_limit_is_folded_away_with_a_column_per_part() -> None:
    measured = {"gap_m": 1e-4, "bolt_1/turns": 10.0, "bolt_2/turns": 9.0}
    html = measured_tables("tighten", measured, {"gap_m": GAP})
    assert "<details>" in html
    assert text_of(html.partition("<details>")[2]) == ["turns", "10", "9"]


def test_every_limited_quantity_has_a_unit() -> None:
    """So that no bare number stands in the table of any operation."""
    for operation in OPERATIONS.values():
        for limit in operation.limits:
            assert shown_as(limit.quantity).unit, limit.quantity
