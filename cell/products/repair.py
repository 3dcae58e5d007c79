"""Repairs of surfaces as CAD exports them, where nothing about the shape has to be guessed.

Vertices within rounding of each other are merged; degenerate and doubled faces are dropped; faces
of inconsistent winding are turned. Holes in the surface are left open: their shape is the
designer's to decide. Faces are rows of vertex indices, (m, 3).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

WELDS = (1e-9, 1e-8, 1e-7, 1e-6)
"""[m] tried in turn: rounding of float64, and of float32 in metres and in millimetres."""


def welded(
    vertices: np.ndarray, faces: np.ndarray, distance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) and faces with vertices merged that lie in one cell of a grid [m]."""
    cells = np.round(vertices / distance)
    _, first, index = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    return vertices[first], index.ravel()[faces]


def without_slivers(faces: np.ndarray) -> np.ndarray:
    """Return the faces that have three different corners."""
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)]


def without_doubled(faces: np.ndarray) -> np.ndarray:
    """Return the faces without those whose three corners an earlier one has."""
    _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return faces[np.sort(once)]


def wound_alike(faces: np.ndarray, pairs: np.ndarray, opposed: np.ndarray) -> np.ndarray:
    """Return the faces of connected surfaces, each wound like the first of its surface.

    Args:
        faces: (m, 3).
        pairs: (e, 2) faces on either side of each edge.
        opposed: (e,) whether the two traverse their edge in opposite senses, as they should.
    """
    count = len(faces)
    ends = (np.r_[pairs[:, 0], pairs[:, 1]], np.r_[pairs[:, 1], pairs[:, 0]])
    weights = np.tile(np.where(opposed, 1.0, 2.0), 2)
    graph = csr_array((weights, ends), shape=(count, count))
    turned, seen = np.zeros(count, bool), np.zeros(count, bool)
    while not seen.all():
        order, before = breadth_first_order(graph, int(seen.argmin()), directed=False)
        seen[order] = True
        for face in order[1:]:
            turned[face] = turned[before[face]] != (graph[before[face], face] > 1.5)
    wound = faces.copy()
    wound[turned] = wound[turned][:, ::-1]
    return wound
