"""JUnit and CSV of a comparison: what build servers and spreadsheets read."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from cell.errors import InputError
from cell.whole_file import cannot_write
from experiments.compare.comparison import Comparison, rows_to_json, shown
from experiments.reporting.output import writable_folder, write_text


def check_files(**files: Path | None) -> None:
    """Check that files of options, by name, can be written, before any work.

    Raises:
        InputError: One is a folder, or lies in what is none.
        MachineError: Its folder cannot be written to.
    """
    for option, file in files.items():
        if file is None:
            continue
        if file.is_dir():
            raise InputError(f"--{option} '{file}' is a folder; name a file.")
        there = next(folder for folder in file.absolute().parents if folder.exists())
        if not there.is_dir():
            raise InputError(f"--{option} '{file}': '{there}' is no folder.")
        with writable_folder(there):
            pass


def write_junit(
    file: Path, suite: str, rows: Sequence[Comparison], errors: Mapping[str, str] | None = None
) -> None:
    """Write one test case per place; it fails if one of its values is outside its tolerance.

    Args:
        file: To be written.
        suite: Name of the test suite.
        rows: All values.
        errors: Why there are no values, by place: these are errors, not failures.
    """
    errors = errors or {}
    places: dict[str, list[Comparison]] = {place: [] for place in errors}
    for row in rows:
        places.setdefault(row.place, []).append(row)
    failed = {place for place, found in places.items() if not all(row.ok for row in found)}
    counts = {
        "tests": str(len(places)),
        "failures": str(len(failed - set(errors))),
        "errors": str(len(errors)),
    }
    root = ElementTree.Element("testsuites", counts)
    element = ElementTree.SubElement(root, "testsuite", {"name": suite, **counts})
    for place, found in places.items():
        about = {"classname": suite, "name": _printable(place)}
        case = ElementTree.SubElement(element, "testcase", about)
        if place in errors:
            ElementTree.SubElement(case, "error", {"message": _printable(errors[place])})
        elif place in failed:
            outside = [row for row in found if not row.ok]
            message = ", ".join(row.quantity for row in outside)
            failure = ElementTree.SubElement(case, "failure", {"message": _printable(message)})
            failure.text = "\n".join(_printable(_line(row)) for row in outside)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    _write(file, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n')


def _line(row: Comparison) -> str:
    values = f"{shown(row.before)} -> {shown(row.after)}, allowed {row.allowed:.2g}"
    return f"{row.quantity}: {values} ({row.reason})"


def _printable(text: str) -> str:
    """Return a text without control characters, which XML does not have."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def write_csv(file: Path, rows: Sequence[Comparison], names: tuple[str, str]) -> None:
    """Write one line per value, with its tolerance; ``names`` head the two columns of values."""
    heads = ["where", "quantity", *names, "allowed", "ok", "reason"]
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, heads, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows_to_json(rows, names))
    _write(file, text.getvalue())


def _write(file: Path, text: str) -> None:
    """Write a file, and make its folder if there is none."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(file, error) from error
    write_text(file, text)
