"""What a run of the speed benchmark found: summary, table, plot and history."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from cell.errors import InputError
from experiments.reporting.plots import DPI, SIZE, figure_png
from experiments.speed.layers import LAYERS, Cost, mean_cost
from experiments.speed.meter import changes
from experiments.speed.whole_run import PhaseRun
from planning.operations.phase_class import PhaseClass

ALL = "all"
COLORS = dict(zip(LAYERS, ("tab:blue", "tab:green", "tab:orange", "tab:red"), strict=True))
TITLE = "CPU seconds per simulated second"


@dataclass(frozen=True)
class Measured:
    """One phase whose beginning was measured.

    Attributes:
        phase: Which one.
        cost: Of its beginning.
        weight: Simulated time of the run that it stands for [s].
    """

    phase: PhaseRun
    cost: Cost
    weight: float


def summary(phases: Sequence[PhaseRun], measured: Sequence[Measured]) -> dict[str, Any]:
    """Return what time costs by class, and by operation and class.

    Args:
        phases: Of the whole run.
        measured: Those of it, or some of them, that were measured.
    """
    operations = dict.fromkeys(one.phase.operation for one in measured)
    return {
        "classes": _by_class(phases, measured),
        "operations": {
            name: _by_class(
                [phase for phase in phases if phase.operation == name],
                [one for one in measured if one.phase.operation == name],
            )
            for name in operations
        },
    }


def _by_class(phases: Sequence[PhaseRun], measured: Sequence[Measured]) -> dict[str, Any]:
    """Return a row for each class that occurs, and one for all of them."""
    found = {}
    for kind in PhaseClass:
        own = [one for one in measured if one.phase.phase_class is kind]
        if own:
            found[kind.value] = _row([run for run in phases if run.phase_class is kind], own)
    return found | {ALL: _row(phases, measured)}


def _row(phases: Sequence[PhaseRun], measured: Sequence[Measured]) -> dict[str, Any]:
    """Return times of the whole run, and costs per simulated second of what was measured."""
    layers, ratios = mean_cost((one.cost, one.weight) for one in measured)
    return {
        "whole_run": {
            "simulated_seconds": sum(phase.sim_seconds for phase in phases),
            "cpu_seconds": sum(phase.cpu_seconds for phase in phases),
            "planning_cpu_seconds": sum(phase.planning_seconds for phase in phases),
        },
        "cpu_seconds_per_simulated_second": layers | {"total": sum(layers.values())},
        "ratios": ratios | {"total": sum(ratios.values())},
    }


def phase_row(measured: Measured) -> dict[str, Any]:
    """Return what one phase costs."""
    phase = measured.phase
    return {
        "number": phase.number,
        "operation": phase.operation,
        "name": phase.name,
        "class": phase.phase_class.value,
        "stands_for_simulated_seconds": measured.weight,
        "kernel_cpu_seconds": measured.cost.kernel,
    } | _row([phase], [measured])


def totals(found: Mapping[str, Any]) -> dict[str, float]:
    """Return the ratio of each class, all layers together."""
    return {name: row["ratios"]["total"] for name, row in found["classes"].items()}


# On the terminal.


def class_table(found: Mapping[str, Any], stored: Mapping[str, float]) -> Table:
    """Return a table by class, with the change of its ratio against a stored one."""
    table = _table("class", "ratio", "change")
    change = changes(stored, totals(found))
    for name, row in found["classes"].items():
        shown = f"{change[name]:+.0%}" if name in change else "-"
        table.add_row(name, *_costs(row), shown)
    return table


def operation_table(found: Mapping[str, Any]) -> Table:
    """Return a table by operation, and below each by class."""
    table = _table("operation", "ratio")
    for operation, rows in found["operations"].items():
        table.add_row(operation, *_costs(rows[ALL]))
        for name in rows:
            if name != ALL:
                table.add_row(f"  {name}", *_costs(rows[name]))
    return table


def phase_table(measured: Sequence[Measured]) -> Table:
    """Return a table of single phases."""
    table = _table("phase", "ratio")
    for one in measured:
        table.add_row(one.phase.name, *_costs(phase_row(one)))
    return table


def _table(name: str, *further: str) -> Table:
    """Return an empty table, no wider than 80 characters with short names."""
    table = Table(title=TITLE, title_justify="left", box=SIMPLE, padding=0)
    table.add_column(name, no_wrap=True)
    for heading in (escape("sim [s]"), "run", *LAYERS, "sum", *further):
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def _costs(row: Mapping[str, Any]) -> list[str]:
    whole, layers = row["whole_run"], row["cpu_seconds_per_simulated_second"]
    simulated = whole["simulated_seconds"]
    costs = [whole["cpu_seconds"] / simulated, *(layers[name] for name in (*LAYERS, "total"))]
    shown = (f"{cost:.2f}" for cost in costs)
    return [f"{simulated:.1f}", *shown, f"{row['ratios']['total']:.1f}"]


# As a picture.


def plot_classes(found: Mapping[str, Any]) -> bytes:
    """Plot the layers of each class as stacked bars, and the mean of the whole run as marks."""
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    rows = found["classes"]
    bottom = np.zeros(len(rows))
    for layer in LAYERS:
        costs = [row["cpu_seconds_per_simulated_second"][layer] for row in rows.values()]
        axes.bar(list(rows), costs, bottom=bottom, width=0.6, color=COLORS[layer], label=layer)
        bottom += costs
    whole = [row["whole_run"] for row in rows.values()]
    means = [times["cpu_seconds"] / times["simulated_seconds"] for times in whole]
    axes.plot(list(rows), means, "k_", markersize=30, label="whole run")
    axes.axhline(1.0, color="0.5", linestyle="--", linewidth=0.8, label="real time")
    axes.set_ylabel(TITLE)
    axes.grid(axis="y", alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=8, frameon=False)
    return figure_png(figure)


# From run to run.


def latest_entry(history: Path, product: str) -> dict[str, Any] | None:
    """Return the last entry of a history for a product; None if there is none.

    Raises:
        InputError: The history cannot be read.
    """
    if not history.exists():
        return None
    try:
        lines = history.read_text(encoding="utf-8").splitlines()
        entries = [json.loads(line) for line in lines if line.strip()]
        own = [entry for entry in entries if entry["product"] == product]
        return own[-1] if own else None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"Cannot read the history '{history}': {error}.") from error


def append_entry(history: Path, entry: Mapping[str, Any]) -> None:
    """Add a line to a history."""
    history.parent.mkdir(parents=True, exist_ok=True)
    with history.open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry) + "\n")
