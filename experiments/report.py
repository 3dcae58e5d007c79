"""The report of a run: one HTML file that holds its pictures and works offline."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from experiments.output import write_text

Picture = tuple[str, bytes]  # Caption and PNG.
STYLE = Path(__file__).with_suffix(".css")
VERDICTS = ("success", "failure")
SUMMARY = ("command", "product", "order", "seed", "real_time_factor")
STEP_COLUMNS = ("name", "operation", "verdict", "sim_seconds", "cpu_seconds")
PLAN_COLUMNS = ("target", "incoming", "directions", "posture", "fixed_part", "up", "cog_height_m")
CASE_COLUMNS = (
    "part", "posture", "direction", "meaning", "trials", "successes", "expected", "verdict",
)  # fmt: skip


def write_report(
    path: Path,
    *,
    title: str,
    plan: Mapping[str, Any],
    result: Mapping[str, Any],
    pictures: Sequence[Picture] = (),
    plots: Sequence[Picture] = (),
    notes: Sequence[str] = (),
) -> None:
    """Write a self-contained report.

    Args:
        path: The HTML file; it appears whole or not at all.
        title: Of the page.
        plan: What ``plan.json`` holds; empty if nothing was planned.
        result: What ``result.json`` holds, with ``steps`` or ``cases``.
        pictures: Caption and PNG each, in order.
        plots: The same.
        notes: What the reader has to know, for example why there are no pictures.
    """
    sections = [
        _summary(title, result, notes),
        _section("Pictures", _figures(pictures)),
        _section("Steps", _table(result.get("steps", ()), STEP_COLUMNS)),
        _section("Cases", _table(result.get("cases", ()), CASE_COLUMNS)),
        _section("Measured", _measured(result)),
        _section("Plan", _plan(plan)),
        _section("Plots", _figures(plots)),
        _section("Versions", _pairs(result.get("versions", {}))),
        _section("Configuration", _json(result.get("config", {}))),
    ]
    write_text(path, _page(title, "\n".join(filter(None, sections))))


def _page(title: str, body: str) -> str:
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width">\n<title>{escape(title)}</title>\n'
        f"<style>\n{STYLE.read_text()}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def _section(heading: str, content: str) -> str:
    return f"<h2>{heading}</h2>\n{content}" if content else ""


def _summary(title: str, result: Mapping[str, Any], notes: Sequence[str]) -> str:
    facts = {name: result[name] for name in SUMMARY if name in result}
    verdict = _cell(result["verdict"]) if "verdict" in result else ""
    paragraphs = "".join(f"<p>{escape(note)}</p>\n" for note in notes)
    return f"<h1>{escape(title)}</h1>\n<p>{verdict}</p>\n{paragraphs}{_pairs(facts)}"


def _figures(pictures: Iterable[Picture]) -> str:
    return "\n".join(
        f'<figure><img alt="{escape(caption)}" src="data:image/png;base64,'
        f'{base64.b64encode(png).decode()}"><figcaption>{escape(caption)}</figcaption></figure>'
        for caption, png in pictures
    )


def _table(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> str:
    """One line per row, with those of the columns that any row has."""
    used = [column for column in columns if any(column in row for row in rows)]
    if not used:
        return ""
    head = "".join(f"<th>{escape(_words(column))}</th>" for column in used)
    lines = ["".join(_td(row.get(column)) for column in used) for row in rows]
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return f'<div class="wide"><table>\n<tr>{head}</tr>\n{body}\n</table></div>'


def _measured(result: Mapping[str, Any]) -> str:
    """Everything measured, one line per step and quantity."""
    rows = []
    for step in (*result.get("steps", ()), *result.get("cases", ())):
        name = step.get("name") or "/".join(
            str(step[key]) for key in ("part", "posture", "direction") if key in step
        )
        for quantity, value in step.get("measured", {}).items():
            rows.append({"step": name, "quantity": quantity, "value": value})
    return _table(rows, ("step", "quantity", "value"))


def _plan(plan: Mapping[str, Any]) -> str:
    steps = plan.get("steps", ())
    reasons = [f"<li>{escape(str(step['reason']))}</li>" for step in steps if "reason" in step]
    listed = f"<ol>{''.join(reasons)}</ol>" if reasons else ""
    return _table(steps, PLAN_COLUMNS) + listed


def _pairs(values: Mapping[str, Any]) -> str:
    rows = [f"<tr><th>{escape(_words(key))}</th>{_td(value)}</tr>" for key, value in values.items()]
    return f"<table>\n{''.join(rows)}\n</table>" if rows else ""


def _json(value: Mapping[str, Any]) -> str:
    text = json.dumps(value, indent=2, default=str)
    return f"<details><summary>All settings</summary><pre>{escape(text)}</pre></details>"


def _td(value: Any) -> str:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return f'<td class="number">{_cell(value)}</td>' if number else f"<td>{_cell(value)}</td>"


def _cell(value: Any) -> str:
    """Return a value as HTML text: verdicts coloured, numbers short, lists and 0/1 maps joined."""
    if value is None:
        return ""
    if value in VERDICTS:
        return f'<span class="verdict {value}">{value}</span>'
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return escape(", ".join(str(key) for key, item in value.items() if item)) or "none"
    if isinstance(value, list | tuple):
        return escape(", ".join(map(str, value)))
    return escape(str(value))


def _words(name: str) -> str:
    return name.replace("_", " ")
