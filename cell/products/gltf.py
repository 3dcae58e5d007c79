"""Reading binary glTF as a tree of parts; it is in metres by its specification."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from cell.errors import InputError
from cell.products.surfaces import FARTHEST, joined, merged
from cell.products.tree import Node, Surface

TRIANGLES, TRIANGLE_STRIP = 4, 5

LARGEST_INTEGER = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}
"""What a normalised integer of each component type counts as one [R] (glTF 2.0, 3.11)."""

MOST_NODES = 100_000
"""[A] Instances in a file, twenty times the parts that are planned."""

COMPRESSED = {
    "KHR_draco_mesh_compression": "is compressed with Draco",
    "EXT_meshopt_compression": "is compressed with meshopt",
    "KHR_meshopt_compression": "is compressed with meshopt",
    "EXT_mesh_gpu_instancing": "repeats parts by EXT_mesh_gpu_instancing",
}


def gltf_tree(data: bytes, file: Path) -> Node:
    """Return the tree of a binary glTF file [m], with names as the file gives them.

    Args:
        data: Content of the file.
        file: For messages.

    Raises:
        InputError: It cannot be read.
    """
    try:
        magic, _, _, size, kind = struct.unpack_from("<4sII I4s", data)
        if magic != b"glTF" or kind != b"JSON":
            raise ValueError("not binary glTF")
        header = json.loads(data[20 : 20 + size])
        _refuse_compression(header, file)
        _check_counts(header, len(data), file)
        surfaces = _surfaces(header, data[20 + size :])
        return Node(children=tuple(_children(header, _roots(header), np.eye(4), surfaces)))
    except InputError:
        raise
    except Exception as error:  # The reader documents no exceptions of its own.
        raise InputError(f"'{file}' is not a glTF file that can be read.") from error


def gltf_surface(data: bytes, file: Path) -> trimesh.Trimesh:
    """Return everything in a binary glTF file as one surface [m], as `gltf_tree` reads it."""

    def placed(node: Node) -> Iterator[trimesh.Trimesh]:
        for surface in node.surfaces:
            yield surface.mesh.copy().apply_transform(surface.X_AP)
        for child in node.children:
            yield from placed(child)

    return joined([trimesh.Trimesh(), *placed(gltf_tree(data, file))])


def _check_counts(header: Mapping[str, Any], size: int, file: Path) -> None:
    """Refuse a file whose content would outgrow any memory.

    Args:
        header: Of the file.
        size: Of its binary part [byte].
        file: For messages.

    Raises:
        InputError: An accessor has more items than the file has bytes, or nodes that are repeated
            in nodes that are repeated add up to more than `MOST_NODES`.
    """
    for k, accessor in enumerate(header.get("accessors", [])):
        if not 0 <= accessor["count"] <= size:
            raise InputError(f"'{file}' says that accessor {k} has {accessor['count']} items.")
    nodes, counts = header.get("nodes", []), {}

    def count(index: int) -> int:
        if index not in counts:
            counts[index] = MOST_NODES  # While it is counted: in a circle it never ends.
            counts[index] = 1 + sum(map(count, nodes[index].get("children", [])))
        return counts[index]

    if sum(map(count, _roots(header))) > MOST_NODES:
        raise InputError(f"'{file}' has more than {MOST_NODES} nodes, or nodes in a circle.")


def _refuse_compression(header: Mapping[str, Any], file: Path) -> None:
    accessors = header.get("accessors", [])
    found = [
        *(ext for view in header.get("bufferViews", []) for ext in view.get("extensions", {})),
        *(ext for node in header.get("nodes", []) for ext in node.get("extensions", {})),
        *(
            ext
            for mesh in header.get("meshes", [])
            for primitive in mesh["primitives"]
            for ext in primitive.get("extensions", {})
            if "bufferView" not in accessors[primitive["attributes"]["POSITION"]]
        ),
    ]
    for extension in found:
        if extension in COMPRESSED:
            what = COMPRESSED[extension]
            raise InputError(f"'{file}' {what}, which cannot be read here: export it without.")


def _surfaces(header: Mapping[str, Any], binary: bytes) -> list[trimesh.Trimesh | None]:
    """Return the surface of each mesh, merged from its primitives; meshes that are equal share it.

    Only positions and faces are read; a mesh of lines or points has no surface.
    """
    keys = [
        tuple(
            (primitive["attributes"]["POSITION"], primitive.get("indices"), mode)
            for primitive in mesh["primitives"]
            if (mode := primitive.get("mode", TRIANGLES)) in (TRIANGLES, TRIANGLE_STRIP)
        )
        for mesh in header.get("meshes", [])
    ]
    wanted = sorted({key for group in keys for key in group}, key=str)
    scene = _loaded(header, binary, wanted)
    shapes: dict[tuple[Any, ...], trimesh.Trimesh] = {
        group: merged(joined([scene[wanted.index(key)] for key in group]))
        for group in set(keys)
        if group
    }
    return [shapes.get(group) for group in keys]


def _loaded(
    header: Mapping[str, Any], binary: bytes, wanted: list[tuple[int, int | None, int]]
) -> list[trimesh.Trimesh]:
    """Return primitives, given by accessors of positions and indices, as meshes."""
    if not wanted:
        return []
    meshes = [
        {
            "name": str(k),
            "primitives": [
                {"attributes": {"POSITION": position}, "mode": mode}
                | ({} if indices is None else {"indices": indices})
            ],
        }
        for k, (position, indices, mode) in enumerate(wanted)
    ]
    plain = {
        "asset": {"version": "2.0"},
        **{key: header[key] for key in ("buffers", "bufferViews", "accessors") if key in header},
        "meshes": meshes,
        "nodes": [{"mesh": k, "name": str(k)} for k in range(len(meshes))],
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "scene": 0,
    }
    text = json.dumps(plain).encode()
    text += b" " * (-len(text) % 4)
    size = 20 + len(text) + len(binary)
    glb = struct.pack("<4sII I4s", b"glTF", 2, size, len(text), b"JSON") + text + binary
    scene = trimesh.load_scene(io.BytesIO(glb), file_type="glb", process=False, skip_materials=True)
    loaded = []
    for k, (position, _, _) in enumerate(wanted):
        mesh = scene.geometry[str(k)]
        accessor = header["accessors"][position]
        if accessor.get("normalized"):
            mesh.vertices = mesh.vertices / LARGEST_INTEGER[accessor["componentType"]]
        loaded.append(mesh)
    return loaded


def _roots(header: Mapping[str, Any]) -> list[int]:
    if scenes := header.get("scenes"):
        return scenes[header.get("scene", 0)].get("nodes", [])
    children = {child for node in header.get("nodes", []) for child in node.get("children", [])}
    return [k for k in range(len(header.get("nodes", []))) if k not in children]


def _children(
    header: Mapping[str, Any],
    indices: list[int],
    X_AF: np.ndarray,
    surfaces: list[trimesh.Trimesh | None],
) -> Iterator[Node]:
    """Yield the nodes of some indices, in the frame F of their parent."""
    for index in indices:
        entry = header["nodes"][index]
        X_AP = X_AF @ _pose(entry)
        if not np.abs(X_AP).max() <= FARTHEST:
            raise ValueError("a pose that is no place")
        given, product, own = str(entry.get("name", "")), "", ()
        if "mesh" in entry:
            product = str(header["meshes"][entry["mesh"]].get("name", ""))
            surface = surfaces[entry["mesh"]]
            own = () if surface is None else (Surface(surface, X_AP),)
        children = tuple(_children(header, entry.get("children", []), X_AP, surfaces))
        lacking = "" if own else "lines or points" if "mesh" in entry else "empty"
        part = Node(given, product, own, (), lacking, X_AP)
        if not children:
            if "mesh" in entry or not _is_other(entry):
                yield part
        else:
            inner = (part, *children) if "mesh" in entry else children
            yield Node(given, product, (), inner, "", X_AP)


def _is_other(entry: Mapping[str, Any]) -> bool:
    """Return whether a node is a camera, a light or a joint of a skeleton: no object."""
    return "camera" in entry or bool(entry.get("extensions"))


def _pose(entry: Mapping[str, Any]) -> np.ndarray:
    """Return a node's pose (4, 4) in its parent: a matrix by columns, or its three factors."""
    if "matrix" in entry:
        return np.array(entry["matrix"], float).reshape(4, 4).T
    X = np.eye(4)
    if "rotation" in entry:
        x, y, z, w = entry["rotation"]
        X = trimesh.transformations.quaternion_matrix([w, x, y, z])
    X[:3, :3] *= np.array(entry.get("scale", [1.0, 1.0, 1.0]), float)
    X[:3, 3] = entry.get("translation", [0.0, 0.0, 0.0])
    return X
