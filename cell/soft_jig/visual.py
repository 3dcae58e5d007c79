"""The membrane as a triangle mesh for Meshcat and the renderers."""

from __future__ import annotations

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from cell.soft_jig.bed import Bed


def membrane_obj(bed: Bed) -> str:
    """Return the bed's surface, down to the base plate at its border, as Wavefront text."""
    n = len(bed.axis)
    used = bed.active.copy()
    used[1:-1, 1:-1] |= (
        bed.active[:-2, 1:-1] | bed.active[2:, 1:-1] | bed.active[1:-1, :-2] | bed.active[1:-1, 2:]
    )
    number = np.zeros((n, n), dtype=np.int64)
    number[used] = np.arange(1, used.sum() + 1)
    points = np.column_stack([bed.x[used], bed.y[used], bed.heights[used]])
    whole = used[:-1, :-1] & used[1:, :-1] & used[:-1, 1:] & used[1:, 1:]
    a, b = number[:-1, :-1][whole], number[1:, :-1][whole]
    c, d = number[1:, 1:][whole], number[:-1, 1:][whole]
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    dx, dy = np.gradient(bed.heights, bed.bag.cell)
    normals = np.column_stack([-dx[used], -dy[used], np.ones(len(points))])
    lines = "v %.6g %.6g %.6g\n" * len(points) % tuple(points.ravel())
    lines += "vn %.4g %.4g %.4g\n" * len(points) % tuple(normals.ravel())
    corners = np.repeat(faces.ravel(), 2)
    return lines + "f %d//%d %d//%d %d//%d\n" * len(faces) % tuple(corners)


def membrane_shape(bed: Bed) -> Mesh:
    """Return the bed's surface as a Drake shape."""
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(membrane_obj(bed), ".obj", "membrane")))
