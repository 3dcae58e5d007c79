"""Reading configuration files and overrides into nested dictionaries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cell.errors import InputError, UnknownName
from cell.paths import MODELS, is_file
from cell.setting import BadSetting
from cell.yaml_text import parse_yaml, read_yaml

CONFIG_FOLDER = MODELS / "config"


def read_config_file(name_or_path: str | Path) -> dict[str, Any]:
    """Return the content of a configuration file as nested dictionaries.

    Args:
        name_or_path: A name in ``models/config``, or the path of a YAML file.

    Raises:
        InputError: There is none, or it cannot be read.
    """
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        path = CONFIG_FOLDER / f"{name_or_path}.yaml"
    if not is_file(path):
        known = [file.stem for file in CONFIG_FOLDER.glob("*.yaml")]
        raise UnknownName("configuration (name or .yaml file)", str(name_or_path), known)
    content = read_yaml(path)
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
        return path.strip(), parse_yaml(value, "It")
    except InputError as error:
        raise BadSetting(f"'{path}': cannot read the value '{value}'.") from error
