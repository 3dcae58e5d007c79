"""Reading assemblies from one file, STEP or glTF, as triangle meshes named by instance.

OpenCASCADE, through ``cascadio``, converts STEP to glTF, which is in metres by its specification,
whatever the unit of the STEP file.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain, count
from pathlib import Path

import trimesh

from cell.errors import InputError
from cell.products.mesh_io import check_mesh, merged

GLTF_SUFFIX = ".glb"
ASSEMBLY_SUFFIXES = (".step", ".stp", GLTF_SUFFIX)

DEFLECTION = 0.005
"""[mm] [D] a tenth of the usual tolerance on fits."""

FACET_ANGLE = 0.25
"""[rad] [D] for small circles. OpenCASCADE keeps to half of both limits [M]: 51 facets a turn have
a sagitta of r/527, below the r/500 that counts as line to line even between parts of that size.
From 1.3 mm on, ``DEFLECTION`` asks for more: 109 facets on a hole of 12 mm."""

# Names that exporters generate for instances without one.
GENERATED_NAME = re.compile(r"NAUO\d*|=>\[.*\]|\d*|Solid\d*|Open CASCADE.*", re.IGNORECASE)


def load_assembly(file: Path) -> dict[str, trimesh.Trimesh]:
    """Read every solid of a file, in its assembled pose [m], by the name of its instance.

    An instance without a name takes that of its product; a name that is taken gets a number.
    Characters other than letters, digits, ".", "-" and "_" become "_", so that names can be listed
    in an order.

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
        label = product if GENERATED_NAME.fullmatch(str(node)) else str(node)
        label = re.sub(r"[^\w.-]+", "_", label).strip("_") or "part"
        names = chain([label], (f"{label}_{k}" for k in count(2)))
        name = next(name for name in names if name not in meshes)
        surface = merged(shape)
        surface.apply_transform(X_AP)
        meshes[name] = check_mesh(surface, name)
    if not meshes:
        raise InputError(f"'{file}' holds no solid.")
    return dict(sorted(meshes.items(), key=lambda item: _natural(item[0])))


def _scene(file: Path) -> trimesh.Scene:
    """Return the content of a STEP or glTF file, in metres."""
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
    except Exception as error:  # The reader documents no exceptions of its own.
        raise InputError(f"'{file}' is not a glTF file that can be read.") from error
    if not scene.geometry:
        raise InputError(f"'{file}' holds no solid.")
    return scene


def _converted(data: bytes) -> bytes:
    """Return a STEP file as binary glTF; empty if it is not a STEP file."""
    import cascadio  # Takes 0.1 s to load, which only STEP files need.

    with _without_output():
        return cascadio.load(
            data, tol_linear=DEFLECTION, tol_angular=FACET_ANGLE, use_parallel=False
        )


@contextmanager
def _without_output() -> Iterator[None]:
    """Discard what OpenCASCADE writes to the process's standard streams."""
    with open(os.devnull, "w") as null:
        saved = [os.dup(stream) for stream in (1, 2)]
        try:
            for stream in (1, 2):
                os.dup2(null.fileno(), stream)
            yield
        finally:
            for stream, copy in zip((1, 2), saved, strict=True):
                os.dup2(copy, stream)
                os.close(copy)


def _natural(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts bolt_2 before bolt_10."""
    pieces = re.split(r"(\d+)", name)
    return [(int(piece), "") if piece.isdigit() else (-1, piece) for piece in pieces]
