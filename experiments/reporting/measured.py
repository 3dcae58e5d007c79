"""What was measured, for people: per step the value, its limit and the margin that is left."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from experiments.reporting.html_page import table, words
from experiments.reporting.quantities import NO_BREAK, shown_as
from planning.operations.limits import Limit

Limits = Mapping[str, Limit]  # Measured name -> what bounds it.
CHECKS = ("quantity", "value", "limit", "margin", "why this limit")


def measured_tables(name: str, measured: Mapping[str, float], limits: Limits) -> str:
    """Return the HTML of one step: what is bounded in a table, the rest folded away.

    Args:
        name: Of the step.
        measured: Quantity -> value; SI units are in the names.
        limits: Of these quantities, by the same names.
    """
    checks = table(_checks(measured, limits), CHECKS)
    others = _others({key: value for key, value in measured.items() if key not in limits})
    if others and checks:
        others = f"<details><summary>Other quantities</summary>{others}</details>"
    return f"<h3>{escape(name)}</h3>\n{checks}{others}" if checks or others else ""


def _checks(measured: Mapping[str, float], limits: Limits) -> list[dict[str, Any]]:
    """Return one row per limit; of several parts, the one with the least margin."""
    by_quantity: dict[str, list[str]] = {}
    for key in limits:
        by_quantity.setdefault(key.rpartition("/")[2], []).append(key)
    rows = []
    for quantity, keys in by_quantity.items():
        # What could not be measured is worst.
        worst = max(keys, key=lambda key: abs(measured.get(key, float("inf"))))
        limit, value, shown = limits[worst], measured.get(worst), shown_as(quantity)
        label = shown.label
        if len(keys) > 1:
            label += f", worst of {len(keys)} ({worst.rpartition('/')[0]})"
        row = {"quantity": label, "value": shown.text(value), "limit": shown.text(limit.limit)}
        row["margin"] = "" if value is None else _margin(abs(value), limit.limit)
        rows.append(row | {"why this limit": limit.reason})
    return rows


def _margin(value: float, limit: float) -> str:
    """Return what is left up to the limit, as a share of it; negative beyond it."""
    share = 1.0 - value / limit
    return (">99.9" if share > 0.999 else f"{100.0 * share:.3g}") + f"{NO_BREAK}%"


def _others(measured: Mapping[str, Any]) -> str:
    """Return quantities without a limit: one row each, with a column per part where there are."""
    parts = list(dict.fromkeys(key.rpartition("/")[0] for key in measured))
    columns = {part: part or "value" for part in parts}
    rows: dict[str, dict[str, Any]] = {}
    for key, value in measured.items():
        part, _, quantity = key.rpartition("/")
        number = isinstance(value, int | float) and not isinstance(value, bool)
        shown = shown_as(quantity)
        row = rows.setdefault(quantity, {"quantity": shown.label if number else words(quantity)})
        row[columns[part]] = shown.text(value) if number else value
    return table(list(rows.values()), ("quantity", *columns.values()))
