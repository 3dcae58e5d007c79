"""What a program of phases may consist of: values that can be written down and read back exactly.

A program is a run as data. Its conditions, guards, commands and events are instances of classes
that are registered here by their names, with fields of numbers, texts, arrays, poses, frames and
each other; so are kinds of phases, and events that are plain functions. Numbers keep every bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame

from cell.errors import InputError, UnknownName

WORDS: dict[str, Any] = {}  # Classes, kinds of phases and events by their names.


class NotInWords(InputError):
    """A value that programs have no word for."""


def in_programs[Word: Callable](word: Word) -> Word:
    """Register a dataclass, an enumeration or an event: as a decorator."""
    name = word.__name__
    if WORDS.setdefault(name, word) is not word:
        raise InputError(f"Programs have a word '{name}' already.")
    return word


def to_data(value: Any) -> Any:
    """Return a value as what JSON can hold.

    Raises:
        NotInWords: Something in it is not registered, such as a function made on the spot.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return float(value) if isinstance(value, np.floating) else value
    if isinstance(value, np.ndarray):
        return {"array": value.tolist()}
    if isinstance(value, RigidTransform):
        return {"pose": value.GetAsMatrix34().tolist()}
    if isinstance(value, Frame):
        return {"frame": value.scoped_name().to_string()}
    if isinstance(value, tuple | list):
        return [to_data(item) for item in value]
    kind = value if callable(value) and not is_dataclass(value) else type(value)
    name = getattr(kind, "__name__", str(kind))
    if WORDS.get(name) is not kind:
        raise NotInWords(f"programs have no word for '{getattr(kind, '__qualname__', name)}'")
    if isinstance(value, Enum):
        return {"is": name, "member": value.name}
    if not is_dataclass(value):
        return {"is": name}
    own = [field.name for field in fields(value) if field.init and not field.name.startswith("_")]
    return {"is": name, **{field: to_data(getattr(value, field)) for field in own}}


def from_data(data: Any, plant: MultibodyPlant) -> Any:
    """Undo `to_data`.

    Args:
        data: As `to_data` returned it, or as it was read from JSON.
        plant: Whose frames are meant.

    Raises:
        InputError: It is no such data.
    """
    if isinstance(data, list):
        return tuple(from_data(item, plant) for item in data)
    if not isinstance(data, Mapping):
        return data
    try:
        if "is" in data:
            return _word_from(data, plant)
        if "array" in data:
            return np.array(data["array"], dtype=float)
        if "pose" in data:
            return RigidTransform(np.array(data["pose"], dtype=float))
        model, _, name = str(data["frame"]).rpartition("::")
        return plant.GetFrameByName(name, plant.GetModelInstanceByName(model))
    except (RuntimeError, TypeError, ValueError, KeyError) as error:
        raise InputError(f"This is no part of a program: {str(data)[:80]}.") from error


def _word_from(data: Mapping[str, Any], plant: MultibodyPlant) -> Any:
    name = str(data["is"])
    if name not in WORDS:
        raise UnknownName("word of a program", name, WORDS)
    word = WORDS[name]
    if isinstance(word, type) and issubclass(word, Enum):
        return word[data["member"]]
    if not isinstance(word, type):
        return word
    return word(**{key: from_data(value, plant) for key, value in data.items() if key != "is"})
