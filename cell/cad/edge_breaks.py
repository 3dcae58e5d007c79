"""Edges of convex contact pieces, broken as real parts are deburred.

A sharp edge is more than a detail: where a face comes down on another one of the same outline, the
sides of the lower part end up a few micrometres inside of the upper one's pressure field, which
pushes it sideways out of its place [M]. A face that ends before its edge meets the other one's face
alone. Lengths in mm.
"""

from __future__ import annotations

import numpy as np
import trimesh
from manifold3d import Manifold

from cell.products.inside import inside

SHARP = np.deg2rad(50.0)  # [A] Edges that turn less are chamfers, or facets of what is round.
WIDTH = 0.3  # [A] Of a break: ISO 13715 has 0.2 to 0.5 mm for parts that are not precise ones.
SHARE = 0.2  # [A] Of the least extent of a piece that a break takes at most.
OFF = 0.05  # Outside of a face, where it is seen whether anything covers it.
ALONG = np.array([0.1, 0.5, 0.9])  # Of an edge, where that is looked at.


def with_broken_edges(piece: Manifold, solid: trimesh.Trimesh) -> Manifold:
    """Return a convex piece of a solid, with the solid's own sharp edges broken.

    Edges along which it was cut out of the solid stay as they are.
    """
    data = piece.to_mesh64()
    vertices = np.asarray(data.vert_properties)[:, :3]
    mesh = trimesh.Trimesh(vertices, np.asarray(data.tri_verts), process=False)
    width = min(WIDTH, SHARE * float(np.ptp(mesh.bounds, axis=0).min()))
    sharp = mesh.face_adjacency_angles > SHARP
    ends = mesh.vertices[mesh.face_adjacency_edges[sharp]]
    normals = mesh.face_normals[mesh.face_adjacency[sharp]]
    across = _into_faces(mesh, sharp, ends)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    places = ends[:, None, 0] + ALONG[:, None] * (ends[:, 1] - ends[:, 0])[:, None]
    # Of each edge, on both faces, at each place.
    probes = places[:, None] + (width * across + OFF * normals)[:, :, None]
    covered = inside(np.asarray(solid.triangles), probes.reshape(-1, 3))
    own = ~covered.reshape(len(ends), -1).any(axis=1) & (lengths > width)
    planes = set()
    for edge in np.flatnonzero(own):
        normal = normals[edge].sum(axis=0)
        normal /= np.linalg.norm(normal)
        offset = float(normal @ (ends[edge, 0] + width * across[edge, 0]))
        planes.add(tuple(np.round([*normal, offset], 6).tolist()))
    for *normal, offset in sorted(planes):
        piece = piece.trim_by_plane([-n for n in normal], -offset)
    return piece


def _into_faces(mesh: trimesh.Trimesh, chosen: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the directions (n, 2, 3) from edges into both of their faces, square to the edges."""
    along = ends[:, 1] - ends[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    third = mesh.vertices[mesh.face_adjacency_unshared[chosen]] - ends[:, None, 0]
    across = third - np.einsum("eij,ej->ei", third, along)[..., None] * along[:, None]
    return across / np.linalg.norm(across, axis=2, keepdims=True)
