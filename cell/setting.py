"""A setting: one field of the configuration, with its valid range, unit, meaning and source.

Declared once, as the default of a dataclass field. The loader checks values against it; the
commented YAML file and the table in the documentation are written from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from cell.errors import InputError


class BadSetting(InputError):
    """A configuration value that is of the wrong type or out of range."""


@dataclass(frozen=True)
class Setting:
    """What is known about a field.

    Attributes:
        default: Of the declaration; its type is that of the setting. A tuple also has the right
            length, but for the empty one, which stands for any length.
        unit: Of the value and its range; "" for a pure number, a switch or a name.
        meaning: What the value is, in one line.
        source: Where the default comes from: a tag ([S] the paper, [R] read in the source named,
            [M] measured, [D] derived, [A] assumption), then from what or why; also the range that
            is plausible, where that is narrower than the valid one.
        above, at_least: Lower end of the range of a number, or of every number of a list.
        below, at_most: Upper end of it; `math.inf` admits infinity.
        choices: The valid names of a text setting; none: any text.
    """

    default: Any
    unit: str
    meaning: str
    source: str
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    choices: tuple[str, ...] = ()

    @property
    def numeric(self) -> bool:
        """Whether it is a number or a list of numbers, and has a range."""
        return not isinstance(self.default, bool | str)

    def range_text(self) -> str:
        """Return what is valid, as in "> 0 and <= 0.005" or "lagged, similar, sap"."""
        if isinstance(self.default, bool):
            return "true, false"
        bounds = (
            (">", self.above), (">=", self.at_least), ("<", self.below), ("<=", self.at_most),
        )  # fmt: skip
        limits = [f"{sign} {bound:g}" for sign, bound in bounds if bound is not None]
        return " and ".join(limits) or ", ".join(self.choices)

    def holds(self, number: float) -> bool:
        """Return whether a number is inside the range."""
        return (
            (self.above is None or number > self.above)
            and (self.at_least is None or number >= self.at_least)
            and (self.below is None or number < self.below)
            and (self.at_most is None or number <= self.at_most)
        )

    def nearest(self, number: float) -> float:
        """Return the valid number that is nearest to one."""
        lower = self.at_least if self.above is None else math.nextafter(self.above, math.inf)
        upper = self.at_most if self.below is None else math.nextafter(self.below, -math.inf)
        number = number if lower is None else max(number, lower)
        return number if upper is None else min(number, upper)


def setting(
    default: Any,
    unit: str,
    meaning: str,
    source: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    choices: tuple[str, ...] = (),
) -> Any:
    """Declare a field of a configuration dataclass; see `Setting` for the arguments."""
    info = Setting(default, unit, meaning, source, above, at_least, below, at_most, choices)
    return field(default=default, metadata={"setting": info})


def converted(path: str, value: Any, info: Setting) -> Any:
    """Return a value from YAML or the command line as the type of the setting, or refuse it.

    Args:
        path: Dotted path of the setting, for the message.
        value: What was given.
        info: Type, range and choices.

    Raises:
        BadSetting: In one line, with what is valid.
    """
    if isinstance(info.default, tuple):
        return _numbers(path, value, info)
    if isinstance(info.default, bool):
        if not isinstance(value, bool):
            raise BadSetting(f"'{path}' must be true or false, not {value!r}.")
        return value
    if isinstance(info.default, str):
        if not isinstance(value, str) or (info.choices and value not in info.choices):
            one_of = f"one of {info.range_text()}" if info.choices else "text"
            raise BadSetting(f"'{path}' must be {one_of}, not {value!r}.")
        return value
    return _number(path, value, info, whole=isinstance(info.default, int))


def _numbers(path: str, value: Any, info: Setting) -> tuple[float, ...]:
    length = len(info.default)
    if not isinstance(value, list | tuple) or (length and len(value) != length):
        what = "a list of numbers"
        if length:
            example = ", ".join(f"{item:g}" for item in info.default)
            what = f"a list of {length} numbers, for example [{example}]"
        raise BadSetting(f"'{path}' must be {what}, not {value!r}.")
    return tuple(_number(f"{path}[{i}]", item, info, whole=False) for i, item in enumerate(value))


def _number(path: str, value: Any, info: Setting, whole: bool) -> float | int:
    """Return a checked number; YAML leaves "1e-3" (no dot) as text, so text may be one."""
    valid = f"{info.range_text()} {info.unit}".rstrip()
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if math.isnan(number) or (whole and math.isfinite(number) and not number.is_integer()):
        what = "a whole number" if whole else "a number"
        raise BadSetting(f"'{path}' must be {what} {valid}, not {value!r}.")
    if not info.holds(number):
        raise BadSetting(f"'{path}' must be {valid}, not {number:g}.")
    return int(number) if whole else number
