"""Meshes at the door: units, soundness and plausible size are checked here and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from cell.errors import BadPart, CellError, UnknownName

METERS_PER_UNIT = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 25.4e-3}
"""Metres per CAD unit, by the name used on the command line."""

MESH_SUFFIXES = (".obj", ".stl", ".ply", ".glb")
"""File types that are read; glTF is in metres by its specification, the others store no unit."""

LARGEST_PART = 1.0
"""[m] [D] the reach of the arms is 0.85 m: a longer part is a part in wrong units."""

SMALLEST_PART = 2e-4
"""[m] [D] a tenth of the smallest bolt's diameter: a smaller part is a part in wrong units."""

CREASE = 0.5
"""[rad] [R] edges sharper than this stay sharp in pictures (Drake renders need normals)."""


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
        units: Unit of the file; None for millimetres, or metres in the case of .glb.

    Raises:
        BadPart: If it is missing, unreadable, open, flat, or implausibly large or small.
    """
    if not path.is_file():
        raise BadPart(name, f"no mesh file '{path}'")
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise BadPart(name, f"'{path.name}' is not one of {', '.join(MESH_SUFFIXES)}")
    default = "m" if path.suffix.lower() == ".glb" else "mm"
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
        raise CellError(f"Folder '{folder}' holds no mesh; supported: {kinds}.")
    meshes: dict[str, trimesh.Trimesh] = {}
    for file in files:
        if file.stem in meshes:
            raise BadPart(file.stem, f"two files of that name in '{folder}'")
        meshes[file.stem] = load_mesh(file, file.stem, units)
    return meshes


def check_mesh(mesh: trimesh.Trimesh, name: str) -> trimesh.Trimesh:
    """Return the mesh, facing outwards, or raise ``BadPart`` if it bounds no plausible solid."""
    size = float(np.max(mesh.extents)) if len(mesh.faces) else 0.0
    if not np.isfinite(size) or size == 0.0:
        raise BadPart(name, "the mesh has no faces")
    if not (mesh.is_watertight and mesh.is_winding_consistent):
        raise BadPart(name, "the mesh is not watertight")
    with np.errstate(invalid="ignore"):  # The centre of mass of nothing is not a number.
        volume = float(mesh.volume)
    if not abs(volume) > 1e-9 * size**3:
        raise BadPart(name, "the mesh encloses no volume")
    if size > LARGEST_PART:
        raise BadPart(name, f"it is {size:.3g} m long, larger than the cell: wrong units?")
    if size < SMALLEST_PART:
        raise BadPart(name, f"it is only {size * 1e6:.3g} micrometres long: wrong units?")
    if volume < 0.0:  # A closed surface that faces inwards is common in STL and unambiguous.
        mesh.invert()
    return mesh


def _read(path: Path, name: str) -> trimesh.Trimesh:
    """Return the file's surface with coincident vertices joined, in the file's unit."""
    try:
        mesh = trimesh.load_mesh(path, process=False)
    except Exception as error:  # Readers of six formats raise whatever they like.
        raise BadPart(name, f"'{path.name}' cannot be read ({error})") from error
    mesh = mesh.to_mesh() if isinstance(mesh, trimesh.Scene) else mesh
    if not isinstance(mesh, trimesh.Trimesh):
        raise BadPart(name, f"'{path.name}' holds no surface")
    joined = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    joined.merge_vertices(merge_norm=True, merge_tex=True)
    return joined


def obj_text(mesh: trimesh.Trimesh, *, normals: bool = False) -> str:
    """Return Wavefront text in metres, to 0.1 micrometre, so that it is the same on every run.

    Args:
        mesh: Surface [m].
        normals: Write a normal per corner, which the renderer needs. Positions stay shared
            between faces, so that the surface is read back watertight.
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
