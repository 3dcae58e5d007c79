"""From the tree of CAD files to parts: bodies told apart, split or joined, or left out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain

import numpy as np
import trimesh

from cell.products.bodies import Bodies, bodies_of
from cell.products.product import LeftOut
from cell.products.surfaces import joined, merged
from cell.products.tree import Node, Surface, fit_for_orders

NOT_WANTED = "by --leave-out"


@dataclass
class Parts:
    """Parts by name, and what became of the rest.

    Attributes:
        meshes: Closed surfaces in the product frame A [m], by name.
        left_out: What is not planned.
        repairs: What was done to a part's surface, by name.
        several: What is said of the bodies of parts that have more than one, by name.
    """

    meshes: dict[str, trimesh.Trimesh] = field(default_factory=dict)
    left_out: list[LeftOut] = field(default_factory=list)
    repairs: dict[str, str] = field(default_factory=dict)
    several: dict[str, str] = field(default_factory=dict)


def parts_of(named: Iterable[tuple[str, Node]], *, split: bool, leave_out: Sequence[str]) -> Parts:
    """Return the parts of a tree.

    Args:
        named: Its leaves, each with its name.
        split: Whether each body is a part.
        leave_out: Names of parts and of sub-assemblies, of which none is planned.
    """
    named = list(named)
    taken = {name for name, _ in named}
    parts, known = Parts(), {}
    for name, node in named:
        if unwanted := _among(name, leave_out):
            parts.left_out.append(LeftOut(unwanted, NOT_WANTED))
            continue
        if not node.surfaces:
            parts.left_out.append(LeftOut(name, node.lacking or "empty"))
            continue
        X_AP = node.surfaces[0].X_AP
        if _scale(X_AP) < FLAT:
            parts.left_out.append(LeftOut(name, "its pose squeezes it flat"))
            continue
        key = (*(id(surface.mesh) for surface in node.surfaces), f"{_scale(X_AP):.6g}")
        if key not in known:
            known[key] = _Shape(node.surfaces)
        shape = known[key]
        if shape.bodies.rejected:
            parts.left_out.append(_left_out(name, shape, X_AP))
        for part, mesh in shape.named(name, split, taken):
            if unwanted := _among(part, leave_out):
                parts.left_out.append(LeftOut(unwanted, NOT_WANTED))
                continue
            parts.meshes[part] = shape.placed(mesh, X_AP)
            if shape.bodies.repair:
                parts.repairs[part] = shape.bodies.repair
        if not split and len(shape.bodies.solids) > 1:
            number = len(shape.bodies.solids)
            parts.several[name] = f"{number} separate bodies"
            if shape.one[1]:
                parts.several[name] = f"{number} bodies that overlap, united"
            elif shape.touching:
                parts.several[name] = f"{number} bodies, of which some touch"
    return parts


def _among(name: str, names: Iterable[str]) -> str:
    """Return which of several names is this one, or that of a sub-assembly around it, or ""."""
    return next((n for n in names if name == n or name.startswith(f"{n}/")), "")


FLAT = 1e-9  # Scale of a pose below which nothing is left of a shape.


def _scale(X: np.ndarray) -> float:
    """Return by what a pose (4, 4) multiplies lengths."""
    return float(abs(np.linalg.det(X[:3, :3])) ** (1.0 / 3.0))


class _Shape:
    """The bodies of the surfaces of one part, which all its instances share."""

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        # A pose may scale, and what counts as a rounding error is known in metres only.
        scale = _scale(surfaces[0].X_AP)
        self._scale = 1.0 if np.isclose(scale, 1.0, rtol=0.1) else scale
        meshes = [self._in_meters(surface.mesh) for surface in surfaces]
        found = [bodies_of(mesh) for mesh in meshes]
        labels = [s.name for s, f in zip(surfaces, found, strict=True) for _ in f.solids]
        self.bodies = found[0]
        if len(found) > 1:
            solids, rejected = (
                tuple(chain.from_iterable(each))
                for each in zip(*((f.solids, f.rejected) for f in found), strict=True)
            )
            repairs = dict.fromkeys(f.repair for f in found if f.repair)
            self.bodies = Bodies(solids, rejected, "; ".join(repairs))
            # Objects may be faces of a body, by colour or material, which only close together.
            whole = bodies_of(merged(joined(meshes))) if rejected else self.bodies
            if len(whole.rejected) < len(rejected):
                self.bodies, labels = whole, [""] * len(whole.solids)
        self._labels = labels

    @cached_property
    def one(self) -> tuple[trimesh.Trimesh, bool]:
        """All bodies as one surface, and whether they overlapped and were united."""
        return self.bodies.as_one()

    @cached_property
    def touching(self) -> bool:
        """Whether any two bodies touch."""
        return self.bodies.touch()

    def named(self, name: str, split: bool, taken: set[str]) -> list[tuple[str, trimesh.Trimesh]]:
        """Return the part, or its bodies, with names that are not taken, and are from now on."""
        if not self.bodies.solids:
            return []
        if not split or len(self.bodies.solids) == 1:
            return [(name, self.one[0])]
        names = _body_names(name, self._labels, taken)
        taken.update(names)
        return list(zip(names, self.bodies.solids, strict=True))

    def _in_meters(self, mesh: trimesh.Trimesh) -> trimesh.Trimesh:
        return mesh if self._scale == 1.0 else mesh.copy().apply_scale(self._scale)

    def pose(self, X_AP: np.ndarray) -> np.ndarray:
        """Return the pose (4, 4) of the bodies for that of a surface."""
        return X_AP @ np.diag([1.0 / self._scale] * 3 + [1.0])

    def placed(self, mesh: trimesh.Trimesh, X_AP: np.ndarray) -> trimesh.Trimesh:
        """Return a copy of one of the bodies, or of all, in the product frame."""
        moved, X = mesh.copy(), self.pose(X_AP)
        return moved if np.array_equal(X, np.eye(4)) else moved.apply_transform(X)


def _body_names(name: str, labels: Sequence[str], taken: set[str]) -> list[str]:
    """Return names for the bodies of a part: those of objects, else its own with numbers."""
    folder = name[: name.rfind("/") + 1]
    stems = [folder + fit_for_orders(label) if label else name for label in labels]
    names: list[str] = []
    for stem, label in zip(stems, labels, strict=True):
        alone = bool(label) and stems.count(stem) == 1 and stem not in taken - {name}
        number = 1
        while not alone and (f"{stem}_{number}" in names or f"{stem}_{number}" in taken):
            number += 1
        names.append(stem if alone else f"{stem}_{number}")
    return names


def _left_out(name: str, shape: _Shape, X_AP: np.ndarray) -> LeftOut:
    """Return what is no solid in a part, with the place of the first piece."""
    pieces = shape.bodies.rejected
    reason = pieces[0].text(shape.pose(X_AP))
    if len(pieces) > 1:
        reason += f", and {len(pieces) - 1} more pieces"
    return LeftOut(f"a surface in {name}" if shape.bodies.solids else name, reason)
