"""Surfaces as readers of files give them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

FARTHEST = 1e12
"""[A] Coordinate, in the unit of a file: beyond it neither merging nor volumes are computed."""


def merged(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a surface with coincident vertices merged, whatever their normals and colours.

    Raises:
        ValueError: A face has a vertex that is not there, or a vertex lies beyond `FARTHEST`.
    """
    faces = np.asarray(mesh.faces)
    if len(faces) and not 0 <= faces.min() <= faces.max() < len(mesh.vertices):
        raise ValueError(f"a face has a vertex that is not among its {len(mesh.vertices)}")
    size = np.abs(mesh.vertices)
    if np.any(size[np.isfinite(size)] > FARTHEST):
        raise ValueError(f"a coordinate of {size[np.isfinite(size)].max():.3g} is no place")
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    surface.merge_vertices(merge_norm=True, merge_tex=True)
    return surface


def joined(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return several surfaces as one, without merging their corners."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [np.asarray(m.faces) + n for m, n in zip(meshes, starts, strict=True)]
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    return trimesh.Trimesh(vertices, np.concatenate(faces), process=False)
