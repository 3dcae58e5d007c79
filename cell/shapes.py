"""Drake's shapes as triangles."""

from __future__ import annotations

import trimesh
from pydrake.geometry import Box, Capsule, Convex, Cylinder, Mesh, Shape, Sphere


def shape_mesh(shape: Shape) -> trimesh.Trimesh:
    """Return the surface of a shape, in its own frame [m].

    Raises:
        TypeError: There is none: a half-space, for example.
    """
    if isinstance(shape, Box):
        return trimesh.creation.box(shape.size())
    if isinstance(shape, Sphere):
        return trimesh.creation.icosphere(radius=shape.radius())
    if isinstance(shape, Cylinder):
        return trimesh.creation.cylinder(shape.radius(), shape.length())
    if isinstance(shape, Capsule):
        return trimesh.creation.capsule(shape.length(), shape.radius())
    if not isinstance(shape, Mesh | Convex):
        raise TypeError(f"{type(shape).__name__} has no surface of triangles.")
    source = shape.source()
    file = (
        source.path()
        if source.is_path()
        else trimesh.util.wrap_as_stream(source.in_memory().mesh_file.contents())
    )
    kind = shape.extension().removeprefix(".")
    mesh = trimesh.load_mesh(file, file_type=kind, force="mesh", process=False)
    mesh.apply_scale(shape.scale3())
    return mesh
