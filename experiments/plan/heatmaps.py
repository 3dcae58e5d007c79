"""Heat maps of the planner's matrices as SVG, labelled with the names of the parts.

A matrix is an image of one pixel per entry, scaled up; names are text, which the browser draws in
whatever script they are written.
"""

from __future__ import annotations

import base64
import io
import unicodedata
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
from PIL import Image

from planning.feasibility.directions import DIRECTIONS

COLORS = np.array([[0xF4, 0xF6, 0xF8], [0x3B, 0x6E, 0xA5], [0xC9, 0xCE, 0xD4]], np.uint8)
"""Of a 0, a 1, and the diagonal."""

LARGEST = 360.0  # Edge of a matrix of many parts; lengths in px.
CELL = 22.0  # Of a matrix of few parts.
SMALLEST_TEXT, LARGEST_TEXT = 4.0, 12.0
TITLE = 22.0  # Height of the line above a matrix.
GAP = 14.0
MOST_NAMES = 60  # More would be unreadable.
LONGEST = 28  # Characters of a name; the rest is left to the tooltip.


def contact_map(parts: Sequence[str], contact: np.ndarray) -> str:
    """Return C + C^T: which part touches which."""
    margin = _margin(parts)
    drawn = _matrix(parts, contact + contact.T, "", margin, 0.0, margin, named=True)
    edge = _cell(parts) * len(parts)
    return _svg(margin + edge, TITLE + edge + margin, drawn)


def direction_maps(parts: Sequence[str], matrices: Mapping[str, np.ndarray], symbol: str) -> str:
    """Return the six matrices of a kind: a column per axis, a row per sign."""
    margin, edge = _margin(parts), _cell(parts) * len(parts)
    drawn = []
    for number, j in enumerate(DIRECTIONS):
        row, column = number % 2, number // 2
        x, y = margin + column * (edge + GAP), row * (edge + TITLE + GAP)
        below = margin if row == 1 else 0.0
        title = f'{symbol}<tspan dy="3" font-size="9">{j}</tspan>'
        drawn.append(_matrix(parts, matrices[j], title, x, y, below, named=column == 0))
    width = margin + 3 * edge + 2 * GAP
    return _svg(width, 2 * (TITLE + edge) + GAP + margin, "".join(drawn))


def _svg(width: float, height: float, content: str) -> str:
    return (
        f'<svg class="heatmap" role="img" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}">{content}</svg>'
    )


def _matrix(
    parts: Sequence[str],
    matrix: np.ndarray,
    title: str,
    x: float,
    y: float,
    below: float,
    *,
    named: bool,
) -> str:
    """Return a matrix of 0 and 1 with its title, its left edge at x and its title's top at y.

    Names stand to the left if it is named, and below if there is room.
    """
    cells, cell = np.array(matrix, int), _cell(parts)
    np.fill_diagonal(cells, 2)
    edge, top = cell * len(parts), y + TITLE
    png = io.BytesIO()
    Image.fromarray(COLORS[cells]).save(png, "PNG")
    data = base64.b64encode(png.getvalue()).decode()
    lines = [
        f'<text x="{x:.1f}" y="{top - 7:.1f}" font-size="13">{title}</text>' if title else "",
        f'<image x="{x:.1f}" y="{top:.1f}" width="{edge:.1f}" height="{edge:.1f}" '
        f'style="image-rendering:pixelated" href="data:image/png;base64,{data}"/>',
    ]
    if len(parts) > MOST_NAMES:
        return "".join(lines)
    inner = [f"{cell * k:.1f}" for k in range(1, len(parts))]
    across = "".join(f"M{x:.1f} {top + float(k):.1f}h{edge:.1f}" for k in inner)
    down = "".join(f"M{x + float(k):.1f} {top:.1f}v{edge:.1f}" for k in inner)
    lines.append(f'<path d="{across}{down}" stroke="white" stroke-width="0.8" fill="none"/>')
    size = _text_size(parts)
    for number, name in enumerate(parts):
        along = cell * (number + 0.5) + 0.35 * size
        text = f'font-size="{size:.1f}" text-anchor="end">{_shown(name)}'
        if named:
            lines.append(f'<text x="{x - 4:.1f}" y="{top + along:.1f}" {text}</text>')
        if below:
            at = f"translate({x + along:.1f} {top + edge + 4:.1f}) rotate(-90)"
            lines.append(f'<text transform="{at}" {text}</text>')
    return "".join(lines)


def _shown(name: str) -> str:
    short = name if len(name) <= LONGEST else f"{name[: LONGEST - 1]}…"
    return f"<title>{escape(name)}</title>{escape(short)}"


def _cell(parts: Sequence[str]) -> float:
    """Return the edge of one entry [px]."""
    return min(CELL, LARGEST / len(parts))


def _text_size(parts: Sequence[str]) -> float:
    return float(np.clip(0.7 * _cell(parts), SMALLEST_TEXT, LARGEST_TEXT))


def _margin(parts: Sequence[str]) -> float:
    """Return the room for the longest name [px]: 0.6 of its height per letter, 1 if it is wide."""
    if len(parts) > MOST_NAMES:
        return 0.0
    widths = [
        sum(1.0 if unicodedata.east_asian_width(letter) in "WF" else 0.6 for letter in name)
        for name in (part[:LONGEST] for part in parts)
    ]
    return max(widths) * _text_size(parts) + 8.0
