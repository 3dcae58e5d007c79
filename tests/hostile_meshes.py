"""Hostile and careless CAD files, seeded: meshes, glTF and STEP."""

from __future__ import annotations

import json
import random
import struct
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import trimesh
from step_files import step_assembly
from tiny_products import box

CadCase = tuple[str, str, bytes, tuple[int, ...]]
"""What is odd, name of the file, its content, the exit codes that are right."""

BAD, ANY = (2,), (0, 1, 2)
CORNERS = [(x, y, z) for x in (-10, 10) for y in (-10, 10) for z in (-10, 10)]
FACES = [
    (1, 2, 4), (1, 4, 3), (5, 7, 8), (5, 8, 6), (1, 5, 6), (1, 6, 2),
    (3, 4, 8), (3, 8, 7), (1, 3, 7), (1, 7, 5), (2, 6, 8), (2, 8, 4),
]  # fmt: skip


def obj(corners: Sequence[Sequence[Any]], faces: Sequence[Sequence[int]]) -> bytes:
    """Return a Wavefront file."""
    lines = [f"v {x} {y} {z}\n" for x, y, z in corners]
    lines += [f"f {' '.join(map(str, face))}\n" for face in faces]
    return "".join(lines).encode()


def obj_box(z: float = 0.0) -> bytes:
    """Return a cube of 20 mm at a height [mm]."""
    return obj([(a, b, c + z) for a, b, c in CORNERS], FACES)


def cube_as(kind: str) -> bytes:
    """Return a cube of 20 mm in a format."""
    data = trimesh.creation.box((20, 20, 20)).export(file_type=kind)
    return data.encode() if isinstance(data, str) else bytes(data)  # type: ignore[arg-type]


def mesh_cases() -> Iterator[CadCase]:
    """STL, OBJ and PLY."""
    for suffix in ("stl", "obj", "ply"):
        for name, data in (
            ("nothing", b""),
            ("random bytes", random.Random(1).randbytes(5000)),
            ("text", b"hello world\n" * 10),
            ("a page", b"<html><script>alert(1)</script></html>"),
            ("an archive", b"PK\x03\x04" + bytes(100)),
            ("zeros", bytes(1000)),
        ):
            yield f"{name} as {suffix}", f"x.{suffix}", data, BAD
    for name, data, codes in (*_obj_files(), *_stl_files(), *_ply_files()):
        yield name, f"x.{name.split()[0].lower()}", data, codes


def _obj_files() -> Iterator[tuple[str, bytes, tuple[int, ...]]]:
    rest = CORNERS[1:]
    for face in (
        (1, 2, 99),
        (1, 2, 2**31),
        (1, 2, 2**63),
        (0, 1, 2),
        (-1, -2, -99),
        (1, 2, 10**30),
    ):
        yield f"OBJ face {face}", obj(CORNERS, [*FACES[:-1], face]), BAD
    for value in ("nan", "inf", "1e308", "1e400", "1e30", "abc", "9" * 400):
        yield f"OBJ coordinate {value[:9]}", obj([(value, value, value), *rest], FACES), BAD
    for scale in (1e200, 1e100, 1e15, 1e-200, 1e-30, 0.0):
        scaled = [[scale * c for c in corner] for corner in CORNERS]
        yield f"OBJ times {scale}", obj(scaled, FACES), BAD
    for far in (1e5, 1e9, 1e15, 1e300):
        moved = [(x + far, y, z) for x, y, z in CORNERS]
        yield f"OBJ at {far}", obj(moved, FACES), ANY if far < 1e12 else BAD
    yield "OBJ open", obj(CORNERS, FACES[:-1]), BAD
    yield "OBJ flat", obj([(x, y, 0) for x, y, _ in CORNERS], FACES), BAD
    yield "OBJ a point", obj([(1, 1, 1)] * 8, FACES), BAD
    yield "OBJ without faces", obj(CORNERS, []), BAD
    yield "OBJ without corners", obj([], FACES), BAD
    yield "OBJ inside out", obj(CORNERS, [face[::-1] for face in FACES]), ANY
    yield "OBJ doubled", obj(CORNERS, FACES + FACES), ANY
    yield "OBJ a giant polygon", obj(CORNERS, [(1, 2, 3) * 20000]), BAD
    yield "OBJ a long line", obj_box() + b"# " + b"x" * 10**6, ANY
    for target in ("../../secret.mtl", "/etc/passwd", "http://127.0.0.1:9/x.mtl", "/dev/zero"):
        yield f"OBJ material {target}", f"mtllib {target}\nusemtl x\n".encode() + obj_box(), ANY


def _stl_files() -> Iterator[tuple[str, bytes, tuple[int, ...]]]:
    binary, text = cube_as("stl"), cube_as("stl_ascii")
    for count in (0, 1, 13, 10**6, 2**31 - 1, 2**32 - 1):
        yield f"STL {count} triangles stated", bytes(80) + struct.pack("<I", count), BAD
    yield "STL many stated, some there", bytes(80) + struct.pack("<I", 2**32 - 1) + binary[84:], BAD
    yield "STL cut off", binary[:-30], BAD
    yield "STL with more behind it", binary + bytes(77), ANY
    yield "STL text cut off", text[:500], BAD
    yield "STL text without end", b"solid\n" * 50000, BAD
    for value in (float("nan"), float("inf"), 3e38):
        triangle = struct.pack("<12fH", *[0.0] * 3, *[value] * 9, 0)
        yield f"STL corners {value}", bytes(80) + struct.pack("<I", 12) + triangle * 12, BAD
    for word in ("nan", "1e400", "1e308", "x"):
        yield f"STL text {word}", text.replace(b"10", word.encode(), 3), BAD


def _ply_files() -> Iterator[tuple[str, bytes, tuple[int, ...]]]:
    cube = cube_as("ply")
    header, _, data = cube.partition(b"end_header\n")
    for count in (0, 3, 10**9, -1, 2**63):
        for what, known in ((b"vertex", b"vertex 8"), (b"face", b"face 12")):
            changed = header.replace(known, b"%s %d" % (what, count))
            yield f"PLY {what.decode()} {count}", changed + b"end_header\n" + data, BAD
    yield "PLY cut off", cube[:-20], BAD
    yield "PLY a header", header, BAD
    code = header.replace(b"float", b"__import__('os').system('touch pwned')")
    yield "PLY code for a type", code + b"end_header\n" + data, BAD
    texture = header.replace(b"ply\n", b"ply\ncomment TextureFile /etc/passwd\n", 1)
    yield "PLY texture elsewhere", texture + b"end_header\n" + data, ANY
    for number in range(20):
        yield f"PLY edit {number}", _edited(cube, number), ANY


def _edited(data: bytes, seed: int, letters: bytes = bytes(range(256))) -> bytes:
    draw, edited = random.Random(seed), bytearray(data)
    for _ in range(draw.randint(1, 12)):
        edited[draw.randrange(len(edited))] = draw.choice(letters)
    return bytes(edited)


def glb(header: Any, binary: bytes) -> bytes:
    """Return a binary glTF file."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def gltf_header(**changes: Any) -> dict[str, Any]:
    """Return the header of a file with one box, and changes to it."""
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "a"}],
        "meshes": [{"name": "a", "primitives": [primitive]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 72},
        ],
        "buffers": [{"byteLength": 168}],
    } | changes


def glb_cases() -> Iterator[CadCase]:
    """Binary glTF."""
    corners = 1e-3 * np.array(CORNERS, np.float32)
    faces = np.array(FACES, np.uint16) - 1
    binary = corners.astype(np.float32).tobytes() + faces.astype(np.uint16).tobytes()
    positions, indices = gltf_header()["accessors"]
    views = gltf_header()["bufferViews"]
    bare = {key: value for key, value in positions.items() if key != "bufferView"}
    sparse = {
        "count": 1,
        "indices": {"bufferView": 0, "componentType": 5125},
        "values": {"bufferView": 0},
    }
    for count in (0, 10**9, 2**40, -1, 1.5, "8", None):
        yield _glb(f"{count} corners", binary, accessors=[positions | {"count": count}, indices])
        yield _glb(f"{count} indices", binary, accessors=[positions, indices | {"count": count}])
    yield _glb("corners without data", binary, accessors=[bare | {"count": 2**30}, indices])
    yield _glb("sparse", binary, accessors=[bare | {"count": 2**33, "sparse": sparse}, indices])
    yield _glb("type VEC9", binary, accessors=[positions | {"type": "VEC9"}, indices])
    yield _glb("unknown numbers", binary, accessors=[positions | {"componentType": 9}, indices])
    yield _glb(
        "a view beyond the end", binary, bufferViews=[views[0] | {"byteOffset": 10**9}, views[1]]
    )
    yield _glb("a view of no buffer", binary, bufferViews=[views[0] | {"buffer": 9}, views[1]])
    yield _glb("indices beyond the corners", corners.tobytes() + b"\xff\xff" * 36)
    for value in (float("nan"), float("inf"), 3e38):
        odd = np.full((8, 3), value, np.float32).tobytes() + faces.tobytes()
        yield _glb(f"corners {value}", odd)
    for uri in ("../../../etc/passwd", "/etc/passwd", "file:///etc/passwd", "http://127.0.0.1:9/x",
                "data:application/octet-stream;base64,AAAA", "/dev/zero"):  # fmt: skip
        yield _glb(f"a buffer in {uri[:25]}", b"", buffers=[{"byteLength": 168, "uri": uri}])
    nodes = {
        "nodes in a circle": [{"mesh": 0, "children": [1]}, {"children": [0]}],
        "a node in itself": [{"mesh": 0, "children": [0]}],
        "nodes that multiply": [{"children": [k + 1] * 9} for k in range(20)] + [{"mesh": 0}],
        "a chain of nodes": [{"children": [k + 1]} for k in range(3000)] + [{"mesh": 0}],
        "a child that is not there": [{"children": [7]}],
        "a mesh that is not there": [{"mesh": 7}],
        "a pose that is no number": [{"mesh": 0, "matrix": [float("nan")] * 16}],
        "a pose that flattens": [{"mesh": 0, "matrix": [0] * 16}],
        "a short pose": [{"mesh": 0, "matrix": [1, 2]}],
        "a pose of 1e308": [{"mesh": 0, "scale": [1e308] * 3}],
        "a place of 1e300": [{"mesh": 0, "translation": [1e300] * 3}],
        "a quaternion of zeros": [{"mesh": 0, "rotation": [0, 0, 0, 0]}],
        "no objects": [{}],
    }
    for name, entries in nodes.items():
        yield _glb(name, binary, nodes=entries, codes=ANY if "quaternion" in name else BAD)
    many = {"scenes": [{"nodes": list(range(6000))}], "nodes": [{"mesh": 0}] * 6000}
    yield _glb("6000 parts", binary, **many)
    for name, data in (
        ("a list", glb(b"[]", binary)),
        ("nested lists", glb(b"[" * 5000 + b"]" * 5000, binary)),
        ("no JSON", glb(b"{nope", binary)),
        ("nothing", b""),
        ("random bytes", random.Random(1).randbytes(5000)),
        ("a header", glb(gltf_header(), binary)[:12]),
    ):
        yield f"glTF {name}", "x.glb", data, BAD
    whole = glb(gltf_header(), binary)
    for number in range(30):
        yield f"glTF edit {number}", "x.glb", _edited(whole, number), ANY


def _glb(name: str, binary: bytes, codes: tuple[int, ...] = BAD, **changes: Any) -> CadCase:
    return f"glTF {name}", "x.glb", glb(gltf_header(**changes), binary), codes


def step_cases() -> Iterator[CadCase]:
    """STEP files."""
    places = [("a", "s", (0.0, 0.0, 0.0)), ("b", "s", (0.0, 0.0, 20.0))]
    good = step_assembly({"s": box((20, 20, 20), (0, 0, 0))}, places, "mm").encode()
    for share in (0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.995):
        yield f"STEP cut off at {share}", "x.step", good[: int(share * len(good))], ANY
    entity = b"DATA;\n#99990=%s;"
    for name, data, codes in (
        ("nothing", b"", BAD),
        ("random bytes", random.Random(2).randbytes(20000), BAD),
        ("a header", good.split(b"DATA;")[0], BAD),
        ("no data", good.split(b"DATA;")[0] + b"DATA;\nENDSEC;\nEND-ISO-10303-21;\n", BAD),
        ("a solid of itself", good.replace(b"#10", b"#1"), ANY),
        ("NUL", good.replace(b"CARTESIAN", b"CART\0SIAN", 3), ANY),
        ("1E400", good.replace(b"2.000000E+01", b"1.E400", 3), ANY),
        ("a long name", good.replace(b"'a'", b"'" + b"a" * 10**6 + b"'"), ANY),
        ("nested brackets", good.replace(b"DATA;", entity % (b"(" * 10**5 + b")" * 10**5)), ANY),
        (
            "a document elsewhere",
            good.replace(b"DATA;", entity % b"DOCUMENT_FILE('../../x','','',$,'','')"),
            ANY,
        ),
    ):
        yield f"STEP {name}", "x.step", data, codes
    for number in range(25):
        edited = _edited(good, number, b"0123456789#(),.;'$*E- ")
        yield f"STEP edit {number}", "x.step", edited, ANY
