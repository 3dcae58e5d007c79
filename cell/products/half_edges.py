"""Half-edges of a triangle surface: which faces meet at an edge, and belong together there."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

COINCIDENT = 1e-6
"""[rad] [A] faces at an edge that are closer than this lie on each other: float32 in a small face
turns it by less."""


class HalfEdges:
    """The half-edges of faces: 3 f + k runs from corner k of face f to its next corner.

    Attributes:
        faces: (m, 3) vertex indices.
        edge: (3 m,) index of the edge on which each half-edge lies.
        count: (e,) how many half-edges lie on each edge.
        forward: (3 m,) whether each runs from the lower vertex index to the higher.
    """

    def __init__(self, faces: np.ndarray) -> None:
        self.faces = faces
        self.start, self.end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        self.forward = self.start < self.end
        low, high = np.minimum(self.start, self.end), np.maximum(self.start, self.end)
        key = low.astype(np.int64) * (int(faces.max(initial=0)) + 1) + high
        _, self.edge, self.count = np.unique(key, return_inverse=True, return_counts=True)

    @cached_property
    def by_edge(self) -> np.ndarray:
        """(3 m,) half-edges sorted by edge, those of one edge in the order of their faces."""
        return np.argsort(self.edge, kind="stable")

    @property
    def is_manifold(self) -> bool:
        """Whether every edge has two faces."""
        return bool((self.count == 2).all())

    @property
    def is_balanced(self) -> bool:
        """Whether as many faces traverse each edge in one sense as in the other."""
        return not np.bincount(self.edge, np.where(self.forward, 1.0, -1.0)).any()

    @cached_property
    def pairs(self) -> np.ndarray:
        """(p, 2) half-edges on either side of each edge that has two."""
        twice = self.count[self.edge[self.by_edge]] == 2
        return self.by_edge[twice].reshape(-1, 2)

    def neighbours(self) -> np.ndarray:
        """Return (p, 2) half-edges on a common edge, a chain of them for each edge."""
        edge = self.edge[self.by_edge]
        same = edge[1:] == edge[:-1]
        return np.column_stack([self.by_edge[:-1][same], self.by_edge[1:][same]])

    def labels(self, pairs: np.ndarray) -> np.ndarray:
        """Return (m,) labels of the pieces in which the faces hang together by pairs (p, 2)."""
        return components(len(self.faces), pairs // 3)

    def wedges(self, vertices: np.ndarray) -> np.ndarray:
        """Return (p, 2) half-edges whose faces bound the same wedge of material at their edge.

        Around an edge, material lies behind each face; the faces of a wedge follow each other.

        Args:
            vertices: (n, 3); the faces are turned outwards, and each edge is balanced.
        """
        wedges = [self.pairs]
        first = np.cumsum(self.count) - self.count
        for edge in np.flatnonzero(self.count > 2):
            halves = self.by_edge[first[edge] : first[edge] + self.count[edge]]
            wedges.append(self._wedges_at(halves, vertices))
        return np.concatenate(wedges)

    def _wedges_at(self, halves: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        ends = np.sort([self.start[halves[0]], self.end[halves[0]]])
        p, q = vertices[ends]
        along = (q - p) / np.linalg.norm(q - p)
        thirds = self.faces[halves // 3, (halves % 3 + 2) % 3]
        spokes = vertices[thirds] - p
        spokes -= np.outer(spokes @ along, along)
        x = spokes[0]
        angle = np.arctan2(spokes @ np.cross(along, x), spokes @ x * np.linalg.norm(along))
        steps = np.round(np.mod(angle, 2.0 * np.pi) / COINCIDENT)
        steps[steps >= np.round(2.0 * np.pi / COINCIDENT)] = 0.0
        # The normal of a face that runs along the edge points to larger angles, so that going round
        # one leaves material there, and enters it at a face that runs against. Of two that coincide
        # the one where material ends comes first: nothing is between them.
        leaves = self.forward[halves]
        around = np.lexsort([~leaves, steps])
        depth = np.cumsum(np.where(leaves[around], -1, 1))
        around = np.roll(around, -(int(np.argmin(depth)) + 1))
        open_, wedges = [], []
        for half in halves[around]:
            if self.forward[half]:
                wedges.append((open_.pop(), half))
            else:
                open_.append(half)
        return np.array(wedges)


def components(count: int, pairs: np.ndarray) -> np.ndarray:
    """Return (count,) labels of the connected components of a graph with edges (p, 2)."""
    ones = np.ones(len(pairs), bool)
    graph = coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1]
