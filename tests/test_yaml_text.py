"""YAML of strangers: plain values by the core schema, within bounds, one line with the place."""

from __future__ import annotations

import pytest

from cell.errors import InputError
from cell.yaml_text import DEEPEST, LONGEST_NUMBER, MOST_VALUES, parse_yaml


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3),
        ("-.5", -0.5),
        ("1.", 1.0),
        ("010", 10),
        (".inf", float("inf")),
        ("true", True),
        ("yes", "yes"),
        ("on", "on"),
        ("12:30:00", "12:30:00"),
        ("2020-99-99", "2020-99-99"),
        ("0x10", "0x10"),
        ("1_000", "1_000"),
        ("~", None),
        ("", None),
        ("'1'", "1"),
        ("{a: &a {x: 1}, b: {<<: *a, y: 2}}", {"a": {"x": 1}, "b": {"x": 1, "y": 2}}),
    ],
)
def test_values_are_those_of_the_core_schema(text: str, value: object) -> None:
    result = parse_yaml(text, "it")
    assert result == value and type(result) is type(value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", "it, line 3: 'a' occurs twice"),
        ("&a [*a]", "it, line 1: an alias that contains itself"),
        ("a: !!binary aGVsbG8=", "it, line 1: a value tagged 'tag:yaml.org,2002:binary'"),
        ("a: !!python/name:os.system", "it, line 1: a value tagged"),
        ("a: 1\nb: [1, 2", "it is not valid YAML: line 2, column 9"),
        ("a: 1\n\n[1]: 2\n", "it, line 3: a key is a name"),
        (r'a: "x\e[31m"', r"it, line 1: text that is not printable, 'x\\x1b\[31m'"),
        ("a: !!int x", "it is not valid YAML"),
        ("a: !!bool x", "it is not valid YAML"),
        ("a: !!int [1]", "it, line 1: a value tagged"),
        ("a: 1\n---\nb: 1\n", "it is not valid YAML: line 2"),
        ("*nope", "it is not valid YAML: line 1, column 1: found undefined alias"),
    ],
)
def test_what_is_refused_says_where(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        parse_yaml(text, "it")
    assert "\n" not in str(caught.value)


def doubled(levels: int) -> str:
    """Return 2**levels values, by aliases of aliases."""
    lines = ["x0: &x0 [1]"]
    lines += [f"x{k}: &x{k} [*x{k - 1}, *x{k - 1}]" for k in range(1, levels)]
    return "\n".join(lines)


def test_aliases_count_as_what_they_stand_for() -> None:
    assert len(parse_yaml(doubled(10), "it")) == 10
    with pytest.raises(InputError, match=f"more than {MOST_VALUES} values, with aliases"):
        parse_yaml(doubled(20), "it")


def test_bounds_hold_exactly() -> None:
    deep = "[" * DEEPEST
    assert parse_yaml(deep + "]" * DEEPEST, "it") is not None
    with pytest.raises(InputError, match=f"nested deeper than {DEEPEST} levels"):
        parse_yaml(f"[{deep}{']' * DEEPEST}]", "it")
    with pytest.raises(InputError, match="nested deeper than"):
        parse_yaml("[" * 5000, "it")
    assert parse_yaml("9" * LONGEST_NUMBER, "it") == int("9" * LONGEST_NUMBER)
    with pytest.raises(InputError, match="line 1: a number of 41 characters"):
        parse_yaml("9" * (LONGEST_NUMBER + 1), "it")
