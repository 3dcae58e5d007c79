"""Reads a BOP dataset by the format's public description, with nothing of what writes it.

https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md
"""

import json
from pathlib import Path

import numpy as np
from PIL import Image


def load(path: Path) -> dict:
    return json.loads(path.read_text())


def image(path: Path) -> np.ndarray:
    with Image.open(path) as opened:
        return np.array(opened)


def read_ply(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) [mm] and triangles (m, 3) of an ASCII file."""
    lines = iter(path.read_text().splitlines())
    counts, names = {}, []
    assert next(lines) == "ply" and next(lines).startswith("format ascii")
    for line in lines:
        word = line.split()
        if word[0] == "element":
            counts[word[1]] = int(word[2])
        if word[0] == "property" and "vertex" in counts and "face" not in counts:
            names.append(word[2])
        if word[0] == "end_header":
            break
    assert names[:3] == ["x", "y", "z"] and {"nx", "ny", "nz"} <= set(names)
    vertices = [[float(v) for v in next(lines).split()[:3]] for _ in range(counts["vertex"])]
    faces = [[int(v) for v in next(lines).split()[1:4]] for _ in range(counts["face"])]
    return np.array(vertices), np.array(faces)


def surface_points(vertices: np.ndarray, faces: np.ndarray, spacing: float) -> np.ndarray:
    """Return points (n, 3) all over the triangles, about a distance apart."""
    points = []
    for a, b, c in vertices[faces]:
        edge = max(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b))
        n = int(np.ceil(edge / spacing)) + 1
        u, v = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
        inside = u + v <= 1.0 + 1e-9
        points.append(a + u[inside][:, None] * (b - a) + v[inside][:, None] * (c - a))
    return np.concatenate(points)


def nearest_depth(
    points: np.ndarray, K: np.ndarray, R: np.ndarray, t: np.ndarray, shape: tuple[int, ...]
) -> np.ndarray:
    """Return the depth (h, w) of a dense surface at every pixel [mm]; infinite: none.

    It is the mean over the points that a pixel shows: those not hidden behind its nearest one.
    """
    p = points @ R.T + t
    u, v, _ = np.round((p / p[:, 2:]) @ K.T).astype(int).T
    inside = (u >= 0) & (v >= 0) & (u < shape[1]) & (v < shape[0])
    pixel, z = v[inside] * shape[1] + u[inside], p[inside, 2]
    nearest = np.full(shape[0] * shape[1], np.inf)
    np.minimum.at(nearest, pixel, z)
    front = z < nearest[pixel] + 2.0
    count = np.bincount(pixel[front], minlength=nearest.size)
    total = np.bincount(pixel[front], z[front], minlength=nearest.size)
    return np.where(count, total / np.maximum(count, 1), np.inf).reshape(shape)
