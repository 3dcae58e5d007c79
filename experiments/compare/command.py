"""``soft-jig compare``: two results, summaries, campaigns or plans; the differences as a table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from cell.errors import InputError
from experiments.compare.comparison import (
    Comparison,
    compared,
    rows_to_json,
    tolerance_table,
    value_table,
)
from experiments.compare.files import write_csv, write_junit
from experiments.compare.reading import Content, read_content
from experiments.reporting.output import write_json

NAMES = ("a", "b")
MOST_ROWS = 40  # On the terminal; the files have all.


@dataclass(frozen=True)
class Pair:
    """Two contents that can be compared.

    Attributes:
        paths: Where they were read.
        kind: Of both.
        rows: Every value of both.
        given: Settings and versions that differ, by path. They are no difference of the results.
    """

    paths: tuple[Path, Path]
    kind: str
    rows: list[Comparison]
    given: dict[str, list[Any]]

    @property
    def outside(self) -> list[Comparison]:
        """The values outside their tolerance."""
        return [row for row in self.rows if not row.ok]


def read_pair(first: Path, second: Path) -> Pair:
    """Read two contents and compare them.

    Raises:
        InputError: One cannot be read, or they are not of one kind, or of different things.
    """
    a, b = read_content(first), read_content(second)
    if a.kind != b.kind:
        raise InputError(f"'{first}' is {a.kind}, '{second}' is {b.kind}: compare like with like.")
    if not set(a.values) & set(b.values):
        raise InputError(f"'{first}' and '{second}' have nothing in common: {_examples(a, b)}.")
    given = {
        path: [a.given.get(path), b.given.get(path)]
        for path in dict.fromkeys([*a.given, *b.given])
        if a.given and b.given and a.given.get(path) != b.given.get(path)
    }
    return Pair((first, second), a.kind, compared(a.values, b.values), given)


def _examples(*contents: Content) -> str:
    firsts = [next(iter(content.values), None) for content in contents]
    return " and ".join("nothing" if place is None else f"'{place}'" for place in firsts)


def run_compare(pair: Pair, out: Path, *, junit: Path | None, csv: Path | None, quiet: bool) -> int:
    """Write ``compare.json`` and print what differs.

    Args:
        pair: What is compared.
        out: Existing folder.
        junit: File for JUnit's XML, if wanted.
        csv: File for a table of all values, if wanted.
        quiet: Whether to print nothing.

    Returns:
        0 if every value is within its tolerance, else 1.
    """
    outside = pair.outside
    if junit is not None:
        write_junit(junit, "compare", pair.rows)
    if csv is not None:
        write_csv(csv, pair.rows, NAMES)
    result = {
        "command": "compare",
        **{name: path for name, path in zip(NAMES, pair.paths, strict=True)},
        "kind": pair.kind,
        "verdict": "failure" if outside else "success",
        "compared": len(pair.rows),
        "differ": len(outside),
        "given": pair.given,
        "differences": rows_to_json(outside, NAMES),
    }
    write_json(out / "compare.json", result)
    _print(pair, Console(quiet=quiet, highlight=False))
    return 1 if outside else 0


def _print(pair: Pair, console: Console) -> None:
    outside = pair.outside
    for path, (before, after) in pair.given.items():
        console.print(f"Given differently: {path}: {before} -> {after}", markup=False)
    if outside:
        shown = outside[:MOST_ROWS]
        console.print(value_table(shown, "Differences", ("A", "B"), "differs"))
        console.print(tolerance_table(shown))
        if len(outside) > len(shown):
            console.print(f"{len(outside) - len(shown)} more are in compare.json.")
    text = f"{len(pair.rows)} values compared, {len(outside)} outside their tolerance."
    console.print(text, markup=False)
