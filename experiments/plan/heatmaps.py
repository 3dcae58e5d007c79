"""Heat maps of the planner's matrices, labelled with the names of the parts."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from planning.feasibility.directions import DIRECTIONS

DPI = 130
MARGIN = 0.9  # [inch] For the names beside a matrix.
COLORS = ListedColormap(["#f4f6f8", "#3b6ea5", "#c9ced4"])  # 0, 1, and the diagonal.
MOST_NAMES = 60  # More would be unreadable.


def contact_map(parts: Sequence[str], contact: np.ndarray) -> bytes:
    """Return C + C^T as a PNG: which part touches which."""
    figure = Figure(figsize=(_size(parts) + 0.4, _size(parts)), dpi=DPI, layout="constrained")
    axes, cell = figure.add_subplot(), (_size(parts) - MARGIN) / len(parts)
    _draw(axes, parts, contact + contact.T, "", cell, named=True)
    return _png(figure)


def direction_maps(parts: Sequence[str], matrices: Mapping[str, np.ndarray], symbol: str) -> bytes:
    """Return the six matrices of a kind as one PNG: a column per axis, a row per sign."""
    width = 2.4 * _size(parts) + 0.6
    height = min(1.7 * _size(parts), 9.0)
    figure = Figure(figsize=(min(width, 13.0), height), dpi=DPI, layout="constrained")
    axes, cell = figure.subplots(2, 3, squeeze=False), (height / 2 - MARGIN) / len(parts)
    for number, j in enumerate(DIRECTIONS):
        row, column = number % 2, number // 2
        named = column == 0
        _draw(axes[row][column], parts, matrices[j], f"${symbol}_{{{j}}}$", cell, named)
    return _png(figure)


def _draw(
    axes: Axes, parts: Sequence[str], matrix: np.ndarray, title: str, cell: float, named: bool
) -> None:
    """Draw a matrix of 0 and 1; the size of the names follows that of a cell [inch]."""
    cells = np.array(matrix, int)
    np.fill_diagonal(cells, 2)
    axes.imshow(cells, cmap=COLORS, vmin=0, vmax=2, interpolation="nearest")
    axes.set_title(title, fontsize=11)
    ticks = range(len(parts)) if len(parts) <= MOST_NAMES else []
    names = [parts[k] for k in ticks]
    size = float(np.clip(0.65 * 72 * cell, 4.0, 9.0))  # [pt]
    axes.set_xticks(ticks, names, rotation=90, fontsize=size)
    axes.set_yticks(ticks, names if named else [], fontsize=size)
    axes.tick_params(length=0)
    if len(parts) <= MOST_NAMES:
        axes.set_xticks(np.arange(len(parts) + 1) - 0.5, minor=True)
        axes.set_yticks(np.arange(len(parts) + 1) - 0.5, minor=True)
        axes.grid(which="minor", color="white", linewidth=0.6)
        axes.tick_params(which="minor", length=0)
    axes.spines[:].set_visible(False)


def _size(parts: Sequence[str]) -> float:
    """Return the edge of one matrix [inch]."""
    return float(np.clip(MARGIN + 0.26 * len(parts), 1.8, 7.0))


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    FigureCanvasAgg(figure).print_png(buffer)
    return buffer.getvalue()
