"""Where each part waits in the tray: parts in rows between stop boxes, screws in a row in front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold

from cell.cad.nests import (
    PLAY,
    STOP_THICKNESS,
    Nest,
    outline,
    rail_length,
    rail_nest,
    stop_nest,
)
from cell.errors import InputError

SIZE = (260.0, 200.0)  # [D] Of the tray [mm]: between the jig and the end of the arms' reach.
BORDER = 6.0  # [A] Between a nest and the edge of the tray [mm].
GAP = 40.0  # [D] Between neighbours: two fingers, opened, and their clearance [mm].
RAIL_GAP = 10.0  # [A] Between the rails of rows side by side: heads end before them [mm].
RAIL_DEPTH = 24.0  # [A] Of a row of screws, with fingers around them [mm].


@dataclass(frozen=True)
class ScrewRow:
    """Equal screws that wait in one row: names, and diameter, length and head's diameter [mm]."""

    names: tuple[str, ...]
    diameter: float
    length: float
    head: float


def lay_out(parts: Mapping[str, Manifold], rows: Sequence[ScrewRow]) -> list[Nest]:
    """Return the nests of all parts.

    Args:
        parts: By name, in the order in which they are wanted, each turned as it is to stand [mm].
        rows: Of screws.

    Raises:
        InputError: The tray is too small.
    """
    nests: list[Nest] = []
    edge = PLAY + STOP_THICKNESS
    sizes = {name: np.subtract(*reversed(outline(s)))[:2] + 2 * edge for name, s in parts.items()}
    front = -SIZE[1] / 2 + BORDER
    for line in _lines(rows):
        width = sum(length for _, length in line) + RAIL_GAP * (len(line) - 1)
        x = -width / 2
        for row, length in line:
            at = (x + length / 2, front + RAIL_DEPTH / 2)
            nests += rail_nest(row.names, row.diameter, row.length, row.head, at)
            x += length + RAIL_GAP
        front += RAIL_DEPTH
    back = SIZE[1] / 2 - BORDER
    for shelf in _shelves(sizes):
        depth = max(sizes[name][1] for name in shelf)
        if back - depth < front:
            raise _too_small(f"there is no room for {', '.join(shelf)}")
        free = SIZE[0] - 2 * BORDER - sum(sizes[name][0] for name in shelf)
        # What is left goes between them and to both sides.
        gap = free / (len(shelf) + 1)
        x = -SIZE[0] / 2 + BORDER
        for name in shelf:
            x += gap + sizes[name][0] / 2
            nests.append(stop_nest(name, parts[name], (x, back - depth / 2)))
            x += sizes[name][0] / 2
        back -= depth + GAP
    return nests


def _lines(rows: Sequence[ScrewRow]) -> list[list[tuple[ScrewRow, float]]]:
    """Return the rows with their lengths [mm], side by side as far as the tray's width allows."""
    lines: list[list[tuple[ScrewRow, float]]] = []
    free = 0.0
    for row in rows:
        length = rail_length(len(row.names), row.head)
        if length > SIZE[0] - 2 * BORDER:
            raise _too_small(f"a row of {len(row.names)} screws is {length:.0f} mm long")
        if RAIL_GAP + length > free:
            lines.append([])
            free = SIZE[0] - 2 * BORDER + RAIL_GAP
        lines[-1].append((row, length))
        free -= RAIL_GAP + length
    return lines


def _shelves(sizes: Mapping[str, np.ndarray]) -> list[list[str]]:
    """Return the names by shelf, each as full as its width allows."""
    shelves: list[list[str]] = []
    used = np.inf
    for name, size in sizes.items():
        width = float(size[0])
        if width > SIZE[0] - 2 * BORDER:
            raise _too_small(f"'{name}' is {width:.0f} mm wide with its stops")
        if used + GAP + width > SIZE[0] - 2 * BORDER:
            shelves.append([])
            used = -GAP
        shelves[-1].append(name)
        used += GAP + width
    return shelves


def _too_small(reason: str) -> InputError:
    return InputError(f"The tray of {SIZE[0]:g} x {SIZE[1]:g} mm is too small: {reason}.")
