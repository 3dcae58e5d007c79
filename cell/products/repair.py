"""Repairs of meshes as CAD exports them, where nothing about the shape has to be guessed.

Vertices within rounding of each other are merged; degenerate and duplicate faces are removed; faces
of inconsistent winding are flipped. Holes in the surface are left open: their shape is the
designer's to decide.
"""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

WELDS = (1e-9, 1e-8, 1e-7, 1e-6)
"""[m] tried in turn: rounding of float64, and of float32 in metres and in millimetres."""


def repaired(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, str]:
    """Return a closed surface and a remark on the repair; the mesh itself if none closes it.

    Args:
        mesh: Surface [m], coincident vertices merged.

    Returns:
        The surface and what was done to it, "" for nothing.
    """
    if _sound(mesh):
        return mesh, ""
    for distance in WELDS:
        fixed = _cleaned(mesh, distance)
        if fixed.is_watertight and not fixed.is_winding_consistent:
            fixed = _wound(fixed)
        if _sound(fixed):
            return fixed, _remark(mesh, fixed, distance)
    return mesh, ""


def _sound(mesh: trimesh.Trimesh) -> bool:
    return bool(mesh.is_watertight and mesh.is_winding_consistent)


def _cleaned(mesh: trimesh.Trimesh, distance: float) -> trimesh.Trimesh:
    """Return the surface with vertices merged, and without degenerate and duplicate faces."""
    cells = np.round(np.asarray(mesh.vertices) / distance)
    _, first, index = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    faces = index.ravel()[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    faces = faces[np.sort(once)]
    fixed = trimesh.Trimesh(np.asarray(mesh.vertices)[first], faces, process=False)
    fixed.remove_unreferenced_vertices()
    return fixed


def _wound(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the surface with the faces of each body wound like the first of them."""
    faces, pairs = np.array(mesh.faces), np.asarray(mesh.face_adjacency)
    # Two faces agree if they traverse their common edge in opposite senses.
    agree = np.array(
        [
            _runs_along(faces[a], edge) != _runs_along(faces[b], edge)
            for (a, b), edge in zip(pairs, mesh.face_adjacency_edges, strict=True)
        ]
    )
    count = len(faces)
    ends = (np.r_[pairs[:, 0], pairs[:, 1]], np.r_[pairs[:, 1], pairs[:, 0]])
    weights = np.tile(np.where(agree, 1.0, 2.0), 2)
    graph = csr_array((weights, ends), shape=(count, count))
    turned, seen = np.zeros(count, bool), np.zeros(count, bool)
    while not seen.all():
        order, before = breadth_first_order(graph, int(seen.argmin()), directed=False)
        seen[order] = True
        for face in order[1:]:
            turned[face] = turned[before[face]] != (graph[before[face], face] > 1.5)
    faces[turned] = faces[turned][:, ::-1]
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def _runs_along(face: np.ndarray, edge: np.ndarray) -> bool:
    """Return whether a face traverses one of its edges in the sense in which the edge is given."""
    start = int(np.flatnonzero(face == edge[0])[0])
    return bool(face[(start + 1) % 3] == edge[1])


def _remark(mesh: trimesh.Trimesh, fixed: trimesh.Trimesh, distance: float) -> str:
    corners = len(mesh.vertices) - len(fixed.vertices)
    faces = len(mesh.faces) - len(fixed.faces)
    done = [f"{corners} corners welded within {1e6 * distance:g} um"] if corners else []
    done += [f"{faces} degenerate or doubled faces removed"] if faces else []
    if not np.array_equal(fixed.faces, mesh.faces) and not done:
        done = ["faces turned outwards"]
    return ", ".join(done)
