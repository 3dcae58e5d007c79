"""Taking a surface apart into closed shells, and what stays open.

Bodies in one file may touch: an edge then has four faces, or a corner belongs to two bodies. Faces
at such an edge belong together where they bound the same wedge of material, and every shell gets
corners of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import trimesh

from cell.products.half_edges import HalfEdges, components
from cell.products.repair import WELDS, welded, without_doubled, without_slivers, wound_alike


@dataclass(frozen=True)
class Apart:
    """A surface taken apart.

    Attributes:
        shells: Closed surfaces, at each edge of which two faces meet that are wound alike.
        open: Connected pieces that no safe repair closes.
        repair: What was done to close the shells, "" for nothing.
        sound: Whether the surface as a whole is closed and wound alike as it is.
    """

    shells: tuple[trimesh.Trimesh, ...]
    open: tuple[trimesh.Trimesh, ...] = ()
    repair: str = ""
    sound: bool = False


def taken_apart(surface: trimesh.Trimesh) -> Apart:
    """Return the closed shells of a surface [m] and its open pieces.

    Only what is open without it is repaired: vertices within rounding of each other are merged,
    degenerate and doubled faces are dropped. Faces are turned where windings differ.

    Args:
        surface: Coincident vertices merged.
    """
    vertices, faces = np.asarray(surface.vertices, float), np.asarray(surface.faces, np.int64)
    edges = HalfEdges(faces)
    sound = edges.is_manifold and edges.is_balanced
    if sound and not edges.labels(edges.pairs).any():
        return Apart((surface,), sound=True)
    shells: list[trimesh.Trimesh] = []
    corners, dropped, widest, turned = 0, 0, 0.0, False
    # Where corners coincide in one face already, others nearly do: as it is, it would stay thin.
    has_slivers = len(without_slivers(faces)) < len(faces)
    for distance in WELDS if has_slivers else (0.0, *WELDS):
        had = len(np.unique(faces)), len(faces)
        if distance:
            vertices, faces = welded(vertices, faces, distance)
        merged = had[0] - len(np.unique(faces))
        faces = without_slivers(faces)
        found: list[tuple[np.ndarray, np.ndarray]] = []
        for single in (False, True):
            faces = without_doubled(faces) if single else faces
            closed = _closed(faces)
            rest = [faces[~closed]]
            for piece in _pieces(faces[closed]):
                wound, is_turned = _wound(piece)
                resolved = list(_shells(vertices, wound))
                turned |= is_turned and bool(resolved)
                found += resolved
                rest += [] if resolved else [piece]
            faces = np.concatenate(rest)
        if found:
            corners, widest = corners + merged, max(widest, distance)
            dropped += had[1] - len(faces) - sum(len(shell) for _, shell in found)
            shells += [_mesh(*shell) for shell in found]
        if not len(faces):
            break
    done = [f"{corners} corners welded within {1e6 * widest:g} um"] if corners else []
    done += [f"{dropped} degenerate or doubled faces removed"] if dropped else []
    done += ["faces turned outwards"] if turned else []
    open_ = tuple(_mesh(vertices, piece) for piece in _pieces(faces))
    return Apart(tuple(shells), open_, ", ".join(done), sound)


def _closed(faces: np.ndarray) -> np.ndarray:
    """Return (m,) whether each face belongs to a piece all of whose edges have an even number.

    What hangs at such a piece by an edge of three or more faces, and is open itself, is taken off.
    """
    kept = np.arange(len(faces))
    while len(kept):
        edges = HalfEdges(faces[kept])
        free = (edges.count[edges.edge] == 1).reshape(-1, 3).any(axis=1)
        odd = (edges.count[edges.edge] % 2 == 1).reshape(-1, 3).any(axis=1)
        if not odd.any():
            break
        pairs = edges.pairs if free.any() else edges.neighbours()
        patch = edges.labels(pairs)
        kept = kept[~np.isin(patch, patch[free if free.any() else odd])]
    closed = np.zeros(len(faces), bool)
    closed[kept] = True
    return closed


def _pieces(faces: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the faces of each piece that hangs together by edges, in their order."""
    if len(faces):
        edges = HalfEdges(faces)
        yield from _split(faces, edges.labels(edges.neighbours()))


def _split(faces: np.ndarray, labels: np.ndarray) -> list[np.ndarray]:
    """Return the faces of each label, in the order in which the labels occur first."""
    order = np.argsort(labels, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)
    return [faces[group] for group in sorted(groups, key=lambda group: group[0])]


def _wound(faces: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return the faces of a piece wound alike, if its edges have two faces each, and whether."""
    edges = HalfEdges(faces)
    if edges.is_balanced or not edges.is_manifold:
        return faces, False
    opposed = edges.forward[edges.pairs[:, 0]] != edges.forward[edges.pairs[:, 1]]
    wound = wound_alike(faces, edges.pairs // 3, opposed)
    return wound, HalfEdges(wound).is_balanced


def _shells(vertices: np.ndarray, faces: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the shells of a closed piece as vertices and faces; none if they cannot be told apart.

    Bodies are mostly listed one after the other: faces that close by themselves are a body, even
    if it overlaps with the next. Otherwise the wedges of material around the edges decide.
    """
    edges = HalfEdges(faces)
    if edges.is_manifold:
        if edges.is_balanced:
            yield vertices, faces
        return
    single = without_doubled(faces)
    if HalfEdges(single).is_manifold:  # A body that is listed twice.
        yield from _shells(vertices, _wound(single)[0])
        return
    listed = _listed_bodies(edges)
    if listed.any():
        for body in _split(faces, listed):
            for piece in _pieces(body):
                yield from _shells(vertices, _wound(piece)[0])
    elif edges.is_balanced:
        yield from _cut(vertices, faces)


def _listed_bodies(edges: HalfEdges) -> np.ndarray:
    """Return (m,) numbers of runs of consecutive faces that close by themselves, from zero on."""
    halves = edges.by_edge.reshape(-1, 2)  # An even number on each edge: it opens, and closes.
    change = np.zeros(len(edges.faces), int)
    np.add.at(change, halves[:, 0] // 3, 1)
    np.add.at(change, halves[:, 1] // 3, -1)
    ends = np.cumsum(change) == 0
    return np.cumsum(ends) - ends


def _cut(vertices: np.ndarray, faces: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the shells that touch each other along edges, cut apart there."""
    inward = volume(vertices, faces) < 0.0
    faces = faces[:, ::-1] if inward else faces
    edges = HalfEdges(faces)
    wedges = edges.wedges(vertices)
    # Corner 3 f + k is that at the start of half-edge 3 f + k; two half-edges run oppositely.
    following = np.arange(3 * len(faces)).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    ends = [np.column_stack([wedges[:, i], following[wedges[:, 1 - i]]]) for i in (0, 1)]
    corner = components(3 * len(faces), np.concatenate(ends))
    points = np.empty((corner.max() + 1, 3))
    points[corner] = vertices[faces.ravel()]
    cut = corner.reshape(-1, 3)
    for shell in _split(cut, edges.labels(wedges)):
        yield points, shell[:, ::-1] if inward else shell


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Return the volume enclosed by faces [m3], negative if they face inwards."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def _mesh(vertices: np.ndarray, faces: np.ndarray) -> trimesh.Trimesh:
    """Return a mesh of the faces with the vertices that they use."""
    used, index = np.unique(faces, return_inverse=True)
    return trimesh.Trimesh(vertices[used], index.reshape(-1, 3), process=False)
