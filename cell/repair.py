"""Repairs of surfaces as CAD exports them, where nothing about the shape has to be guessed.

Corners within rounding of each other are one corner; faces that have lost an edge by that, and
faces that occur twice, go; faces that look inwards among faces that look outwards are turned. A
hole in the surface is not closed: what belongs there is for the designer to say.
"""

from __future__ import annotations

import numpy as np
import trimesh

WELDS = (1e-9, 1e-8, 1e-7, 1e-6)  # [m] Tried in turn: rounding of double, of float32 in m, in mm.


def repaired(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, str]:
    """Return a closed surface, and what was done to it; as it is if nothing safe closes it.

    Args:
        mesh: Surface [m], coincident corners joined.
    """
    if _sound(mesh):
        return mesh, ""
    for distance in WELDS:
        fixed = _cleaned(mesh, distance)
        if fixed.is_watertight and not fixed.is_winding_consistent:
            trimesh.repair.fix_winding(fixed)
        if _sound(fixed):
            return fixed, _remark(mesh, fixed, distance)
    return mesh, ""


def _sound(mesh: trimesh.Trimesh) -> bool:
    return bool(mesh.is_watertight and mesh.is_winding_consistent)


def _cleaned(mesh: trimesh.Trimesh, distance: float) -> trimesh.Trimesh:
    """Return the surface with corners welded, and without faces that are lines or doubled."""
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


def _remark(mesh: trimesh.Trimesh, fixed: trimesh.Trimesh, distance: float) -> str:
    corners = len(mesh.vertices) - len(fixed.vertices)
    faces = len(mesh.faces) - len(fixed.faces)
    done = [f"{corners} corners welded within {1e6 * distance:g} um"] if corners else []
    done += [f"{faces} degenerate or doubled faces removed"] if faces else []
    if not np.array_equal(fixed.faces, mesh.faces) and not done:
        done = ["faces turned outwards"]
    return ", ".join(done)
