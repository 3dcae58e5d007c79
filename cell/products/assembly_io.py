"""Assemblies in one file, STEP or glTF: names, instances and units as in the file, as triangles.

OpenCASCADE reads STEP, through ``cascadio``; what it hands over is glTF, in metres by its
specification, whatever the unit of the file.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import trimesh

from cell.errors import InputError
from cell.products.mesh_io import check_mesh, joined

GLTF_SUFFIX = ".glb"
ASSEMBLY_SUFFIXES = (".step", ".stp", GLTF_SUFFIX)

DEFLECTION = 0.005  # [mm] [D] A tenth of the usual tolerance on fits.
FACET_ANGLE = 0.1  # [rad] [D] 63 facets a turn: 7 um of sagitta on a hole of 12 mm.

# Names that exporters make up where the designer gave the instance none.
NAMELESS = re.compile(r"NAUO\d*|=>\[.*\]|\d*|Solid\d*|Open CASCADE.*", re.IGNORECASE)


def load_assembly(file: Path) -> dict[str, trimesh.Trimesh]:
    """Read every solid of a file, in its assembled pose [m], by the name of its instance.

    An instance without a name has that of its product; the second of two with one name gets a
    number. Names keep their letters and digits; all else becomes "_", so that they can be listed in
    an order.

    Raises:
        InputError: The file cannot be read, or holds no solid.
        BadPart: A solid is open, flat, or implausibly large or small.
    """
    scene = _scene(file)
    meshes: dict[str, trimesh.Trimesh] = {}
    for node in scene.graph.nodes_geometry:
        X_AP, geometry = scene.graph[node]
        product = str(geometry)
        shape = scene.geometry[product]
        if not isinstance(shape, trimesh.Trimesh):
            continue
        name = _unused(_name(node, product), meshes)
        surface = joined(shape)
        surface.apply_transform(X_AP)
        meshes[name] = check_mesh(surface, name)
    if not meshes:
        raise InputError(f"'{file}' holds no solid.")
    return dict(sorted(meshes.items(), key=lambda item: _natural(item[0])))


def _scene(file: Path) -> trimesh.Scene:
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError(f"'{file}' cannot be read: {error.strerror}.") from error
    binary = data
    if file.suffix.lower() != GLTF_SUFFIX and not (binary := _converted(data)):
        raise InputError(f"'{file}' is not a STEP file that can be read.")
    try:
        scene = trimesh.load_scene(
            io.BytesIO(binary), file_type="glb", process=False, merge_primitives=True
        )
    except Exception as error:  # The reader raises whatever it likes, in its own words.
        raise InputError(f"'{file}' is not a glTF file that can be read.") from error
    if not scene.geometry:
        raise InputError(f"'{file}' holds no solid.")
    return scene


def _converted(data: bytes) -> bytes:
    """Return a STEP file as binary glTF; empty if it is none."""
    import cascadio  # Takes 0.1 s to load, which only STEP files need.

    with _without_output():
        return cascadio.load(
            data, tol_linear=DEFLECTION, tol_angular=FACET_ANGLE, use_parallel=False
        )


@contextmanager
def _without_output() -> Iterator[None]:
    """Keep OpenCASCADE's own messages, which go to the process's streams, off the terminal."""
    with open(os.devnull, "w") as nowhere:
        saved = [os.dup(stream) for stream in (1, 2)]
        try:
            for stream in (1, 2):
                os.dup2(nowhere.fileno(), stream)
            yield
        finally:
            for stream, copy in zip((1, 2), saved, strict=True):
                os.dup2(copy, stream)
                os.close(copy)


def _name(instance: str, product: str) -> str:
    name = product if NAMELESS.fullmatch(instance) else instance
    return re.sub(r"[^\w.-]+", "_", name).strip("_") or "part"


def _unused(name: str, taken: dict[str, trimesh.Trimesh]) -> str:
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name}_{number}"
    return free


def _natural(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts bolt_2 before bolt_10."""
    pieces = re.split(r"(\d+)", name)
    return [(int(piece), "") if piece.isdigit() else (-1, piece) for piece in pieces]
