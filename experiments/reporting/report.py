"""The report of a run: one self-contained HTML file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from experiments.reporting.html_page import Picture, cell, figures, page, pairs, section, table
from experiments.reporting.measured import Limits, measured_tables
from experiments.reporting.output import write_text

SUMMARY = ("command", "product", "order", "seed", "real_time_factor")
STEP_COLUMNS = ("name", "operation", "verdict", "sim_seconds", "cpu_seconds")
PLAN_COLUMNS = ("target", "incoming", "directions", "posture", "fixed_part", "up", "cog_height_m")
CASE_COLUMNS = (
    "part", "posture", "direction", "meaning", "trials", "successes", "expected", "verdict",
)  # fmt: skip
LINK_COLUMNS = ("pair", "share_of_time", "returns")
PHASE_COLUMNS = ("phase", "begins_s", "lasts_s")
OUTCOME_COLUMNS = ("quantity", "outcome", "trials", "mean", "interval", "paper_mean", "welch_p")


def write_report(
    path: Path,
    *,
    title: str,
    plan: Mapping[str, Any],
    result: Mapping[str, Any],
    videos: Sequence[Picture] = (),
    pictures: Sequence[Picture] = (),
    timeline: Sequence[Picture] = (),
    plots: Sequence[Picture] = (),
    notes: Sequence[str] = (),
    limits: Mapping[str, Limits] | None = None,
    phases: Sequence[Mapping[str, Any]] = (),
) -> None:
    """Write a self-contained report.

    Args:
        path: The HTML file; it appears whole or not at all.
        title: Of the page.
        plan: Content of ``plan.json``; empty if nothing was planned.
        result: Content of ``result.json``, with ``steps`` or ``cases``.
        videos: Caption and GIF each.
        pictures: Caption and PNG each, in order.
        timeline: The same, of who did what when.
        plots: The same, of what was measured.
        notes: Remarks for the reader, for example why there are no pictures.
        limits: By name of a step, what its measured quantities are held against.
        phases: Name, begin and duration of each, in order.
    """
    config = escape(json.dumps(result.get("config", {}), indent=2, default=str))
    settings = f"<details><summary>All settings</summary><pre>{config}</pre></details>"
    sections = [
        _summary(title, result, notes),
        section("Steps", table(result.get("steps", ()), STEP_COLUMNS)),
        section("Cases", table(result.get("cases", ()), CASE_COLUMNS)),
        section("Successes and failures", table(_outcomes(result), OUTCOME_COLUMNS)),
        section("Measured", _measured(result, limits or {})),
        section("Video", figures(videos)),
        section("Pictures", figures(pictures)),
        section("Who does what when", figures(timeline, wide=True) + _phases(phases)),
        section("Plots", figures(plots)),
        section("Contact links", table(_links(result), LINK_COLUMNS)),
        section("Plan", _plan(plan)),
        section("Versions", pairs(result.get("versions", {}))),
        section("Configuration", settings),
    ]
    write_text(path, page(title, "\n".join(filter(None, sections))))


def _summary(title: str, result: Mapping[str, Any], notes: Sequence[str]) -> str:
    facts = {name: result[name] for name in SUMMARY if result.get(name) not in (None, [])}
    verdict = cell(result["verdict"]) if "verdict" in result else ""
    paragraphs = "".join(f"<p>{escape(note)}</p>\n" for note in notes)
    return f"<h1>{escape(title)}</h1>\n<p>{verdict}</p>\n{paragraphs}{pairs(facts)}"


def _measured(result: Mapping[str, Any], limits: Mapping[str, Limits]) -> str:
    """Return what was measured in each step or case, against its limits."""
    tables = []
    for step in (*result.get("steps", ()), *result.get("cases", ())):
        name = step.get("name") or "/".join(
            str(step[key]) for key in ("part", "posture", "direction") if key in step
        )
        tables.append(measured_tables(name, step.get("measured", {}), limits.get(name, {})))
    return "\n".join(filter(None, tables))


def _phases(phases: Sequence[Mapping[str, Any]]) -> str:
    """Return the phases, folded away."""
    rows = table(phases, PHASE_COLUMNS)
    return f"<details><summary>All phases</summary>{rows}</details>" if rows else ""


def _outcomes(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the comparison of successful and failed trials, one row per quantity and group."""
    return [
        {"quantity": quantity, "outcome": outcome, **group, "welch_p": groups.get("welch_p")}
        for quantity, groups in result.get("by_outcome", {}).items()
        for outcome, group in groups.items()
        if outcome != "welch_p"
    ]


def _links(result: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    """Return the pairs of bodies that were linked; none where contact was always full."""
    return result.get("contact_links", {}).get("pairs", ())


def _plan(plan: Mapping[str, Any]) -> str:
    steps = plan.get("steps", ())
    reasons = [f"<li>{escape(str(step['reason']))}</li>" for step in steps if "reason" in step]
    listed = f"<ol>{''.join(reasons)}</ol>" if reasons else ""
    return table(steps, PLAN_COLUMNS) + listed
