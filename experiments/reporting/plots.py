"""Plots for the report: plain values in, PNG out."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from planning.operations.plot import Plot

SIZE = (8.0, 3.6)  # [inch]
DPI = 110


def draw(plot: Plot) -> bytes:
    """Return the plot of a step's curves as a PNG."""
    figure, axes = _axes(plot.x_label, plot.y_label)
    for label, (x, y) in plot.curves.items():
        axes.plot(x, y, label=label)
    if plot.level is not None:
        label, height = plot.level
        axes.axhline(height, color="0.5", linestyle="--", label=label)
    return _png(figure, axes)


def plot_forces(
    time: np.ndarray,
    forces: Mapping[str, np.ndarray],
    steps: Sequence[tuple[str, float]] = (),
    marks: Sequence[tuple[float, float]] = (),
) -> bytes:
    """Plot forces over time.

    Args:
        time: (n,) [s].
        forces: Label -> (n,) [N].
        steps: Name and start [s] of each step, drawn as labelled lines.
        marks: Time [s] and force [N] of points to be numbered from 1, for the caption.
    """
    figure, axes = _axes("time [s]", "force [N]")
    for label, force in forces.items():
        axes.plot(time, force, label=label, linewidth=1.2)
    for name, start in steps:
        axes.axvline(start, color="0.7", linewidth=0.8, zorder=0)
        axes.annotate(
            name, (start, 1.0), xycoords=("data", "axes fraction"), xytext=(2, 3),
            textcoords="offset points", fontsize=8, color="0.3",
        )  # fmt: skip
    for number, (x, y) in enumerate(marks, start=1):
        axes.annotate(
            str(number), (x, y), xytext=(0, 4), textcoords="offset points", fontsize=8,
            fontweight="bold", ha="center",
        )  # fmt: skip
    return _png(figure, axes)


def _axes(x_label: str, y_label: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _png(figure: Figure, axes: Axes) -> bytes:
    if axes.get_legend_handles_labels()[1]:
        axes.legend(fontsize=8, frameon=False)
    return figure_png(figure)


def figure_png(figure: Figure) -> bytes:
    """Return a figure as a PNG; a dollar sign in a name is a character, and begins no formula."""
    for text in figure.findobj(Text):
        text.set_parse_math(False)
    buffer = io.BytesIO()
    FigureCanvasAgg(figure).print_png(buffer)
    return buffer.getvalue()
