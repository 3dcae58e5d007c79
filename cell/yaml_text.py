"""Reading YAML that anybody may have written: plain values only, within bounds, errors in one line.

Numbers, booleans and null are those of YAML 1.2: ``on``, ``no``, dates and ``12:30`` are text, and
``1e-3`` is a number. Anchors, aliases and merge keys work as long as what they stand for, written
out in full, stays within the bounds.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from cell.errors import InputError

LARGEST_FILE = 1_000_000  # [byte] [M] The reader takes 10 s for that; our own files have 10 kB.
DEEPEST = 32  # [A] Levels of nesting; our own files have 6.
MOST_VALUES = 100_000  # [A] Aliases written out in full.
LONGEST_NUMBER = 40  # [A] Characters: twice what a double can tell apart.

TAG = "tag:yaml.org,2002:"
PLAIN: dict[type[yaml.Node], set[str]] = {
    yaml.ScalarNode: {TAG + kind for kind in ("null", "bool", "int", "float", "merge", "str")},
    yaml.SequenceNode: {TAG + "seq"},
    yaml.MappingNode: {TAG + "map"},
}


class _Loader(yaml.SafeLoader):
    """Resolves plain scalars by the core schema of YAML 1.2, and knows no other tags."""

    yaml_implicit_resolvers = {}


for _kind, _pattern, _first in (  # Each with the characters that such a value may begin with.
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+", list("-+0123456789")),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("float", r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", list("-+.")),
    ("merge", r"<<", ["<"]),
):
    _Loader.add_implicit_resolver(TAG + _kind, re.compile(rf"(?:{_pattern})\Z"), _first)
_Loader.add_constructor(TAG + "int", lambda _, node: int(node.value))


def read_yaml(file: Path) -> Any:
    """Return what a file holds.

    Raises:
        InputError: It cannot be read, or is not YAML within the bounds; with the line.
    """
    try:
        with file.open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:  # A NUL in the path is a ValueError.
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"'{file}' cannot be read: {reason}.") from error
    if len(data) > LARGEST_FILE:
        raise InputError(f"'{file}' is larger than {LARGEST_FILE // 1000} kB.")
    return parse_yaml(data, f"'{file}'")


def parse_yaml(text: str | bytes, name: str) -> Any:
    """Return the value that a text describes.

    Args:
        text: YAML.
        name: What it is called in messages.

    Raises:
        InputError: It is not YAML within the bounds; with the line.
    """
    loader = None
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None
        _Bounds(name).check(node)
        return loader.construct_document(node)
    except RecursionError:
        raise InputError(f"{name} is nested deeper than {DEEPEST} levels.") from None
    except (yaml.YAMLError, ValueError, KeyError) as error:  # A KeyError for "!!bool x".
        raise InputError(f"{name} is not valid YAML: {_reason(error)}.") from error
    finally:
        if loader is not None:
            loader.dispose()


def _reason(error: Exception) -> str:
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        mark = error.problem_mark
        return f"line {mark.line + 1}, column {mark.column + 1}: {error.problem}"
    return " ".join(str(error).split())


class _Bounds:
    """Checks a document before values are made of it, so that aliases cannot multiply.

    Args:
        name: What the document is called in messages.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._size_and_height: dict[int, tuple[int, int]] = {}
        self._around: set[int] = set()

    def check(self, node: yaml.Node) -> tuple[int, int]:
        """Return how many values a node holds, with aliases written out, and in how many levels.

        Raises:
            InputError: Too many, too deep, a loop, a repeated key, or what is no plain value.
        """
        if (known := self._size_and_height.get(id(node))) is not None:
            return known
        if id(node) in self._around:
            raise self._error(node, "an alias that contains itself")
        if node.tag not in PLAIN[type(node)]:
            raise self._error(node, f"a value tagged '{node.tag}': only plain values are read")
        self._around.add(id(node))
        inner = [self.check(child) for child in self._children(node)]
        self._around.remove(id(node))
        size = 1 + sum(size for size, _ in inner)
        height = 1 + max((height for _, height in inner), default=0)
        if size > MOST_VALUES:
            raise self._error(node, f"more than {MOST_VALUES} values, with aliases written out")
        if height > DEEPEST:
            raise self._error(node, f"nested deeper than {DEEPEST} levels")
        self._size_and_height[id(node)] = size, height
        return size, height

    def _children(self, node: yaml.Node) -> list[yaml.Node]:
        if isinstance(node, yaml.SequenceNode):
            return node.value
        if isinstance(node, yaml.MappingNode):
            self._check_keys(node)
            return [one for pair in node.value for one in pair]
        if not node.value.isprintable():
            raise self._error(node, f"text that is not printable, {node.value!r}")
        if node.tag in (TAG + "int", TAG + "float") and len(node.value) > LONGEST_NUMBER:
            raise self._error(node, f"a number of {len(node.value)} characters")
        return []

    def _check_keys(self, node: yaml.MappingNode) -> None:
        seen = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise self._error(key, "a key is a name, not a list")
            if key.value in seen:
                raise self._error(key, f"'{key.value}' occurs twice")
            seen.add(key.value)

    def _error(self, node: yaml.Node, what: str) -> InputError:
        return InputError(f"{self._name}, line {node.start_mark.line + 1}: {what}.")
