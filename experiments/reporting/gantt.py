"""The chart of who did what when: a lane per device, a bar per phase, coloured by its class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from experiments.reporting.plots import DPI, figure_png

WIDTH, LANE_HEIGHT = 12.0, 0.7  # [inch]
COLORS = ("tab:blue", "tab:green", "tab:gray", "tab:orange")


@dataclass(frozen=True)
class Bar:
    """What goes on in one lane for a while.

    Attributes:
        lane: Name of a device.
        start, end: [s].
        kind: What goes on, in a word.
        step: What it is part of, for example "insert plate".
    """

    lane: str
    start: float
    end: float
    kind: str
    step: str


def plot_bars(bars: Sequence[Bar], kinds: Sequence[str]) -> bytes:
    """Return the chart as a PNG.

    Args:
        bars: At least one; lanes are drawn from top to bottom in the order of their first bars.
        kinds: All that there are, in the order of the legend; at most four.
    """
    colors = dict(zip(kinds, COLORS, strict=False))
    lanes = list(dict.fromkeys(bar.lane for bar in bars))
    figure = Figure(figsize=(WIDTH, 1.2 + LANE_HEIGHT * len(lanes)), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    for kind, color in colors.items():
        for row, lane in enumerate(lanes):
            spans = [(b.start, b.end - b.start) for b in bars if (b.lane, b.kind) == (lane, kind)]
            axes.broken_barh(spans, (row - 0.35, 0.7), facecolors=color)
    for step in dict.fromkeys(bar.step for bar in bars):
        start = min(bar.start for bar in bars if bar.step == step)
        axes.axvline(start, color="0.3", linewidth=0.8)
        axes.annotate(
            step, (start, 1.0), xycoords=("data", "axes fraction"), xytext=(2, 2),
            textcoords="offset points", fontsize=8,
        )  # fmt: skip
    axes.set_yticks(range(len(lanes)), lanes)
    axes.set_ylim(len(lanes) - 0.5, -0.5)
    axes.set_xlim(min(bar.start for bar in bars), max(bar.end for bar in bars))
    axes.set_xlabel("time [s]")
    axes.spines[["top", "right"]].set_visible(False)
    patches = [Patch(color=color, label=kind) for kind, color in colors.items()]
    figure.legend(handles=patches, loc="outside lower right", ncols=4, fontsize=8, frameon=False)
    return figure_png(figure)
