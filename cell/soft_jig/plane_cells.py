"""Plane cells that share whole edges, and the loop of vertices around them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cell.soft_jig.columns import BadMesh
from cell.soft_jig.polygons import WELD, area

Array = NDArray[np.float64]


def conforming_cells(polygons: Sequence[Array], longest: float) -> tuple[Array, list[list[int]]]:
    """Weld polygons into cells that share whole edges, outer edges split to `longest` [m]."""
    points: list[Array] = []
    cells = [[_weld(points, xy) for xy in polygon] for polygon in polygons]
    cells = [_with_hanging_vertices(cell, points) for cell in cells]
    shared = {edge for cell in cells for edge in cell_edges(cell)}
    split = [_split_outer_edges(cell, points, shared, longest) for cell in cells]
    return np.array(points), split


def _weld(points: list[Array], xy: Array) -> int:
    for i, known in enumerate(points):
        if np.abs(known - xy).max() < 10 * WELD:
            return i
    points.append(np.asarray(xy, dtype=float))
    return len(points) - 1


def cell_edges(cell: list[int]) -> list[tuple[int, int]]:
    """Return the directed edges of a cell."""
    return list(zip(cell, [*cell[1:], cell[0]], strict=True))


def _with_hanging_vertices(cell: list[int], points: list[Array]) -> list[int]:
    """Insert the vertices of other cells that lie on this cell's edges."""
    cell = list(dict.fromkeys(cell))
    full = []
    for a, b in cell_edges(cell):
        edge = points[b] - points[a]
        length = float(np.linalg.norm(edge))
        offset = np.array(points) - points[a]
        along = offset @ edge / length
        beside = np.abs(offset @ np.array([-edge[1], edge[0]])) / length
        on = np.flatnonzero((beside < 10 * WELD) & (along > WELD) & (along < length - WELD))
        full += [a, *(int(i) for i in on[np.argsort(along[on])] if i not in (a, b))]
    return full


def _split_outer_edges(
    cell: list[int], points: list[Array], shared: set[tuple[int, int]], longest: float
) -> list[int]:
    full = []
    for a, b in cell_edges(cell):
        full.append(a)
        if (b, a) not in shared:
            pieces = int(np.ceil(np.linalg.norm(points[b] - points[a]) / longest))
            for k in range(1, pieces):
                points.append(points[a] + (points[b] - points[a]) * k / pieces)
                full.append(len(points) - 1)
    return full


def largest_patch(plane: Array, cells: Sequence[list[int]]) -> list[int]:
    """Return which cells belong to the largest patch of cells that hang together by whole edges."""
    owner = {edge: k for k, cell in enumerate(cells) for edge in cell_edges(cell)}
    patches: list[list[int]] = []
    left = set(range(len(cells)))
    while left:
        patch, waiting = [], [left.pop()]
        while waiting:
            patch.append(waiting.pop())
            beside = {owner.get((b, a), -1) for a, b in cell_edges(cells[patch[-1]])} & left
            left -= beside
            waiting += beside
        patches.append(sorted(patch))
    return max(patches, key=lambda patch: sum(area(plane[cells[k]]) for k in patch))


def outline(cells: Sequence[list[int]]) -> list[int]:
    """Return the counter-clockwise loop of vertices around all cells."""
    edges = {edge for cell in cells for edge in cell_edges(cell)}
    following = {a: b for a, b in edges if (b, a) not in edges}
    loop = [min(following)]
    while following[loop[-1]] != loop[0]:
        loop.append(following[loop[-1]])
        if len(loop) > len(following):
            break
    if len(loop) != len(following):
        raise BadMesh("The part touches the bed around a hole; the jig meshes one outline.")
    return loop
