"""Reading mappings from YAML: every key is known, every value has its type, errors say where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cell.errors import CellError, UnknownName


class Fields:
    """A mapping whose keys are all known, with typed access.

    Args:
        data: What the YAML file holds at this place.
        where: The place, for messages, for example "motor_unit.yaml: parts.motor".
        known: Every key that may occur.
    """

    def __init__(self, data: Any, where: str, known: Sequence[str]) -> None:
        self.where = where
        self._data = _mapping(data, where)
        for key in self._data:
            if key not in known:
                raise UnknownName(f"key in {where} called", str(key), known)

    def __contains__(self, key: str) -> bool:
        return key in self._data

    def raw(self, key: str) -> Any:
        """Return the value of a required key."""
        if key not in self._data:
            raise CellError(f"{self.where}: '{key}' is missing.")
        return self._data[key]

    def text(self, key: str) -> str:
        """Return a required string."""
        value = self.raw(key)
        if not isinstance(value, str):
            raise CellError(f"{self.where}.{key}: expected text, got {value!r}.")
        return value

    def positive(self, key: str) -> float:
        """Return a required number above zero."""
        value = _number(self.raw(key), f"{self.where}.{key}")
        if not value > 0.0:
            raise CellError(f"{self.where}.{key}: expected a number above zero, got {value:g}.")
        return value

    def vector(self, key: str) -> np.ndarray:
        """Return a required (3,) vector."""
        value, where = self.raw(key), f"{self.where}.{key}"
        if not isinstance(value, list) or len(value) != 3:
            raise CellError(f"{where}: expected three numbers, got {value!r}.")
        return np.array([_number(v, where) for v in value])

    def mapping(self, key: str) -> Mapping[str, Any]:
        """Return an optional mapping, empty if absent."""
        return _mapping(self._data.get(key, {}), f"{self.where}.{key}")

    def names(self, key: str) -> tuple[str, ...]:
        """Return a required list of strings."""
        return names_at(self.raw(key), f"{self.where}.{key}")


def names_at(value: Any, where: str) -> tuple[str, ...]:
    """Return a list of strings as a tuple."""
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise CellError(f"{where}: expected a list of names, got {value!r}.")
    return tuple(value)


def one_of(kind: str, name: str, known: Sequence[str]) -> str:
    """Return the name if it is known."""
    if name not in known:
        raise UnknownName(kind, name, known)
    return name


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise CellError(f"{where}: expected keys with values, got {value!r}.")
    for key in value:
        if not isinstance(key, str):
            raise CellError(f"{where}: the key {key!r} is not a name; put it in quotes.")
    return value


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise CellError(f"{where}: expected a number, got {value!r}.")
    return float(value)
