"""Identical parts: parts of the same shape, in whatever pose.

Two parts count as identical when volume, area, number of faces, principal moments of inertia and
handedness agree. A part and its mirror image differ in handedness unless the shape has a plane of
symmetry, and then they are the same shape.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from itertools import chain, count

import numpy as np
import trimesh

from cell.products.product import Product

SAME = 1e-3
"""[A] relative tolerance: above the rounding of files, below any intended difference."""

HANDED = 1e-4
"""[A] of its largest possible value; a smaller triple product means a plane of symmetry."""


def identical_parts(meshes: Mapping[str, trimesh.Trimesh]) -> list[tuple[str, ...]]:
    """Return, for each shape that occurs more than once, the names of the parts that have it."""
    groups: list[tuple[np.ndarray, list[str]]] = []
    for name, mesh in meshes.items():
        own = signature(mesh)
        same = next(
            (
                names
                for other, names in groups
                if own[-1] == other[-1] and np.all(np.abs(own - other) <= SAME * own[0])
            ),
            None,
        )
        if same is None:
            groups.append((own, [name]))
        else:
            same.append(name)
    return [tuple(names) for _, names in groups if len(names) > 1]


def signature(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return pose invariants (7,): five lengths [m], thousands of faces, and the handedness."""
    moments = np.sort(np.asarray(mesh.principal_inertia_components)) / mesh.volume
    lengths = [abs(mesh.volume) ** (1 / 3), np.sqrt(mesh.area), *np.sqrt(np.abs(moments))]
    return np.array([*lengths, 1e-3 * len(mesh.faces), handedness(mesh)])


def handedness(mesh: trimesh.Trimesh) -> float:
    """Return +1 or -1 for a shape that differs from its mirror image, else 0.

    It is the sign of the triple product of three vectors that rotate with the shape: third, fifth
    and seventh moments of its surface about the centre of mass. Mirroring changes the sign.
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


def group_identical(
    product: Product, same: Sequence[tuple[str, ...]]
) -> dict[str, tuple[str, ...]]:
    """Return groups, by name, of the identical parts that are in no group yet.

    A group is named by the common prefix of its members, in the plural: bolt_1, bolt_2 are bolts.

    Args:
        product: Its groups and names are taken.
        same: Sets of identical parts, as from `identical_parts`.
    """
    taken = {name for members in product.groups.values() for name in members}
    groups: dict[str, tuple[str, ...]] = {}
    for names in same:
        members = tuple(name for name in names if name not in taken)
        if len(members) > 1:
            known = {*product.parts, *product.groups, *groups}
            groups[_plural(members, known)] = members
    return groups


def _plural(members: Sequence[str], taken: set[str]) -> str:
    """Return the common prefix of the names, without number, in the plural, and not taken."""
    number = re.compile(r"[\d_.\- ]+$")
    prefix = os.path.commonprefix(list(members))
    stem = number.sub("", prefix) or number.sub("", members[0]) or "part"
    plural = stem if stem.endswith("s") else f"{stem}s"
    names = chain([plural], (f"{plural}_{k}" for k in count(2)))
    return next(name for name in names if name not in taken)
