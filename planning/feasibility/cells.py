"""Broad phase: which faces of two parts share a place, over which one can hit the other.

The plane across the axis is divided into cells, and cells into four, as long as that separates
faces. A cell is dropped once no up-face in it can rise above any down-face in it. Faces are tested
against cells by their edges, not by their boxes alone: the long thin triangles of which CAD makes
rings and discs have boxes that cover the hole as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planning.feasibility.envelope import Faces

FEW = 256  # Pairs of faces in a cell that are not worth dividing it.
SEPARATES = 0.8  # A round of divisions goes on if it leaves at most this share of the pairs.
DEEPEST = 12  # Rounds of divisions: a cell is then 1/4096 of the parts' common width.
ROUNDING = 1e-12  # [m] A face on the edge of a cell counts as inside.


@dataclass(frozen=True, eq=False)
class _Members:
    """Faces in cells, one row per face and cell.

    Attributes:
        faces: Of one part.
        which: (e,) indices of faces.
        cell: (e,) indices of cells, ascending.
    """

    faces: Faces
    which: np.ndarray
    cell: np.ndarray

    def chosen(self, rows: np.ndarray) -> _Members:
        """Return some rows, in order."""
        return _Members(self.faces, self.which[rows], self.cell[rows])

    def extremes(self, low: np.ndarray, size: np.ndarray) -> np.ndarray:
        """Return how high (up-faces) or low (down-faces) each can be in its cell, (e,) [m]."""
        faces, w = self.faces, self.which
        corner = low[self.cell]
        near = np.maximum(corner, faces.low[w, :2])
        far = np.minimum(corner + size, faces.high[w, :2])
        planes = faces.planes[w]
        middle = (near + far) / 2
        height = planes[:, 0] * middle[:, 0] + planes[:, 1] * middle[:, 1] + planes[:, 2]
        reach = np.abs(planes[:, :2]) * (far - near) / 2
        if faces.facing > 0:
            return np.minimum(height + reach[:, 0] + reach[:, 1], faces.high[w, 2])
        return np.maximum(height - reach[:, 0] - reach[:, 1], faces.low[w, 2])

    def divided(self, low: np.ndarray, size: np.ndarray) -> _Members:
        """Return the members of the four quarters of each cell; quarter q of cell c is 4 c + q.

        Args:
            low: (c, 2) lower corners of the cells [m].
            size: (2,) of a quarter [m].
        """
        cell = (4 * self.cell[:, None] + np.arange(4)).ravel()
        which = np.repeat(self.which, 4)
        corner = (low[self.cell][:, None] + QUARTERS * size).reshape(-1, 2)
        inside = np.flatnonzero(touching(self.faces, which, corner, corner + size))
        inside = inside[np.argsort(cell[inside], kind="stable")]
        return _Members(self.faces, which[inside], cell[inside])


QUARTERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])


def touching(faces: Faces, which: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return whether faces reach into rectangles, seen along the axis, (n,) bool.

    Args:
        faces: Of one part.
        which: (n,) indices of faces.
        low: (n, 2) lower corner of a rectangle for each [m], or (1, 2) of one for all.
        high: Its upper corner.
    """
    face_low, face_high = faces.low[which, :2], faces.high[which, :2]
    inside = (face_low <= high + ROUNDING) & (face_high >= low - ROUNDING)
    meets = inside[:, 0] & inside[:, 1]
    # The box of a face no larger than the rectangle says nearly as much as its edges.
    large = (face_high - face_low > high - low).any(axis=1)
    rows = np.flatnonzero(meets & large)
    low, high = (np.broadcast_to(c, (len(meets), 2))[rows] for c in (low, high))
    corners = faces.corners[which[rows]]
    middle, half = (low + high) / 2, (high - low) / 2 + ROUNDING
    apart = np.zeros(len(rows), bool)
    for k in range(3):
        start, along = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        offset = middle - start
        # Of the rectangle's corner that lies furthest on the inner side, the left, of the edge.
        inner = along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0]
        inner += np.abs(along[:, 0]) * half[:, 1] + np.abs(along[:, 1]) * half[:, 0]
        apart |= inner < 0.0
    meets[rows[apart]] = False
    return meets


def crossing_pairs(
    down: Faces, up: Faces, d: np.ndarray, u: np.ndarray, height: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return (p,) indices of down-faces and up-faces that share a cell that is not dropped.

    Args:
        down: Faces of the moving part that face against the direction.
        up: Faces of the stationary part that face along it.
        d: Indices of the down-faces that count.
        u: Indices of the up-faces that count.
        height: How far an up-face must rise above a down-face [m].
    """
    low = np.maximum(down.low[d, :2].min(axis=0), up.low[u, :2].min(axis=0))[None]
    size = np.minimum(down.high[d, :2].max(axis=0), up.high[u, :2].max(axis=0)) - low[0]
    a, b = (_Members(faces, w, np.zeros(len(w), int)) for faces, w in ((down, d), (up, u)))
    found: list[np.ndarray] = []
    before = np.inf
    for depth in range(DEEPEST + 1):
        a, b = _in_the_way(a, b, low, size, height)
        count = np.bincount(a.cell, minlength=len(low)) * np.bincount(b.cell, minlength=len(low))
        last = depth == DEEPEST or count.sum() > SEPARATES * before
        leaf = (count <= FEW) | last
        found.append(_codes(a.chosen(leaf[a.cell]), b.chosen(leaf[b.cell]), len(low)))
        if leaf.all():
            break
        before = count[~leaf].sum()
        a, b, size = a.chosen(~leaf[a.cell]), b.chosen(~leaf[b.cell]), size / 2
        a, b = a.divided(low, size), b.divided(low, size)
        low = (low[:, None] + QUARTERS * size).reshape(-1, 2)
        low, a, b = _renumbered(low, a, b)
    codes = np.unique(np.concatenate(found))
    return np.divmod(codes, len(up.low))


def _in_the_way(
    a: _Members, b: _Members, low: np.ndarray, size: np.ndarray, height: float
) -> tuple[_Members, _Members]:
    """Keep the faces that can hit any face of the other part within their cell."""
    bottoms, tops = a.extremes(low, size), b.extremes(low, size)
    lowest, highest = np.full(len(low), np.inf), np.full(len(low), -np.inf)
    np.minimum.at(lowest, a.cell, bottoms)
    np.maximum.at(highest, b.cell, tops)
    return a.chosen(bottoms + height < highest[a.cell]), b.chosen(tops > lowest[b.cell] + height)


def _renumbered(low: np.ndarray, a: _Members, b: _Members) -> tuple[np.ndarray, _Members, _Members]:
    """Leave out the cells without members of both parts."""
    both = np.intersect1d(a.cell, b.cell)
    number = np.full(len(low), -1)
    number[both] = np.arange(len(both))
    a, b = (
        _Members(m.faces, m.which[kept], number[m.cell[kept]])
        for m, kept in ((m, number[m.cell] >= 0) for m in (a, b))
    )
    return low[both], a, b


def _codes(a: _Members, b: _Members, cells: int) -> np.ndarray:
    """Return all pairs of faces that share a cell, as one number each."""
    in_b = np.bincount(b.cell, minlength=cells)
    first = np.cumsum(in_b) - in_b
    times = in_b[a.cell]
    at = np.repeat(first[a.cell] - (np.cumsum(times) - times), times) + np.arange(times.sum())
    return np.repeat(a.which, times) * len(b.faces.low) + b.which[at]
