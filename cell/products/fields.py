"""Typed access to mappings read from YAML; every error states where in the file it is."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from cell.errors import InputError, UnknownName

LARGEST = 1e9
"""[A] Size of a number in a product file, whatever its unit: squares and cubes stay finite."""

SMALLEST = 1e-9
"""[A] A number above zero is at least that large, whatever its unit."""


class Fields:
    """A mapping all of whose keys are known.

    Args:
        data: What the YAML file holds at this place.
        where: The place, for messages, for example "motor_unit.yaml: parts.motor".
        known: Every key that may occur.

    Raises:
        InputError: `data` is not a mapping.
        UnknownName: It holds a key that is not known.
    """

    def __init__(self, data: Any, where: str, known: Collection[str]) -> None:
        self.where = where
        self._data = mapping_at(data, where)
        for key in self._data:
            if key not in known:
                raise UnknownName(f"key in {where} called", key, known)

    def __contains__(self, key: str) -> bool:
        return key in self._data

    def at(self, key: str) -> str:
        """Return the place of a key, for messages."""
        return f"{self.where}{'.' if ':' in self.where else ': '}{key}"

    def raw(self, key: str) -> Any:
        """Return a required value, whatever its type."""
        if key not in self._data:
            raise InputError(f"{self.where}: '{key}' is missing.")
        return self._data[key]

    def text(self, key: str, default: str | None = None) -> str:
        """Return a string; required unless there is a default."""
        if default is not None and key not in self._data:
            return default
        value = self.raw(key)
        if not isinstance(value, str) or not value.strip():
            raise InputError(f"{self.at(key)}: expected text, got {value!r}.")
        return value

    def positive(self, key: str) -> float:
        """Return a required number above zero."""
        value = _number(self.raw(key), self.at(key))
        if not value >= SMALLEST:
            at_least = "above zero" if value <= 0.0 else f"of at least {SMALLEST:g}"
            raise InputError(f"{self.at(key)}: expected a number {at_least}, got {value:g}.")
        return value

    def vector(self, key: str) -> np.ndarray:
        """Return a required vector (3,)."""
        value, where = self.raw(key), self.at(key)
        if not isinstance(value, list) or len(value) != 3:
            raise InputError(f"{where}: expected three numbers, got {value!r}.")
        return np.array([_number(v, where) for v in value])

    def direction(self, key: str) -> np.ndarray:
        """Return a required vector (3,), normalised."""
        vector = self.vector(key)
        length = float(np.linalg.norm(vector))
        if length < SMALLEST:
            raise InputError(f"{self.at(key)}: the zero vector has no direction.")
        return vector / length

    def mapping(self, key: str) -> Mapping[str, Any]:
        """Return an optional mapping, empty if absent."""
        return mapping_at(self._data.get(key, {}), self.at(key))

    def entries(self, key: str) -> list[tuple[Any, str]]:
        """Return the entries of an optional list, each with its place; empty if absent."""
        value, where = self._data.get(key, []), self.at(key)
        if not isinstance(value, list):
            raise InputError(f"{where}: expected a list, got {value!r}.")
        return [(entry, f"{where}[{k}]") for k, entry in enumerate(value)]


def mapping_at(value: Any, where: str) -> Mapping[str, Any]:
    """Return a value that is a mapping with text for keys, or raise `InputError`."""
    if not isinstance(value, Mapping):
        raise InputError(f"{where}: expected keys with values, got {value!r}.")
    for key in value:
        if not isinstance(key, str):
            raise InputError(f"{where}: the key {key!r} is not a name; put it in quotes.")
        if not key.strip():
            raise InputError(f"{where}: a name is empty.")
    return value


def names_at(value: Any, where: str) -> tuple[str, ...]:
    """Return a list of strings as a tuple, or raise `InputError`."""
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise InputError(f"{where}: expected a list of names, got {value!r}.")
    return tuple(value)


def one_of(kind: str, name: str, known: Collection[str]) -> str:
    """Return the name if it is known, or raise `UnknownName`."""
    if name not in known:
        raise UnknownName(kind, name, known)
    return name


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or value != value:
        raise InputError(f"{where}: expected a number, got {value!r}.")
    if abs(value) > LARGEST:
        raise InputError(
            f"{where}: expected a number of at most {LARGEST:g} in size, got {value!r}."
        )
    return float(value)
