"""Binary glTF as other programs write it: trees, several primitives, quantized, compressed."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from tiny_products import box, to_trimesh

from cell.products.loading import load_product
from cell.products.product import LeftOut
from experiments.cli.main import main

CUBE = box((10, 10, 10), (0, 0, 0))


class Glb:
    """A binary glTF file, written by hand."""

    def __init__(self) -> None:
        self.header: dict = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": []}
        self._data = b""

    def add(self, values: np.ndarray, component: int, kind: str, **more) -> int:
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": values.nbytes}
        self.header["bufferViews"].append(view)
        self._data += values.tobytes() + b"\0" * (-values.nbytes % 4)
        entry = {"bufferView": len(self.header["bufferViews"]) - 1, "componentType": component}
        self.header["accessors"].append(entry | {"count": len(values), "type": kind} | more)
        return len(self.header["accessors"]) - 1

    def write(self, file: Path) -> None:
        self.header["buffers"] = [{"byteLength": len(self._data)}]
        text = json.dumps(self.header).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self._data), b"BIN\0") + self._data
        file.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


@pytest.fixture
def glb() -> Glb:
    """A cube of 10 mm: mesh 0 of two primitives, 1 of lines, 2 of normalised bytes."""
    cube, file = to_trimesh(CUBE), Glb()
    corners = file.add(np.asarray(cube.vertices, "f4"), 5126, "VEC3")
    flat = np.asarray(cube.faces, "u2").ravel()
    halves = [file.add(part, 5123, "SCALAR") for part in (flat[:18], flat[18:])]
    every, few = file.add(flat, 5123, "SCALAR"), file.add(flat[:4], 5123, "SCALAR")
    quantized = np.zeros((8, 4), np.int8)
    quantized[:, :3] = np.round(np.asarray(cube.vertices) / 0.01 * 127)
    small = file.add(quantized, 5120, "VEC3", normalized=True)
    file.header["bufferViews"][-1]["byteStride"] = 4
    lines = {"attributes": {"POSITION": corners}, "indices": few, "mode": 1}
    file.header |= {
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": corners}, "indices": i} for i in halves]},
            {"primitives": [lines]},
            {"primitives": [{"attributes": {"POSITION": small}, "indices": every}]},
        ],
        "scenes": [{"nodes": [0]}],
    }
    return file


def test_gltf_is_read_as_a_tree(glb: Glb, tmp_path: Path) -> None:
    """Poses by factors, mirrored and scaled; several primitives; quantized corners."""
    glb.header["nodes"] = [
        {"name": "root", "children": [1, 2, 5, 6, 7]},
        {"name": "底 plate", "mesh": 0},
        {"name": "clamp", "translation": [0, 0.03, 0], "children": [3, 4]},
        {"name": "pin", "mesh": 0},
        {"name": "pin", "mesh": 0, "translation": [0.05, 0, 0], "rotation": [0, 0, 1, 0]},
        {"name": "wires", "mesh": 1},
        {"name": "small", "mesh": 2, "scale": [0.01, 0.01, -0.01], "translation": [0, 0, 0.1]},
        {"name": "eye", "camera": 0},
    ]
    glb.write(tmp_path / "tree.glb")
    product = load_product(tmp_path / "tree.glb")
    assert list(product.parts) == ["clamp/pin_1", "clamp/pin_2", "small", "底_plate"]
    assert product.left_out == (LeftOut("wires", "lines or points"),)
    for part in product.parts.values():
        assert 1e9 * part.mesh.volume == pytest.approx(1000.0, rel=1e-5) and part.mesh.is_volume
    lowest = [part.mesh.bounds[0] for part in product.parts.values()]
    right = [[0, 0.03, 0], [0.04, 0.02, 0], [0, 0, 0.09], [0, 0, 0]]
    np.testing.assert_allclose(lowest, right, atol=1e-7)


def test_poses_may_scale(glb: Glb, tmp_path: Path) -> None:
    """A mesh in centimetres or so, used at two sizes."""
    scales = (1e-3, 2e-3, 10.0)
    glb.header["nodes"] = [{"name": f"at {s}", "mesh": 0, "scale": [s] * 3} for s in scales]
    glb.header["scenes"] = [{"nodes": [0, 1, 2]}]
    glb.write(tmp_path / "scaled.glb")
    product = load_product(tmp_path / "scaled.glb")
    for scale in scales:
        size = product.parts[f"at_{scale}"].mesh.extents
        np.testing.assert_allclose(size, [0.01 * scale] * 3, rtol=1e-5)


@pytest.mark.parametrize(
    ("extension", "name"),
    [("KHR_draco_mesh_compression", "Draco"), ("EXT_meshopt_compression", "meshopt")],
)
def test_compressed_gltf_is_one_line(extension, name, glb: Glb, tmp_path: Path, capfd) -> None:
    glb.header["nodes"] = [{"mesh": 0}]
    glb.header["extensionsUsed"] = glb.header["extensionsRequired"] = [extension]
    if name == "Draco":
        for primitive in glb.header["meshes"][0]["primitives"]:
            primitive["extensions"] = {extension: {"bufferView": 0, "attributes": {"POSITION": 0}}}
        del glb.header["accessors"][0]["bufferView"]
    else:
        glb.header["bufferViews"][0]["extensions"] = {extension: {"buffer": 0}}
    glb.write(tmp_path / "small.glb")
    assert main(["plan", str(tmp_path / "small.glb"), "--out", str(tmp_path / "out")]) == 2
    printed = capfd.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1
    assert f"is compressed with {name}, which cannot be read here" in printed.err
