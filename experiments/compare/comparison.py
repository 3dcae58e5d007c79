"""Values of two results side by side, each with its tolerance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rich.markup import escape
from rich.table import Table

from experiments.compare.tolerances import EXACT, SUMMARY, Tolerance, tolerance_of


@dataclass(frozen=True)
class Mean:
    """A mean or a rate over trials.

    Attributes:
        value: The mean.
        half: Half of its 95 % interval.
    """

    value: float
    half: float


Value = float | str | Mean
Values = Mapping[str, Mapping[str, Value]]
"""Place (a step, a case, a trial) -> quantity -> value; what was not finite is left out."""

EVERYTHING = "everything"
"""The quantity of a place that only one of two results has."""


@dataclass(frozen=True)
class Comparison:
    """One value in both results; None where it is missing."""

    place: str
    quantity: str
    before: Value | None
    after: Value | None
    tolerance: Tolerance

    @property
    def allowed(self) -> float:
        """How far the numbers may be apart; of means, with what chance does to them."""
        if not isinstance(self.before, Mean | float) or not isinstance(self.after, Mean | float):
            return 0.0
        chance = math.hypot(*(v.half for v in (self.before, self.after) if isinstance(v, Mean)))
        return max(self.tolerance.allowed(number(self.before)), chance)

    @property
    def ok(self) -> bool:
        """Whether the value is in both and within its tolerance."""
        if isinstance(self.before, Mean | float) and isinstance(self.after, Mean | float):
            return abs(number(self.after) - number(self.before)) <= self.allowed
        return self.before == self.after

    @property
    def reason(self) -> str:
        """For the tolerance."""
        of_trials = isinstance(self.before, Mean) or isinstance(self.after, Mean)
        return f"{self.tolerance.reason}; {SUMMARY}" if of_trials else self.tolerance.reason


def number(value: Mean | float) -> float:
    """Return a number, or that of a mean."""
    return value.value if isinstance(value, Mean) else value


def plain(value: Value | None) -> float | str | None:
    """Return a value as it is written to files."""
    return value.value if isinstance(value, Mean) else value


def compared(before: Values, after: Values) -> list[Comparison]:
    """Return every value of two results, in the order of the second, then what only the first has.

    Args:
        before: The former result.
        after: The present one.
    """
    rows = []
    for place in dict.fromkeys([*after, *before]):
        if place not in before or place not in after:
            old, new = (f"{len(v[place])} values" if place in v else None for v in (before, after))
            rows.append(Comparison(place, EVERYTHING, old, new, EXACT))
            continue
        for name in dict.fromkeys([*after[place], *before[place]]):
            old, new = before[place].get(name), after[place].get(name)
            text = isinstance(old, str) or isinstance(new, str)
            rows.append(Comparison(place, name, old, new, EXACT if text else tolerance_of(name)))
    return rows


def value_table(rows: Sequence[Comparison], title: str, names: tuple[str, str], word: str) -> Table:
    """Return one line per value; a word marks those outside their tolerance.

    Args:
        rows: To show.
        title: Of the table.
        names: Of the former and the present result.
        word: For what is outside.
    """
    table = Table(title=title, title_justify="left")
    for heading in ("where", "quantity", *names, "allowed", ""):
        table.add_column(heading, justify="left" if heading in ("where", "quantity") else "right")
    for row in rows:
        values = (shown(row.before), shown(row.after))
        mark = "" if row.ok else word
        table.add_row(
            escape(row.place),
            escape(row.quantity),
            *map(escape, values),
            f"{row.allowed:.2g}",
            mark,
        )
    return table


def shown(value: Value | None) -> str:
    """Return a value for a person."""
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{number(value):.4g}"


def tolerance_table(rows: Sequence[Comparison]) -> Table:
    """Return the tolerances of some values, each once, with their reasons."""
    table = Table("quantity", "tolerance", "reason", title="Tolerances", title_justify="left")
    for tolerance in dict.fromkeys(row.tolerance for row in rows):
        reasons = {row.reason for row in rows if row.tolerance == tolerance}
        name = tolerance.quantity or "text, counts, missing"
        table.add_row(name, str(tolerance), max(reasons, key=len))
    return table


def rows_to_json(rows: Sequence[Comparison], names: tuple[str, str]) -> list[dict[str, object]]:
    """Return rows as plain values; ``names`` are those of the former and the present value."""
    return [
        {
            "where": row.place,
            "quantity": row.quantity,
            names[0]: plain(row.before),
            names[1]: plain(row.after),
            "allowed": row.allowed,
            "ok": row.ok,
            "reason": row.reason,
        }
        for row in rows
    ]
