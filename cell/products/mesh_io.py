"""Reading meshes, with validation of units, soundness and plausible size; and writing them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from cell.errors import BadPart, InputError, UnknownName
from cell.paths import is_file
from cell.products.bodies import bodies_of
from cell.products.gltf import gltf_surface
from cell.products.surfaces import joined, merged

METERS_PER_UNIT = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 25.4e-3}
"""Metres per CAD unit, by the name used on the command line."""

MESH_SUFFIXES = (".obj", ".stl", ".ply", ".glb")
"""File types that are read; glTF is in metres by its specification, the others store no unit."""

UNIT_SUFFIXES = (".glb",)
"""The file types that are in metres by their specification."""

REPAIR = "repair"
"""Key in a mesh's metadata: what was done to close its surface, "" for nothing."""

LARGEST_PART = 1.0
"""[m] [D] the reach of the arms is 0.85 m: nothing here can hold a longer part."""

SMALLEST_PART = 2e-4
"""[m] [D] a tenth of the smallest bolt's diameter: units of a smaller part are wrong, probably."""

CREASE = 0.5
"""[rad] [R] edges sharper than this keep separate normals, so that they are rendered sharp."""


def meters_per_unit(units: str) -> float:
    """Return metres per unit for "mm", "cm", "m" or "in"."""
    if units not in METERS_PER_UNIT:
        raise UnknownName("unit", units, METERS_PER_UNIT)
    return METERS_PER_UNIT[units]


def load_mesh(path: Path, name: str, units: str | None = None) -> trimesh.Trimesh:
    """Read one closed surface and return it in metres.

    Args:
        path: A file of one of ``MESH_SUFFIXES``.
        name: Name of the part, for the message of an error.
        units: Unit of the file; None for that of its format, or millimetres if it has none.

    Raises:
        BadPart: If it is missing, unreadable, open or flat.
    """
    if not is_file(path):
        raise BadPart(name, f"no mesh file '{path}'")
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise BadPart(name, f"'{path.name}' is not one of {', '.join(MESH_SUFFIXES)}")
    default = "m" if path.suffix.lower() in UNIT_SUFFIXES else "mm"
    surfaces = [mesh for mesh in _surfaces(path, name).values() if len(mesh.faces)]
    if not surfaces:
        raise BadPart(name, f"'{path.name}' holds no surface")
    mesh = surfaces[0] if len(surfaces) == 1 else merged(joined(surfaces))
    mesh.apply_scale(meters_per_unit(units or default))
    bodies = bodies_of(mesh)
    if bodies.rejected:
        raise BadPart(name, f"its mesh is no solid: {bodies.rejected[0].text()}")
    mesh = bodies.as_one()[0]
    mesh.metadata[REPAIR] = bodies.repair
    return mesh


def load_surfaces(path: Path, name: str) -> list[tuple[str, trimesh.Trimesh]]:
    """Read a file's surfaces, in its unit, each with the name of its object; "" if it has one only.

    What is no surface, such as points, is a surface without faces.

    Raises:
        BadPart: It cannot be read.
    """
    by = _objects(path) if path.suffix.lower() == ".obj" else {}
    found = _surfaces(path, name, **by)
    if len(found) < 2:
        return [("", next(iter(found.values()), trimesh.Trimesh()))]
    return list(reversed(found.items()) if by else found.items())  # The reader goes backwards.


def _check_length(path: Path, name: str) -> None:
    """Raise `BadPart` for a binary STL that ends before its last triangle."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(84)
    if len(head) < 84 or head[:5].lower() == b"solid":  # Empty, or text.
        return
    stated, held = int.from_bytes(head[80:84], "little"), (size - 84) // 50
    if held < stated:
        raise BadPart(name, f"'{path.name}' is cut off: {held} of {stated} triangles")


def _why(error: Exception) -> str:
    """Return the reason of a reader's error, as far as it states one."""
    if isinstance(error, KeyError):
        return f"it lacks {error}"
    if isinstance(error, IndexError):
        return f"a face refers to a vertex that is not there: {error}"
    return str(error) or type(error).__name__


def _objects(path: Path) -> dict[str, Any]:
    """Return how to read a Wavefront file: by its objects if it has several, else by its groups."""
    found: dict[bytes, set[bytes]] = {b"o": set(), b"g": set()}
    current = {b"o": b"", b"g": b""}
    for line in path.read_bytes().splitlines():
        kind, _, rest = line.strip().partition(b" ")
        if kind in current:
            current[kind] = rest.strip()
        elif kind == b"f":
            for what, name in current.items():
                found[what].add(name)
    plain = {"group_material": False, "skip_materials": True}
    if len(found[b"o"]) > 1:
        return plain | {"split_objects": True}
    return plain | {"split_groups": True} if len(found[b"g"]) > 1 else plain


def _surfaces(path: Path, name: str, **options: Any) -> dict[str, trimesh.Trimesh]:
    """Return a file's surfaces by name, each with coincident vertices merged, in the file's unit.

    The reader gets the content and not the path: materials and textures that a file refers to are
    not needed, and may lie anywhere.
    """
    if path.suffix.lower() == ".stl":
        _check_length(path, name)
    try:
        data = path.read_bytes()
        if path.suffix.lower() == ".glb":
            return {"": merged(gltf_surface(data, path))}
        content, kind = io.BytesIO(data), path.suffix[1:].lower()
        scene = trimesh.load_scene(content, file_type=kind, process=False, **options)
        return {
            str(label): merged(shape)
            for label, shape in scene.geometry.items()
            if isinstance(shape, trimesh.Trimesh)
        }
    except InputError:
        raise
    except Exception as error:  # The readers of the formats share no exception type.
        raise BadPart(name, f"'{path.name}' cannot be read ({_why(error)})") from error


def obj_text(mesh: trimesh.Trimesh, *, normals: bool = False) -> str:
    """Return Wavefront text in metres, to 0.1 micrometre, so that it is the same on every run.

    Args:
        mesh: Surface [m].
        normals: Whether to write a normal per face corner, which the renderer needs. Positions
            stay shared between faces, so that the surface is read back watertight.
    """
    if not normals:
        return _lines("v", mesh.vertices, 7) + _repeated("f %d %d %d\n", mesh.faces + 1)
    shaded = trimesh.graph.smooth_shade(mesh, angle=CREASE)
    points, at = _distinct(shaded.vertices, 7)
    directions, along = _distinct(shaded.vertex_normals, 4)
    text = _lines("v", points, 7) + _lines("vn", directions, 4)
    corners = np.stack([at, along], axis=1)[shaded.faces] + 1
    return text + _repeated("f %d//%d %d//%d %d//%d\n", corners)


def _distinct(rows: np.ndarray, digits: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct rounded rows, sorted, and each row's index among them."""
    unique, index = np.unique(np.round(rows, digits) + 0.0, axis=0, return_inverse=True)
    return unique, index.ravel()


def _lines(tag: str, rows: np.ndarray, digits: int) -> str:
    """Return one line of numbers per row; adding zero turns -0 into 0."""
    number = f" %.{digits}f"
    return _repeated(f"{tag}{3 * number}\n", np.round(rows, digits) + 0.0)


def _repeated(line: str, rows: np.ndarray) -> str:
    """Return one line per row, formatted all at once: ten times faster than one by one."""
    return line * len(rows) % tuple(rows.ravel().tolist())
