"""The membrane as a triangle mesh for Meshcat and the renderers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from cell.soft_jig.bed import Bed

Array = NDArray[np.float64]

# Facets around the membrane.
SECTORS = 96


def membrane_obj(bed: Bed) -> str:
    """Return the bed's surface as Wavefront text: rings of quads out to a round hem on the base."""
    rings = round(bed.bag.aperture_radius / bed.bag.cell)
    radius = np.linspace(0.0, bed.bag.aperture_radius, rings + 1)[1:]
    angle = np.arange(SECTORS) * 2 * np.pi / SECTORS
    ray = np.column_stack([np.cos(angle), np.sin(angle)])
    xy = (radius[:, None, None] * ray).reshape(-1, 2)
    xy = np.concatenate([np.zeros((1, 2)), xy])
    points = np.column_stack([xy, bed.height_at(xy)])
    points[-SECTORS:, 2] = 0.0
    number = 2 + np.arange(rings * SECTORS).reshape(rings, SECTORS)
    after = np.roll(number, -1, axis=1)
    fan = np.column_stack([np.ones(SECTORS, dtype=np.int64), number[0], after[0]])
    a, b = number[:-1].ravel(), number[1:].ravel()
    c, d = after[1:].ravel(), after[:-1].ravel()
    faces = np.concatenate([fan, np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    lines = "v %.6g %.6g %.6g\n" * len(points) % tuple(points.ravel())
    lines += "vn %.4g %.4g %.4g\n" * len(points) % tuple(_normals(points, faces - 1).ravel())
    return lines + "f %d//%d %d//%d %d//%d\n" * len(faces) % tuple(np.repeat(faces.ravel(), 2))


def _normals(points: Array, faces: NDArray[np.int64]) -> Array:
    """Return a unit normal per vertex (n, 3): the mean over its faces, by area."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.zeros_like(points)
    np.add.at(normals, faces, np.cross(b - a, c - a)[:, None, :])
    return normals / np.linalg.norm(normals, axis=1)[:, None]


def membrane_shape(bed: Bed) -> Mesh:
    """Return the bed's surface as a Drake shape."""
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(membrane_obj(bed), ".obj", "membrane")))
