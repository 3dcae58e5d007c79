"""Surfaces as readers of files give them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh


def merged(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a surface with coincident vertices merged, whatever their normals and colours."""
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    surface.merge_vertices(merge_norm=True, merge_tex=True)
    return surface


def joined(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return several surfaces as one, without merging their corners."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [np.asarray(m.faces) + n for m, n in zip(meshes, starts, strict=True)]
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    return trimesh.Trimesh(vertices, np.concatenate(faces), process=False)
