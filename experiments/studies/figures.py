"""Figures of the studies: shares as bars, outcomes over parameters, success rates over errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from experiments.reporting.plots import DPI, SIZE, figure_png
from experiments.reporting.statistics import wilson

Array = NDArray[np.float64]
BINS = 6  # Of a parameter, with as many trials in each [A].


def bars(names: Sequence[str], shares: Mapping[str, tuple[Array, Array]], label: str) -> bytes:
    """Draw groups of horizontal bars with intervals.

    Args:
        names: Of the d groups.
        shares: Label of a bar in each group -> values (d,), and intervals (d, 2).
        label: Of the axis.
    """
    height = 0.9 + 0.5 * len(names)
    figure = Figure(figsize=(SIZE[0], height), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    thick = 0.8 / len(shares)
    for k, (name, (values, intervals)) in enumerate(shares.items()):
        at = np.arange(len(names)) + (k - (len(shares) - 1) / 2) * thick
        off = np.abs(intervals.T - values)
        axes.barh(at, values, thick, xerr=off, label=name, error_kw={"capsize": 2})
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlabel(label)
    _tidy(axes)
    axes.legend(fontsize=8, frameon=False)
    return figure_png(figure)


def over_parameters(
    parameters: Mapping[str, Array], outcome: Array, label: str, is_rate: bool
) -> bytes:
    """Draw an outcome over each parameter: every trial, and means over bins.

    Args:
        parameters: Label -> values (n,).
        outcome: (n,) values.
        label: Of the outcome.
        is_rate: Whether it is 0 or 1: then the means are rates, with Wilson's 95 % intervals.
    """
    size = (2.4 * len(parameters), 2.6)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    all_axes = figure.subplots(1, len(parameters), sharey=True, squeeze=False)[0]
    for axes, (name, values) in zip(all_axes, parameters.items(), strict=True):
        axes.plot(values, outcome, ".", color="0.75", markersize=3)
        for group in np.array_split(np.argsort(values), min(BINS, len(values))):
            middle, mean = float(values[group].mean()), float(outcome[group].mean())
            if is_rate:
                low, high = wilson(round(float(outcome[group].sum())), len(group))
            else:
                half = 1.96 * float(outcome[group].std(ddof=1 if len(group) > 1 else 0))
                low, high = mean - half / len(group) ** 0.5, mean + half / len(group) ** 0.5
            error = [[max(mean - low, 0.0)], [max(high - mean, 0.0)]]
            axes.errorbar(middle, mean, yerr=error, fmt="o", color="tab:blue", ms=4, capsize=2)
        axes.set_xlabel(name, fontsize=8)
        axes.tick_params(labelsize=7)
        axes.xaxis.set_major_locator(MaxNLocator(3))
        _tidy(axes)
    all_axes[0].set_ylabel(label, fontsize=8)
    return figure_png(figure)


def rates(levels: Mapping[str, tuple[Array, Array, Array]], x_label: str, goal: float) -> bytes:
    """Draw success rates over the size of an error, on a logarithmic axis.

    Args:
        levels: Label of a curve -> sizes (n,), successes (n,) and trials (n,).
        x_label: Of the axis.
        goal: The rate that is asked for.
    """
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    for k, (name, (sizes, successes, trials)) in enumerate(levels.items()):
        rate = successes / trials
        ends = np.array([wilson(int(s), int(t)) for s, t in zip(successes, trials, strict=True)])
        off = np.maximum(np.abs(ends.T - rate), 0.0)
        beside = sizes * 1.02 ** (k - len(levels) / 2)  # So that intervals do not hide each other.
        axes.errorbar(beside, rate, yerr=off, fmt="o-", label=name, capsize=2, ms=4, lw=1)
    axes.axhline(goal, color="0.5", linestyle="--", linewidth=0.8)
    axes.set_xscale("log")
    tried = np.unique(np.concatenate([sizes for sizes, _, _ in levels.values()]))
    axes.set_xticks(tried, [f"{size:g}" for size in tried])
    axes.minorticks_off()
    axes.set_xlabel(x_label)
    axes.set_ylabel("success rate")
    axes.set_ylim(-0.05, 1.05)
    _tidy(axes)
    axes.legend(fontsize=8, frameon=False)
    return figure_png(figure)


def _tidy(axes: Axes) -> None:
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
