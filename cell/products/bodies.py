"""The solid bodies of a surface, told apart: separate, touching or overlapping, with cavities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import manifold3d
import numpy as np
import trimesh

from cell.products.inside import inside
from cell.products.shells import taken_apart, volume
from cell.products.surfaces import joined

THIN = 1e-9
"""[A] volume over the cube of the size: below are rounding, and sheets written from both sides."""

OVERLAP = 1e-6
"""[A] shared part of the volume from which bodies overlap: above the rounding of a union."""


@dataclass(frozen=True)
class Rejected:
    """A piece of a surface that bounds no solid.

    Attributes:
        reason: For example "not watertight: 4 open edges".
        point: Where it is open, (3,) in the frame of the surface [m]; None if nowhere.
    """

    reason: str
    point: np.ndarray | None = None

    def text(self, X: np.ndarray | None = None) -> str:
        """Return the reason with the place, after a motion X (4, 4)."""
        if self.point is None:
            return self.reason
        X = np.eye(4) if X is None else X
        x, y, z = 1e3 * (X[:3, :3] @ self.point + X[:3, 3])
        return f"{self.reason}, one of them at ({x:.3g}, {y:.3g}, {z:.3g}) mm"


@dataclass(frozen=True)
class Bodies:
    """The bodies of a surface.

    Attributes:
        solids: Closed surfaces [m], facing outwards, in the order of the file; cavities belong to
            the body around them.
        rejected: What bounds no solid.
        repair: What was done to close the surface, "" for nothing.
        whole: The surface as it was, where it needs no change to be that of all bodies.
    """

    solids: tuple[trimesh.Trimesh, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    repair: str = ""
    whole: trimesh.Trimesh | None = None

    def as_one(self) -> tuple[trimesh.Trimesh, bool]:
        """Return all bodies as one surface, and whether they overlap and were united."""
        if len(self.solids) == 1:
            return self.solids[0], False
        whole = self.whole or joined(self.solids)
        if not _any_boxes_overlap(self.solids):
            return whole, False
        union = manifold3d.Manifold.batch_boolean(
            [_manifold(solid) for solid in self.solids], manifold3d.OpType.Add
        )
        if union.is_empty() or union.volume() > (1.0 - OVERLAP) * enclosed(whole):
            return whole, False
        united = union.to_mesh64()
        faces = np.array(united.tri_verts, int)
        return trimesh.Trimesh(np.array(united.vert_properties)[:, :3], faces, process=False), True

    def touch(self) -> bool:
        """Return whether any two bodies touch."""
        solids = [_manifold(solid) for solid in self.solids]
        near = 1e-6 * max(float(np.max(solid.extents)) for solid in self.solids)
        return any(a.min_gap(b, 2.0 * near) <= near for a, b in combinations(solids, 2))


def bodies_of(surface: trimesh.Trimesh) -> Bodies:
    """Tell the bodies of a surface apart.

    Args:
        surface: [m], coincident vertices merged.
    """
    if not len(surface.faces):
        return Bodies(rejected=(Rejected("no faces"),))
    if not np.isfinite(surface.vertices).all():
        return Bodies(rejected=(Rejected("corners that are not numbers"),))
    apart = taken_apart(surface)
    rejected = [_rejected(piece) for piece in apart.open]
    shells: list[trimesh.Trimesh] = []
    for shell in apart.shells:
        if abs(enclosed(shell)) > THIN * float(np.max(shell.extents)) ** 3:
            shells.append(shell)
        else:
            rejected.append(Rejected("encloses no volume"))
    if not shells and not rejected:  # All faces were degenerate.
        rejected.append(Rejected("encloses no volume"))
    solids, turned = _with_cavities(shells)
    whole = surface if apart.sound and not rejected and not turned else None
    return Bodies(tuple(solids), tuple(rejected), apart.repair, whole)


def enclosed(mesh: trimesh.Trimesh) -> float:
    """Return the volume that a closed surface encloses [m3], negative if it faces inwards."""
    return volume(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def _with_cavities(shells: Sequence[trimesh.Trimesh]) -> tuple[list[trimesh.Trimesh], bool]:
    """Return bodies facing outwards, and whether shells were turned for that.

    A shell that faces inwards inside of another is its cavity.
    """
    volumes = [enclosed(shell) for shell in shells]
    if (
        turned := sum(volumes) < 0.0
    ):  # A file whose faces all face inwards is common and unambiguous.
        for shell in shells:
            shell.invert()
        volumes = [-volume for volume in volumes]
    cavities: dict[int, list[int]] = {k: [] for k, volume in enumerate(volumes) if volume > 0.0}
    for k in sorted(set(range(len(shells))) - set(cavities)):
        around = [i for i in cavities if volumes[i] > 0.0 and _surrounds(shells[i], shells[k])]
        if around:
            cavities[min(around, key=lambda i: volumes[i])].append(k)
        else:
            shells[k].invert()
            cavities[k], turned = [], True
    bodies = [
        joined([shells[k], *(shells[c] for c in cavities[k])]) if cavities[k] else shells[k]
        for k in sorted(cavities)
    ]
    return bodies, turned


def _surrounds(outer: trimesh.Trimesh, inner: trimesh.Trimesh) -> bool:
    """Return whether a shell lies inside of another, by one of its points."""
    (low, high), (inner_low, inner_high) = outer.bounds, inner.bounds
    if np.any(inner_low < low) or np.any(inner_high > high):
        return False
    return bool(inside(np.asarray(outer.triangles), inner.triangles_center[:1])[0])


def _any_boxes_overlap(meshes: Sequence[trimesh.Trimesh]) -> bool:
    low, high = (np.array([mesh.bounds[k] for mesh in meshes]) for k in (0, 1))
    least = OVERLAP * float((high - low).max())
    return any(
        bool(np.all(np.minimum(high[k], high[:k]) - np.maximum(low[k], low[:k]) > least, 1).any())
        for k in range(1, len(meshes))
    )


def _manifold(mesh: trimesh.Trimesh) -> manifold3d.Manifold:
    faces = np.asarray(mesh.faces, np.uint64)
    return manifold3d.Manifold(manifold3d.Mesh64(np.asarray(mesh.vertices, float), faces))


def _rejected(piece: trimesh.Trimesh) -> Rejected:
    """Return what is wrong with an open piece: how many edges are open, where one of them is."""
    edges, count = np.unique(piece.edges_sorted, axis=0, return_counts=True)
    edges = edges[count == 1]
    if not len(edges):
        return Rejected("more than two faces meet at an edge, and windings differ")
    return Rejected(
        f"not watertight: {len(edges)} open edges", np.asarray(piece.vertices)[edges[0]].mean(0)
    )
