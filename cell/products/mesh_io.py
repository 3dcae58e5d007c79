"""Reading meshes, with validation of units, soundness and plausible size; and writing them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from cell.errors import BadPart, InputError, UnknownName
from cell.products.repair import repaired

METERS_PER_UNIT = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 25.4e-3}
"""Metres per CAD unit, by the name used on the command line."""

MESH_SUFFIXES = (".obj", ".stl", ".ply", ".glb")
"""File types that are read; glTF is in metres by its specification, the others store no unit."""

UNIT_SUFFIXES = (".glb",)
"""The file types that are in metres by their specification."""

REPAIR = "repair"
"""Key in a mesh's metadata: what was done to close its surface, "" for nothing."""

LARGEST_PART = 1.0
"""[m] [D] the reach of the arms is 0.85 m: a longer part was read in wrong units."""

SMALLEST_PART = 2e-4
"""[m] [D] a tenth of the smallest bolt's diameter: a smaller part was read in wrong units."""

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
        BadPart: If it is missing, unreadable, open, flat, or implausibly large or small.
    """
    if not path.is_file():
        raise BadPart(name, f"no mesh file '{path}'")
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise BadPart(name, f"'{path.name}' is not one of {', '.join(MESH_SUFFIXES)}")
    default = "m" if path.suffix.lower() in UNIT_SUFFIXES else "mm"
    mesh = _read(path, name)
    mesh.apply_scale(meters_per_unit(units or default))
    return check_mesh(mesh, name)


def load_folder(folder: Path, units: str | None = None) -> dict[str, trimesh.Trimesh]:
    """Read every mesh of a folder in the order of names; a part's name is the file's stem.

    Files of other types are ignored.
    """
    files = [f for f in sorted(folder.iterdir()) if f.suffix.lower() in MESH_SUFFIXES]
    if not files:
        kinds = ", ".join(MESH_SUFFIXES)
        raise InputError(f"Folder '{folder}' holds no mesh; supported: {kinds}.")
    without = [file.name for file in files if file.suffix.lower() not in UNIT_SUFFIXES]
    if units is None and without:
        known = ", ".join(METERS_PER_UNIT)
        raise InputError(f"'{without[0]}' states no unit of length: add --units, one of {known}.")
    meshes: dict[str, trimesh.Trimesh] = {}
    for file in files:
        if file.stem in meshes:
            raise BadPart(file.stem, f"two files of that name in '{folder}'")
        meshes[file.stem] = load_mesh(file, file.stem, units)
    return meshes


def check_mesh(mesh: trimesh.Trimesh, name: str) -> trimesh.Trimesh:
    """Return the mesh, facing outwards, or raise ``BadPart`` if it bounds no plausible solid.

    A surface that a safe repair closes is repaired; ``metadata[REPAIR]`` says how.
    """
    size = float(np.max(mesh.extents)) if len(mesh.faces) else 0.0
    if not np.isfinite(mesh.vertices).all() or size == 0.0:
        raise BadPart(name, "the mesh has no faces, or corners that are not numbers")
    mesh, repair = repaired(mesh)
    if not (mesh.is_watertight and mesh.is_winding_consistent):
        raise BadPart(name, "the mesh is not watertight" + _open_edges(mesh))
    mesh.metadata[REPAIR] = repair
    with np.errstate(invalid="ignore"):  # The centre of mass of nothing is not a number.
        volume = float(mesh.volume)
    if not abs(volume) > 1e-9 * size**3:
        raise BadPart(name, "the mesh encloses no volume")
    if size > LARGEST_PART:
        raise BadPart(name, f"it is {size:.3g} m long, larger than the cell: wrong units, probably")
    if size < SMALLEST_PART:
        raise BadPart(name, f"it is only {size * 1e6:.3g} micrometres long: wrong units, probably")
    if volume < 0.0:  # A closed surface that faces inwards is common in STL and unambiguous.
        mesh.invert()
    return mesh


def _open_edges(mesh: trimesh.Trimesh) -> str:
    """Return how many edges are not shared by exactly two faces, and where the first of them is."""
    edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    edges = edges[count != 2]
    if not len(edges):
        return ""
    x, y, z = 1e3 * np.asarray(mesh.vertices)[edges[0]].mean(axis=0)
    return f": {len(edges)} open edges, one of them at ({x:.3g}, {y:.3g}, {z:.3g}) mm"


def _read(path: Path, name: str) -> trimesh.Trimesh:
    """Return the file's surface with coincident vertices merged, in the file's unit."""
    try:
        mesh = trimesh.load_mesh(path, process=False)
    except Exception as error:  # The readers of the formats share no exception type.
        raise BadPart(name, f"'{path.name}' cannot be read ({error})") from error
    mesh = mesh.to_mesh() if isinstance(mesh, trimesh.Scene) else mesh
    if not isinstance(mesh, trimesh.Trimesh):
        raise BadPart(name, f"'{path.name}' holds no surface")
    return merged(mesh)


def merged(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a surface with coincident vertices merged, whatever their normals and colours."""
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    surface.merge_vertices(merge_norm=True, merge_tex=True)
    return surface


def obj_text(mesh: trimesh.Trimesh, *, normals: bool = False) -> str:
    """Return Wavefront text in metres, to 0.1 micrometre, so that it is the same on every run.

    Args:
        mesh: Surface [m].
        normals: Whether to write a normal per face corner, which the renderer needs. Positions
            stay shared between faces, so that the surface is read back watertight.
    """
    if not normals:
        corners = [" ".join(str(i + 1) for i in face) for face in mesh.faces]
        return _lines("v", mesh.vertices, 7) + "".join(f"f {c}\n" for c in corners)
    shaded = trimesh.graph.smooth_shade(mesh, angle=CREASE)
    points, at = _distinct(shaded.vertices, 7)
    directions, along = _distinct(shaded.vertex_normals, 4)
    corners = [" ".join(f"{at[i] + 1}//{along[i] + 1}" for i in face) for face in shaded.faces]
    text = _lines("v", points, 7) + _lines("vn", directions, 4)
    return text + "".join(f"f {c}\n" for c in corners)


def _distinct(rows: np.ndarray, digits: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct rounded rows, sorted, and each row's index among them."""
    unique, index = np.unique(np.round(rows, digits) + 0.0, axis=0, return_inverse=True)
    return unique, index.ravel()


def _lines(tag: str, rows: np.ndarray, digits: int) -> str:
    """Return one line of numbers per row; adding zero turns -0 into 0."""
    rounded = np.round(rows, digits) + 0.0
    return "".join(f"{tag} " + " ".join(f"{v:.{digits}f}" for v in row) + "\n" for row in rounded)
