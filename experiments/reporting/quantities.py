"""Measured quantities as a person reads them: mm, degrees, N, N m and per cent."""

from __future__ import annotations

import math
from dataclasses import dataclass

NO_BREAK = "\N{NO-BREAK SPACE}"
# Ending of a quantity's name -> unit to show, and what to multiply by; the longest counts.
UNITS: dict[str, tuple[str, float]] = {
    "_m": ("mm", 1e3),
    "_m_per_s": ("mm/s", 1e3),
    "_rad": ("°", 180.0 / math.pi),
    "_N": ("N", 1.0),
    "_N_m": (f"N{NO_BREAK}m", 1.0),
    "_kPa": ("kPa", 1.0),
    "_s": ("s", 1.0),
    "_deviation": ("%", 100.0),
    "_deviation_at_end": ("%", 100.0),
    "_share": ("%", 100.0),
}
KEPT = ("_deviation", "_deviation_at_end", "_share")  # Endings that say what it is, too.
SMALLEST = 1e-3  # In the unit shown; what is smaller is noise of the solver.


@dataclass(frozen=True)
class Shown:
    """How a quantity is shown.

    Attributes:
        label: In words.
        unit: For example "mm"; "" for a number without one.
        factor: From the unit of the measured value to that.
    """

    label: str
    unit: str
    factor: float

    def text(self, value: float | None) -> str:
        """Return a measured value with its unit, three digits of it."""
        if value is None:
            return "not measured"
        shown = value * self.factor
        number = f"<{NO_BREAK}{SMALLEST:g}" if 0.0 < abs(shown) < SMALLEST else f"{shown:.3g}"
        if abs(shown) >= 1e3:
            number = f"{shown:.0f}"
        # Without a line break between number and unit.
        return f"{number}{'' if self.unit == '°' else NO_BREAK}{self.unit}".rstrip()


def shown_as(quantity: str) -> Shown:
    """Return how a quantity is shown, by the unit in its name; one of a part without the part."""
    name = quantity.rpartition("/")[2]
    endings = [ending for ending in UNITS if name.endswith(ending)]
    if not endings:
        return Shown(name.replace("_", " "), "", 1.0)
    ending = max(endings, key=len)
    unit, factor = UNITS[ending]
    kept = name if ending in KEPT else name.removesuffix(ending)
    return Shown(kept.replace("_", " ").strip(), unit, factor)
