"""A solid cut into convex pieces along the planes of its concave edges, and how well they fit it.

Cut planes go through faces, so that flat parts of the surface stay exactly where they are; convex
decompositions by sampling close a clearance of 0.25 mm by 0.2 to 0.6 mm [M]. Lengths in mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from manifold3d import Manifold, Mesh64, OpType

CUT = 2e-4
"""[M] Taken off each side of a cut [mm]: hulls of what slivers are left would fill holes again."""

CONVEX = 2e-3
"""[A] Share of its volume by which a piece may differ from its hull."""

LEAST = 0.05
"""[A] Volume of the smallest piece [mm3]: a cube of 0.4 mm."""

LEAST_WIDTH = 0.02
"""[A] Of a piece [mm]; Drake meshes no triangle with a doubled area below 1e-10 m2."""

DEEPEST, TRIED = 24, 14
"""[A] Cuts one after another, and planes that are compared for each."""

BENT = np.deg2rad(3.0)
"""[A] Edges that are less concave come from facets of curved walls."""


@dataclass(frozen=True)
class Error:
    """How far contact pieces are from the surface that they stand for.

    Attributes:
        more: Share of the part's volume that they fill beyond it.
        less: Share of it that they leave out.
        surface: Largest distance by which they reach beyond the part [mm].
    """

    more: float
    less: float
    surface: float


def to_manifold(mesh: trimesh.Trimesh) -> Manifold:
    """Return a closed surface as a solid."""
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.uint64)
    return Manifold(Mesh64(vertices, faces))


def convex_pieces(solid: Manifold, depth: int = 0) -> list[Manifold]:
    """Return convex solids that together fill a solid nearly.

    A piece without a useful plane, such as one with a rounded inner corner, is taken for its hull.
    """
    found: list[Manifold] = []
    for body in solid.decompose():
        if body.volume() < LEAST:
            continue
        best = None
        if _hollow(body) > CONVEX * body.volume() and depth < DEEPEST:
            best = _best_cut(body)
        if best is None:
            hull = body.hull()
            if min(_extents(hull)) > LEAST_WIDTH:
                found.append(hull)
        else:
            for side in best:
                found += convex_pieces(side, depth + 1)
    return found


def error_of(pieces: Sequence[Manifold], solid: Manifold, but: Manifold) -> Error:
    """Return how far pieces are from a solid, leaving a region out of account."""
    whole, union = solid.volume(), Manifold.batch_boolean(list(pieces), OpType.Add)
    outside, missing = union - solid - but, solid - union - but
    surface = 0.0
    for body in outside.decompose():
        if body.volume() > 1e-3 * LEAST:
            # [D] Thickness of a film, 2 V / A; the height of a pyramid is three times as much.
            surface = max(surface, 3.0 * 2.0 * body.volume() / body.surface_area())
    return Error(outside.volume() / whole, missing.volume() / whole, surface)


def _hollow(body: Manifold) -> float:
    """Return the volume that the convex hull of a body adds to it."""
    return float(body.hull().volume() - body.volume())


def _extents(body: Manifold) -> np.ndarray:
    box = np.array(body.bounding_box()).reshape(2, 3)
    return box[1] - box[0]


def _best_cut(body: Manifold) -> tuple[Manifold, Manifold] | None:
    """Return both sides of the plane that leaves the least hollow pieces, or None without one."""
    best, least = None, np.inf
    for normal, offset in _planes(body):
        above = body.trim_by_plane(normal.tolist(), offset + CUT)
        below = body.trim_by_plane((-normal).tolist(), -offset + CUT)
        if min(above.volume(), below.volume()) < LEAST:
            continue
        hollow = sum(_hollow(b) for side in (above, below) for b in side.decompose())
        if hollow < least:
            best, least = (above, below), hollow
    return best


def _planes(body: Manifold) -> list[tuple[np.ndarray, float]]:
    """Return the planes of the faces at concave edges, the longest and sharpest edges first."""
    data = body.to_mesh64()
    vertices = np.asarray(data.vert_properties)[:, :3]
    mesh = trimesh.Trimesh(vertices, np.asarray(data.tri_verts), process=False)
    concave = ~mesh.face_adjacency_convex & (mesh.face_adjacency_angles > BENT)
    ends = mesh.vertices[mesh.face_adjacency_edges[concave]]
    weight = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) * mesh.face_adjacency_angles[concave]
    planes: dict[tuple[float, ...], tuple[float, np.ndarray, float]] = {}
    for pair, gain in zip(mesh.face_adjacency[concave], weight, strict=True):
        for face in pair:
            normal = mesh.face_normals[face]
            normal = normal * np.sign(normal[np.argmax(np.abs(normal))])
            offset = float(normal @ mesh.triangles[face, 0])
            key = tuple(np.round([*normal, offset], 3))
            total = planes.get(key, (0.0, normal, offset))[0] + float(gain)
            planes[key] = total, normal, offset
    ranked = sorted(planes.values(), key=lambda plane: -plane[0])
    return [(normal, offset) for _, normal, offset in ranked[:TRIED]]
