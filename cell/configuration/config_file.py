"""Reading configuration files and overrides, and applying them to a tree of dataclasses."""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import Field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import yaml

from cell.errors import UnknownName
from cell.paths import MODELS
from cell.setting import BadSetting, Setting, converted

CONFIG_FOLDER = MODELS / "config"
Section = TypeVar("Section")


def read_config_file(name_or_path: str | Path) -> dict[str, Any]:
    """Return the content of a configuration file as nested dictionaries.

    Args:
        name_or_path: A name in ``models/config``, or the path of a YAML file.
    """
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        path = CONFIG_FOLDER / f"{name_or_path}.yaml"
    if not path.is_file():
        known = [file.stem for file in CONFIG_FOLDER.glob("*.yaml")]
        raise UnknownName("configuration (name or .yaml file)", str(name_or_path), known)
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        reason = " ".join(str(error).split())
        raise BadSetting(f"Configuration '{path}' is not YAML: {reason}.") from error
    if not isinstance(content, dict | None):
        raise BadSetting(f"Configuration '{path}' must hold sections such as 'simulation:'.")
    return content or {}


def parse_overrides(overrides: Mapping[str, Any] | Sequence[str]) -> dict[str, Any]:
    """Return overrides as nested dictionaries; of two for the same path the later one counts.

    Args:
        overrides: Dotted path -> value, or "path=value" texts with the value in YAML.
    """
    nested: dict[str, Any] = {}
    pairs = overrides.items() if isinstance(overrides, Mapping) else map(_split, overrides)
    for path, value in pairs:
        *parents, leaf = path.split(".")
        node = nested
        for parent in parents:
            node = node.setdefault(parent, {})
            if not isinstance(node, dict):
                raise BadSetting(f"'{path}': '{parent}' is not a section.")
        node[leaf] = value
    return nested


def _split(text: str) -> tuple[str, Any]:
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise BadSetting(f"An override is written key=value, not '{text}'.")
    try:
        return path.strip(), yaml.safe_load(value)
    except yaml.YAMLError as error:
        raise BadSetting(f"'{path}': cannot read the value '{value}'.") from error


def changed(section: Section, changes: Any, path: str = "") -> Section:
    """Return a section (a tree of frozen dataclasses) with changes applied and checked.

    Args:
        section: What to change.
        changes: Key -> value or nested changes; None changes nothing.
        path: Dotted path of the section, for messages.
    """
    if changes is None:
        return section
    infos = {info.name: info for info in fields(section)}  # type: ignore[arg-type]
    if not isinstance(changes, dict):
        raise BadSetting(f"'{path}' is a section; it holds {', '.join(infos)}.")
    values = {}
    for key, value in changes.items():
        full = f"{path}.{key}" if path else str(key)
        if key not in infos:
            unknown = _first_leaf(full, value)
            raise UnknownName("configuration key", unknown, _known(section, path, unknown))
        old = getattr(section, key)
        if is_dataclass(old):
            values[key] = changed(old, value, full)
        else:
            values[key] = converted(full, value, old, setting_of(section, infos[key]))
    return replace(section, **values)  # type: ignore[type-var]


def setting_of(section: Any, info: Field) -> Setting:
    """Return what is known about a field.

    For a field that is no `setting` the meaning is read from the class docstring, and a number
    keeps the sign of its default: all of them are physical quantities with one meaningful sign. A
    field whose metadata say "positive" must not be zero.
    """
    if "setting" in info.metadata:
        return info.metadata["setting"]
    text = inspect.cleandoc(type(section).__doc__ or "")
    entry = re.search(rf"^    {info.name}: (.+(?:\n {{8}}.+)*)", text, re.MULTILINE)
    meaning = " ".join(entry[1].split()) if entry else ""
    default = getattr(type(section)(), info.name)
    if isinstance(default, bool) or not isinstance(default, int | float):
        return Setting(unit="", meaning=meaning)
    if default < 0:
        return Setting(unit="", meaning=meaning, at_most=0.0)
    if info.metadata.get("positive"):
        return Setting(unit="", meaning=meaning, above=0.0)
    return Setting(unit="", meaning=meaning, at_least=0.0)


def _first_leaf(path: str, value: Any) -> str:
    while isinstance(value, dict) and value:
        key, value = next(iter(value.items()))
        path = f"{path}.{key}"
    return path


def _known(section: Any, path: str, name: str) -> list[str]:
    """Keys beside an unknown one; and, for a wrong section, keys deeper down that look alike."""
    prefix = f"{path}." if path else ""
    keys = [prefix + info.name for info in fields(section)]
    leaves = {leaf: leaf.rpartition(".")[2] for leaf in _leaves(section, prefix)}
    alike = difflib.get_close_matches(name.rpartition(".")[2], leaves.values(), n=1, cutoff=0.8)
    return [*keys, *(leaf for leaf, last in leaves.items() if last in alike and leaf not in keys)]


def _leaves(section: Any, prefix: str) -> list[str]:
    paths = []
    for info in fields(section):
        value = getattr(section, info.name)
        path = prefix + info.name
        paths += _leaves(value, f"{path}.") if is_dataclass(value) else [path]
    return paths
