"""Walking and changing a configuration: a tree of frozen dataclasses, mappings and settings."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

from cell.configuration.frozen_dict import FrozenDict
from cell.errors import UnknownName
from cell.setting import BadSetting, Setting, converted


@dataclass(frozen=True)
class Entry:
    """A setting in a configuration.

    Attributes:
        path: Dotted, as on the command line.
        value: Its value there.
        info: Its declaration.
    """

    path: str
    value: Any
    info: Setting


def is_section(value: Any) -> bool:
    """Return whether a value of the tree has keys of its own."""
    return is_dataclass(value) or isinstance(value, Mapping)


def children(section: Any) -> dict[str, Any]:
    """Return what is in a section, by key."""
    if isinstance(section, Mapping):
        return dict(section)
    return {info.name: getattr(section, info.name) for info in fields(section)}


def setting_of(section: Any, key: str) -> Setting:
    """Return the declaration of a field of a section.

    Raises:
        TypeError: It has none: a mistake in the code.
    """
    metadata = {info.name: info.metadata for info in fields(section)}[key]
    if "setting" not in metadata:
        raise TypeError(f"{type(section).__name__}.{key} is not declared with `setting`.")
    return metadata["setting"]


def entries(section: Any, path: str = "") -> Iterator[Entry]:
    """Yield every setting of a section and of those in it, in the order of declaration."""
    for key, value in children(section).items():
        full = f"{path}.{key}" if path else key
        if is_section(value):
            yield from entries(value, full)
        else:
            yield Entry(full, value, setting_of(section, key))


def changed[Section](section: Section, changes: Any, path: str = "") -> Section:
    """Return a section with changes applied and checked.

    Args:
        section: What to change.
        changes: Key -> value or nested changes; None changes nothing.
        path: Dotted path of the section, for messages.

    Raises:
        UnknownName: A key that does not exist, with those that do.
        BadSetting: A value that is impossible.
    """
    if changes is None:
        return section
    known = children(section)
    if not isinstance(changes, Mapping):
        raise BadSetting(f"'{path}' is a section; it holds {', '.join(known)}.")
    values = {}
    for key, value in changes.items():
        full = f"{path}.{key}" if path else str(key)
        if key not in known:
            raise _unknown(section, path, full, value)
        if is_section(known[key]):
            values[key] = changed(known[key], value, full)
        else:
            values[key] = converted(full, value, setting_of(section, key))
    if isinstance(section, Mapping):
        return FrozenDict({**section, **values})  # type: ignore[return-value]
    return replace(section, **values)  # type: ignore[type-var]


def _unknown(section: Any, path: str, name: str, value: Any) -> UnknownName:
    """Return the error for an unknown key: it lists its neighbours and what is alike deeper down.

    Args:
        section: Where the key was looked for.
        path: Of the section.
        name: Path of the key.
        value: What was given for it; of nested changes the first is named.
    """
    while isinstance(value, Mapping) and value:
        key, value = next(iter(value.items()))
        name = f"{name}.{key}"
    prefix = f"{path}." if path else ""
    keys = [prefix + key for key in children(section)]
    leaves = {entry.path: entry.path.rpartition(".")[2] for entry in entries(section, path)}
    alike = difflib.get_close_matches(name.rpartition(".")[2], leaves.values(), n=1, cutoff=0.8)
    keys += [leaf for leaf, last in leaves.items() if last in alike and leaf not in keys]
    return UnknownName("configuration key", name, keys)
