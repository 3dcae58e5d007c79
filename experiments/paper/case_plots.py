"""The figures of the paper's push experiment, from our data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.paper.cases import CaseResult
from experiments.paper.trial_metrics import SUCCESS_DISTANCE, plate_forces, start_of
from experiments.reporting.plots import DPI, SIZE, figure_png

COLORS = {"success": "tab:blue", "failure": "tab:red"}
# Mean displacement of the paper's successes and failures [m] [S]; no other number is printed.
PAPER_MEANS = {"success": 0.0782, "failure": 0.0542}


def plot_forces(result: CaseResult) -> bytes:
    """Plot F_n and F_s over time for every trial of a case; the start of the push is marked."""
    figure = Figure(figsize=(SIZE[0], 2.6), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    for k, trial in enumerate(result.trials):
        if "time" not in trial.trial.log:
            continue
        time, normal, shear = plate_forces(trial.trial)
        axes.plot(time, normal, "0.3", linewidth=0.8, label="normal" if k == 0 else None)
        axes.plot(time, shear, "tab:orange", linewidth=0.8, label="shear" if k == 0 else None)
        begun = start_of(trial.trial, "push")
        if begun is not None:
            axes.axvline(begun, color="0.8", linewidth=0.8, zorder=0)
    _style(axes, "time [s]", "force [N]")
    if axes.lines:  # No trial has a log if all were killed.
        axes.legend(fontsize=8, frameon=False)
    return figure_png(figure)


def plot_rates(results: Sequence[CaseResult]) -> bytes:
    """Plot success rates with Wilson's 95 % intervals, and the paper's rates as marks."""
    figure, axes = _bars(results, "success rate")
    for k, result in enumerate(results):
        rate = result.successes / len(result.trials)
        low, high = result.interval
        error = [[max(rate - low, 0.0)], [max(high - rate, 0.0)]]
        axes.bar(k, rate, color=COLORS[result.outcome], yerr=error, capsize=3, width=0.6)
        axes.plot(k, float(result.case.expected == "success"), "k_", markersize=18)
    axes.set_ylim(0, 1.1)
    axes.set_title("bars: here; dashes: in the paper", fontsize=9)
    return figure_png(figure)


def plot_quantity(results: Sequence[CaseResult], quantity: str, label: str, scale: float) -> bytes:
    """Plot the mean and every trial of a quantity, by case."""
    figure, axes = _bars(results, label)
    for k, result in enumerate(results):
        values = scale * result.values(quantity)
        if len(values):
            axes.bar(k, values.mean(), color=COLORS[result.outcome], alpha=0.6, width=0.6)
            axes.plot(np.full(len(values), k), values, "k.", markersize=4)
    if quantity == "displacement_m":
        axes.axhline(scale * SUCCESS_DISTANCE, color="0.5", linestyle="--", linewidth=0.8)
        for outcome, mean in PAPER_MEANS.items():
            text = f"paper's mean {outcome}"
            axes.axhline(scale * mean, color=COLORS[outcome], linestyle=":", label=text)
        axes.legend(fontsize=8, frameon=False)
    return figure_png(figure)


def _bars(results: Sequence[CaseResult], label: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    labels = [result.case.label for result in results]
    axes.set_xticks(range(len(labels)), labels, fontsize=8)
    _style(axes, "", label)
    return figure, axes


def _style(axes: Axes, x_label: str, y_label: str) -> None:
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
