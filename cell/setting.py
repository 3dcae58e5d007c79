"""A setting: one field of the configuration, with its unit, meaning, source and valid range.

Declared once, as the default of a dataclass field; the loader checks values against it and the
commented YAML file is written from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from cell.errors import CellError


class BadSetting(CellError):
    """A configuration value that is of the wrong type or out of range."""


@dataclass(frozen=True)
class Setting:
    """What is known about a field besides its type and default.

    Attributes:
        unit: Of the value and its range; "" for a pure number, a switch or a name.
        meaning: One line, with the source tag of the default.
        above, at_least, at_most: Range of a number, or of every number of a list; None is open.
        choices: The valid names of a text setting.
    """

    unit: str
    meaning: str
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    choices: tuple[str, ...] = ()

    def range_text(self) -> str:
        """Return the range as in "> 0 and <= 0.005 s"."""
        bounds = ((">", self.above), (">=", self.at_least), ("<=", self.at_most))
        text = " and ".join(f"{sign} {bound:g}" for sign, bound in bounds if bound is not None)
        return f"{text} {self.unit}".strip()

    def holds(self, number: float) -> bool:
        """Return whether a number is inside the range."""
        return (
            (self.above is None or number > self.above)
            and (self.at_least is None or number >= self.at_least)
            and (self.at_most is None or number <= self.at_most)
        )


def setting(
    default: Any,
    unit: str,
    meaning: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    choices: tuple[str, ...] = (),
) -> Any:
    """Declare a field of a configuration dataclass; see `Setting` for the arguments."""
    info = Setting(unit, meaning, above, at_least, at_most, choices)
    return field(default=default, metadata={"setting": info})


def converted(path: str, value: Any, default: Any, info: Setting) -> Any:
    """Return a value from YAML or the command line as the type of the default, or refuse it.

    Args:
        path: Dotted path of the setting, for the message.
        value: What was given.
        default: The default, which has the right type; a tuple also has the right length.
        info: Range and choices.
    """
    if isinstance(default, tuple):
        return _converted_list(path, value, default, info)
    if isinstance(default, bool):
        return _switch(path, value)
    if isinstance(default, str):
        return _text(path, value, info)
    return _number(path, value, default, info)


def _converted_list(path: str, value: Any, default: tuple, info: Setting) -> tuple:
    if not isinstance(value, list | tuple) or len(value) != len(default):
        example = ", ".join(f"{item:g}" for item in default)
        raise BadSetting(
            f"'{path}' must be a list of {len(default)} numbers, for example [{example}], "
            f"not {value!r}."
        )
    return tuple(
        _number(f"{path}[{i}]", item, old, info)
        for i, (item, old) in enumerate(zip(value, default, strict=True))
    )


def _switch(path: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise BadSetting(f"'{path}' must be true or false, not {value!r}.")
    return value


def _text(path: str, value: Any, info: Setting) -> str:
    if not isinstance(value, str) or (info.choices and value not in info.choices):
        one_of = f"one of {', '.join(info.choices)}" if info.choices else "text"
        raise BadSetting(f"'{path}' must be {one_of}, not {value!r}.")
    return value


def _number(path: str, value: Any, default: float | int, info: Setting) -> float | int:
    number = _parsed(value, default)
    if number is None:
        what = "a whole number" if isinstance(default, int) else "a number"
        raise BadSetting(
            f"'{path}' must be {what} {info.range_text()}".rstrip() + f", not {value}."
        )
    if not info.holds(number):
        raise BadSetting(f"'{path}' must be {info.range_text()}, not {number:g}.")
    return number


def _parsed(value: Any, default: float | int) -> float | int | None:
    """Read a number of the default's type; YAML leaves "1e-3" (no dot) as text.

    Returns:
        None where there is none: no text for a number, not finite (unless the default is not),
        or broken where a whole number is due.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = float(value)
    except ValueError:
        return None
    if math.isnan(number) or (math.isinf(number) and not math.isinf(default)):
        return None
    if isinstance(default, int):
        return int(number) if number.is_integer() else None
    return number
