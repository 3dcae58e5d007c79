"""Identical parts: the same shape several times over, wherever it stands and however it is turned.

Two parts count as identical when volume, area, number of faces, principal moments of inertia and
handedness agree. A part and its mirror image differ in handedness, unless the shape has too little
asymmetry to tell (a plane of symmetry), and then they are the same.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
import trimesh

from cell.products.product import Product

SAME = 1e-3  # [A] Relative: above the rounding of files, below any difference that is meant.
HANDED = 1e-4  # [A] Of the largest that it can be: less is a shape with a plane of symmetry.


def identical_parts(meshes: Mapping[str, trimesh.Trimesh]) -> list[tuple[str, ...]]:
    """Return the names of parts of one shape, for each shape that occurs twice or more."""
    groups: list[tuple[np.ndarray, list[str]]] = []
    for name, mesh in meshes.items():
        own = signature(mesh)
        same = next((names for other, names in groups if _agree(own, other)), None)
        if same is None:
            groups.append((own, [name]))
        else:
            same.append(name)
    return [tuple(names) for _, names in groups if len(names) > 1]


def signature(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return numbers (7,) that do not change with the pose: all but the last are lengths [m]."""
    moments = np.sort(np.asarray(mesh.principal_inertia_components)) / mesh.volume
    lengths = [abs(mesh.volume) ** (1 / 3), np.sqrt(mesh.area), *np.sqrt(np.abs(moments))]
    return np.array([*lengths, 1e-3 * len(mesh.faces), handedness(mesh)])


def handedness(mesh: trimesh.Trimesh) -> float:
    """Return +1 or -1 for a shape that differs from its mirror image, else 0.

    The sign of the triple product of three vectors that turn with the shape: third, fifth and
    seventh moments of its surface about the centre of mass. Mirroring changes the sign.
    """
    r = mesh.triangles_center - mesh.center_mass
    r = r / np.sqrt(mesh.area)
    weights = mesh.area_faces / mesh.area
    square = (r**2).sum(axis=1)
    tensor = np.einsum("i,ij,ik->jk", weights, r, r)
    first = weights * square @ r
    second, third = tensor @ first, tensor @ tensor @ first
    scale = np.linalg.norm(first) * np.linalg.norm(second) * np.linalg.norm(third)
    triple = float(first @ np.cross(second, third))
    return 0.0 if abs(triple) <= HANDED * scale or scale < 1e-20 else float(np.sign(triple))


def _agree(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.all(np.abs(a[:-1] - b[:-1]) <= SAME * np.abs(a[0])) and a[-1] == b[-1])


def group_identical(
    product: Product, same: Sequence[tuple[str, ...]]
) -> dict[str, tuple[str, ...]]:
    """Return groups, by name, of the identical parts that are in no group yet.

    A group has the common beginning of its members' names, in the plural: bolt_1, bolt_2 are bolts.
    """
    taken = {name for members in product.groups.values() for name in members}
    groups: dict[str, tuple[str, ...]] = {}
    for names in same:
        members = tuple(name for name in names if name not in taken)
        if len(members) > 1:
            known = {*product.parts, *product.groups, *groups}
            groups[_plural(members, known)] = members
    return groups


def _plural(names: Sequence[str], taken: set[str]) -> str:
    stem = names[0]
    while stem and not all(name.startswith(stem) for name in names):
        stem = stem[:-1]
    stem = re.sub(r"[\d_.\- ]+$", "", stem) or re.sub(r"[\d_.\- ]+$", "", names[0]) or "part"
    plural = stem if stem.endswith("s") else f"{stem}s"
    number, free = 1, plural
    while free in taken:
        number += 1
        free = f"{plural}_{number}"
    return free
