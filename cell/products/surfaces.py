"""Surfaces as readers of files give them."""

from __future__ import annotations

import trimesh


def merged(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a surface with coincident vertices merged, whatever their normals and colours."""
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    surface.merge_vertices(merge_norm=True, merge_tex=True)
    return surface
