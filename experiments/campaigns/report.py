"""``report.html`` of a campaign: one self-contained page."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from experiments.campaigns.trial import VERDICTS, Row
from experiments.reporting.html_page import Picture, cell, figures, page, pairs, section, table
from experiments.reporting.output import write_text
from experiments.reporting.plots import DPI, SIZE, figure_png
from experiments.reporting.statistics import wilson

FACTS = ("experiment", "product", "trials", *VERDICTS, "success_rate")
MOST_POINTS = 200  # Rows of a table that a person reads; all are in the index.
BINS = 5  # Of a parameter with more values than `MOST_VALUES`, with as many trials in each.
MOST_VALUES = 12
MARKS = {"success": ("tab:blue", "o"), "failure": ("tab:red", "x")}


def write_campaign_report(out: Path, rows: Sequence[Row], summary: Mapping[str, Any]) -> None:
    """Write the report of a campaign.

    Args:
        out: Its folder.
        rows: Of the trials that have ended.
        summary: Of them.
    """
    facts = {name: summary[name] for name in FACTS if summary.get(name) not in (None, 0)}
    facts |= {"95 % interval": _interval(summary["success_interval"])}
    quantities = [{"quantity": name} | value for name, value in summary["measured"].items()]
    setup = {k: summary[k] for k in ("command", "executor", "seeds", "code") if k in summary}
    config = escape(json.dumps(summary.get("config", {}), indent=2, default=str))
    sections = [
        f"<h1>Campaign: {escape(str(summary.get('experiment', out.name)))}</h1>",
        f"<p>{cell(summary['verdict'])}</p>\n{pairs(facts)}",
        section("Success over the parameters", figures(list(_plots(rows)))),
        section("Failures by phase", _failures(summary["failures_by_phase"])),
        section("Points", _points(summary["points"])),
        section("Measured", table(quantities, list(quantities[0]) if quantities else [])),
        section("Set-up", pairs(setup) + pairs(summary.get("versions", {}))),
        section(
            "Configuration",
            f"<details><summary>All settings</summary><pre>{config}</pre></details>",
        ),
    ]
    title = f"Campaign: {summary.get('experiment', out.name)}"
    write_text(out / "report.html", page(title, "\n".join(filter(None, sections))))


def _failures(phases: Sequence[Mapping[str, Any]]) -> str:
    """Return how often each phase failed, one evidence of each, and links to saved states."""
    rows = [
        f"<tr><td>{escape(phase['phase'])}</td><td class='number'>{phase['trials']}</td>"
        f"<td>{escape(phase['evidence'])}</td><td>{_links(phase)}</td></tr>"
        for phase in phases
    ]
    head = "<tr><th>phase</th><th>trials</th><th>evidence of the first</th><th>files</th></tr>"
    return f'<div class="wide"><table>\n{head}\n{"".join(rows)}\n</table></div>' if rows else ""


def _links(phase: Mapping[str, Any]) -> str:
    keys = [f'<a href="trials/{key}.json">{key[:6]}</a>' for key in phase["keys"]]
    states = [f'<a href="{escape(file)}">{Path(file).name}</a>' for file in phase["states"]]
    return ", ".join(keys + states)


def _points(points: Sequence[Mapping[str, Any]]) -> str:
    """Return the success rate of each combination of parameters."""
    if len(points) < 2:
        return ""
    rows = [
        {name: _text(value) for name, value in point["parameters"].items() if value is not None}
        | {name: point[name] for name in ("trials", "successes", "success_rate")}
        | {"95 % interval": _interval(point["success_interval"])}
        for point in points[:MOST_POINTS]
    ]
    rest = len(points) - len(rows)
    more = f"<p>{rest} more are in trials.parquet.</p>" if rest else ""
    return table(rows, list(dict.fromkeys(name for row in rows for name in row))) + more


def _interval(ends: Sequence[float] | None) -> str:
    return "" if ends is None else f"{ends[0]:.2f} to {ends[1]:.2f}"


def _text(value: Any) -> Any:
    """Return a value such that a number is set as one, and a text never as a verdict."""
    return value if isinstance(value, int | float) else str(value)


def _plots(rows: Sequence[Row]) -> Iterator[Picture]:
    """Yield the success rate over each parameter that is a number and takes several values."""
    decided = [row for row in rows if row.done]
    for name in dict.fromkeys(name for row in decided for name in row.varied):
        known = [row for row in decided if _is_number(row.varied.get(name))]
        values = np.array([row.varied[name] for row in known], dtype=float)
        if len(np.unique(values)) > 1:
            good = np.array([row.verdict == "success" for row in known])
            yield (
                f"Success rate over {name}, with Wilson's 95 % interval",
                _plot(name, values, good),
            )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _plot(name: str, values: np.ndarray, good: np.ndarray) -> bytes:
    """Plot trials (n,) as marks at 0 and 1, and success rates of groups of them."""
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    for verdict, (color, marker) in MARKS.items():
        chosen = good == (verdict == "success")
        height = 1.0 if verdict == "success" else 0.0
        axes.plot(values[chosen], np.full(chosen.sum(), height), marker, color=color, alpha=0.4)
    for group in _groups(values):
        rate = float(good[group].mean())
        low, high = wilson(int(good[group].sum()), len(group))
        error = [[max(rate - low, 0.0)], [max(high - rate, 0.0)]]
        axes.errorbar(values[group].mean(), rate, yerr=error, fmt="ks", capsize=3)
    axes.set_xlabel(name)
    axes.set_ylabel("success rate")
    axes.set_ylim(-0.08, 1.08)
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    return figure_png(figure)


def _groups(values: np.ndarray) -> list[np.ndarray]:
    """Return indices of trials by value; of many values, by bins with as many trials in each."""
    different = np.unique(values)
    if len(different) <= MOST_VALUES:
        return [np.flatnonzero(values == value) for value in different]
    return [group for group in np.array_split(np.argsort(values), BINS) if len(group)]
