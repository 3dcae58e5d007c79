"""Broad phase: which faces of two parts can hit each other along an axis.

A pair counts if the bounding rectangles of the projections overlap and the up-face can lie above
the down-face somewhere in that overlap. The second test bounds the height difference, a linear
function, over the rectangle: it discards the faces of two surfaces that lie on each other, of which
a finely tessellated fit has tens of thousands. Of parts with many faces, only those that share a
place (``cells``) are paired.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planning.feasibility.cells import crossing_pairs, touching
from planning.feasibility.clipping import Polygons, triangle_overlaps
from planning.feasibility.envelope import Faces

DENSE = 400_000  # Up to this many pairs, comparing all with all is faster than a grid.
ON_EDGE = 1e-12  # [m] A point on the edge of a face's box counts as inside.
OUTERMOST = 96  # Faces of each part about a point: more than lie within a few tolerances of it.
FIRST_ROW, FIRST_COLUMN = 1, 2
# Cosine of 20 degrees. [D] Between normals of facets on each other, of 12 and of 36 to a turn.
OPPOSED = 0.94
CELLS_PER_FACE = 6.0  # A face lies in a few cells of the grid; larger cells hold more faces each.


@dataclass(frozen=True, eq=False)
class FacePairs:
    """Faces that can hit each other, widest common rectangle first.

    Attributes:
        down: Faces of the moving part that face against the direction.
        up: Faces of the stationary part that face along it.
        d, u: (p,) indices into them.
        low, high: (p, 2) common rectangles [m].
    """

    down: Faces
    up: Faces
    d: np.ndarray
    u: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @cached_property
    def overlaps(self) -> Polygons:
        """Where the two faces of each pair overlap, seen along the axis, possibly nowhere."""
        return triangle_overlaps(self.down.corners[self.d], self.up.corners[self.u])

    def __len__(self) -> int:
        return len(self.d)

    def chosen(self, which: np.ndarray | slice) -> FacePairs:
        """Return the pairs at the given indices."""
        chosen = self.d[which], self.u[which], self.low[which], self.high[which]
        return FacePairs(self.down, self.up, *chosen)

    def near(self, point: np.ndarray, reach: float) -> FacePairs:
        """Return the pairs whose common rectangle comes near a point (2,) of the plane [m]."""
        meets = (self.low <= point + reach) & (self.high >= point - reach)
        return self.chosen(np.flatnonzero(meets[:, 0] & meets[:, 1]))


def blocked_regions(several: Sequence[FacePairs], height: float) -> Polygons:
    """Return the regions in which each up-face is above its down-face by more than a height [m].

    One polygon per pair, in order, possibly empty. Several pairs of parts go into one array, since
    clipping few polygons takes as long as clipping many. Of two faces that lie on each other, the
    height counts across them (see ``_least_excess``).
    """
    if len(several) == 1:
        overlaps = several[0].overlaps  # Kept: ambiguous parts are decided at several heights.
    else:
        down = np.concatenate([pairs.down.corners[pairs.d] for pairs in several])
        up = np.concatenate([pairs.up.corners[pairs.u] for pairs in several])
        overlaps = triangle_overlaps(down, up)
    below = np.concatenate([pairs.down.planes[pairs.d] for pairs in several])
    above = np.concatenate([pairs.up.planes[pairs.u] for pairs in several])
    excess = above - below
    slope, offset = excess[:, None, :2], excess[:, 2] - _least_excess(below, above, height)
    return overlaps.clipped((overlaps.corners * slope).sum(axis=2) + offset[:, None])


def _least_excess(below: np.ndarray, above: np.ndarray, height: float) -> np.ndarray:
    """Return how far along the axis an up-face must rise above a down-face to count, (p,) [m].

    Facets of a ball and of its seat, or of a plug and its tapered hole, cross by their sagitta
    across the surface: along the axis that is the more, the steeper they are. So for faces that lie
    on each other the height is one across the steeper face.

    Args:
        below: (p, 3) planes of the down-faces as in ``Faces``.
        above: (p, 3) planes of the up-faces.
        height: Overlap that does not count [m].
    """
    a, b = below[:, :2], above[:, :2]
    steep_a, steep_b = (1.0 + np.einsum("ij,ij->i", s, s) for s in (a, b))
    alike = 1.0 + np.einsum("ij,ij->i", a, b)
    opposed = alike > OPPOSED * np.sqrt(steep_a * steep_b)
    return height * np.where(opposed, np.sqrt(np.maximum(steep_a, steep_b)), 1.0)


def heights_over(faces: Faces, points: np.ndarray) -> list[np.ndarray]:
    """Return the heights at which faces cross the vertical line over each point (q, 2)."""
    point, face = _points_in_boxes(points, faces.low[:, :2] - ON_EDGE, faces.high[:, :2] + ON_EDGE)
    at = points[point]
    x, y = (faces.corners[face, :, k] - at[:, k, None] for k in (0, 1))
    turns = x * y[:, [1, 2, 0]] - x[:, [1, 2, 0]] * y
    inside = (turns[:, 0] >= 0.0) & (turns[:, 1] >= 0.0) & (turns[:, 2] >= 0.0)
    point, planes = point[inside], faces.planes[face[inside]]
    heights = planes[:, 0] * at[inside, 0] + planes[:, 1] * at[inside, 1] + planes[:, 2]
    order = np.argsort(point, kind="stable")
    return np.split(heights[order], np.searchsorted(point[order], np.arange(1, len(points))))


def _points_in_boxes(
    points: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of points (q, 2) and of rectangles that they lie in.

    Points are few and rectangles many: those between whose ends along the first axis no point lies
    are dropped at once.
    """
    order = np.argsort(points[:, 0], kind="stable")
    sorted_points = points[order]
    first = np.searchsorted(sorted_points[:, 0], low[:, 0], "left")
    count = np.searchsorted(sorted_points[:, 0], high[:, 0], "right") - first
    box = np.repeat(np.arange(len(low)), count)
    at = np.repeat(first, count) + _ranges(count)
    across = sorted_points[at, 1]
    inside = np.flatnonzero((across >= low[box, 1]) & (across <= high[box, 1]))
    return order[at[inside]], box[inside]


def paired(down: Faces, up: Faces, d: np.ndarray, u: np.ndarray) -> FacePairs:
    """Return the pairs of down-faces d with up-faces u, given by their indices."""
    low = np.maximum(down.low[d, :2], up.low[u, :2])
    high = np.minimum(down.high[d, :2], up.high[u, :2])
    return FacePairs(down, up, d, u, low, high)


def overlapping_faces(a: Faces, b: Faces) -> FacePairs:
    """Return all pairs of faces, one of each, whose bounding rectangles overlap."""
    if not len(a.low) or not len(b.low):
        nothing = np.zeros(0, int)
        return paired(a, b, nothing, nothing)
    near = []
    for own, other in ((a, b), (b, a)):
        low, high = other.lower[:2], other.upper[:2]
        meets = (own.low[:, :2] < high) & (own.high[:, :2] > low)
        near.append(np.flatnonzero(meets[:, 0] & meets[:, 1]))
    d, u = near
    if not len(d) or not len(u):
        return paired(a, b, d[:0], u[:0])
    boxes = a.low[d, :2], a.high[d, :2], b.low[u, :2], b.high[u, :2]
    row, column = box_pairs(*boxes)
    return paired(a, b, d[row], u[column])


def faces_about(down: Faces, up: Faces, point: np.ndarray, reach: float) -> FacePairs:
    """Return the pairs of the lowest down-faces and the highest up-faces near a point (2,) [m].

    The faces below them, as of the turns of a thread, only cover the same regions once more.
    """
    d, u = (_outermost(faces, point, reach) for faces in (down, up))
    return paired(down, up, np.repeat(d, len(u)), np.tile(u, len(d)))


def _outermost(faces: Faces, point: np.ndarray, reach: float) -> np.ndarray:
    low, high = point - reach, point + reach
    near = (faces.low[:, 0] <= high[0]) & (faces.high[:, 0] >= low[0])
    near &= (faces.low[:, 1] <= high[1]) & (faces.high[:, 1] >= low[1])
    near = np.flatnonzero(near)
    near = near[touching(faces, near, low[None], high[None])]
    heights = faces.planes[near, :2] @ point + faces.planes[near, 2]
    heights = np.clip(heights, faces.low[near, 2], faces.high[near, 2])
    return near[np.argsort(-faces.facing * heights, kind="stable")[:OUTERMOST]]


def crossing_faces(down: Faces, up: Faces, height: float) -> FacePairs:
    """Return the pairs of faces that can hit each other.

    Args:
        down: Faces of the moving part that face against the direction.
        up: Faces of the stationary part that face along it.
        height: How far the up-face must rise above the down-face somewhere to count [m].
    """
    d, u = _near(down, up, height), _near(up, down, height)
    if not len(d) or not len(u):
        return paired(down, up, d[:0], u[:0])
    if len(d) * len(u) > DENSE:
        d, u = crossing_pairs(down, up, d, u, height)
    else:
        boxes = down.low[d, :2], down.high[d, :2], up.low[u, :2], up.high[u, :2]
        row, column = box_pairs(*boxes)
        d, u = d[row], u[column]
    chosen = up.high[u, 2] > down.low[d, 2] + height
    d, u = d[chosen], u[chosen]
    pairs = paired(down, up, d, u)
    size = pairs.high - pairs.low
    bound = excess_bound(up.planes[u] - down.planes[d], pairs.low, size)
    chosen = np.flatnonzero(bound > height)
    width = np.minimum(size[chosen, 0], size[chosen, 1])
    return pairs.chosen(chosen[np.argsort(-width, kind="stable")])


def excess_bound(excess: np.ndarray, low: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the largest value of linear functions over rectangles [m].

    Args:
        excess: (p, 3) planes as in ``Faces``.
        low: (p, 2) lower corners of the rectangles [m].
        size: (p, 2) their sizes [m].
    """
    half = size / 2
    over_centre = np.einsum("ij,ij->i", excess[:, :2], low + half) + excess[:, 2]
    return over_centre + np.einsum("ij,ij->i", np.abs(excess[:, :2]), half)


def _near(faces: Faces, others: Faces, height: float) -> np.ndarray:
    """Return indices of the faces within the others' common box, along the axis too."""
    if not len(others.low):
        return np.empty(0, int)
    low, high = others.lower, others.upper
    near = (faces.low[:, 0] < high[0]) & (faces.high[:, 0] > low[0])
    near &= (faces.low[:, 1] < high[1]) & (faces.high[:, 1] > low[1])
    # Down-faces below the others' top, or up-faces above the others' bottom.
    if faces.facing < 0:
        near &= faces.low[:, 2] < high[2] - height
    else:
        near &= faces.high[:, 2] > low[2] + height
    return np.flatnonzero(near)


def box_pairs(
    low_a: np.ndarray, high_a: np.ndarray, low_b: np.ndarray, high_b: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of rectangles that overlap, one of (n, 2) with one of (m, 2) each."""
    if len(low_a) * len(low_b) > DENSE:
        return _grid_pairs(low_a, high_a, low_b, high_b)
    mask = low_a[:, None, 0] < high_b[None, :, 0]
    mask &= high_a[:, None, 0] > low_b[None, :, 0]
    mask &= low_a[:, None, 1] < high_b[None, :, 1]
    mask &= high_a[:, None, 1] > low_b[None, :, 1]
    row, column = np.nonzero(mask)
    return row, column


def _grid_pairs(
    low_a: np.ndarray, high_a: np.ndarray, low_b: np.ndarray, high_b: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find overlapping rectangles with a grid over the region that both sides cover."""
    origin = np.maximum(low_a.min(axis=0), low_b.min(axis=0))
    end = np.minimum(high_a.max(axis=0), high_b.max(axis=0))
    in_a, in_b = (
        np.flatnonzero(((low < end) & (high > origin)).all(axis=1))
        for low, high in ((low_a, high_a), (low_b, high_b))
    )
    if not len(in_a) or not len(in_b):
        return in_a[:0], in_b[:0]
    low_a, high_a, low_b, high_b = low_a[in_a], high_a[in_a], low_b[in_b], high_b[in_b]
    low_a, low_b = np.maximum(low_a, origin), np.maximum(low_b, origin)
    high_a, high_b = np.minimum(high_a, end), np.minimum(high_b, end)
    # Cells as small as possible while a face lies in few of them on average.
    sizes = np.concatenate([high_a - low_a, high_b - low_b])
    cell = max(float(np.sqrt(np.mean(np.prod(sizes, axis=1)))), 1e-9)
    while np.prod(np.floor(sizes / cell) + 1.0, axis=1).mean() > CELLS_PER_FACE:
        cell *= 1.5
    columns = int((end[1] - origin[1]) / cell) + 1
    face_a, cell_a, first_a = _cells_of((low_a - origin) / cell, (high_a - origin) / cell, columns)
    face_b, cell_b, first_b = _cells_of((low_b - origin) / cell, (high_b - origin) / cell, columns)
    order = np.argsort(cell_b, kind="stable")
    face_b, cell_b, first_b = face_b[order], cell_b[order], first_b[order]
    start, stop = (np.searchsorted(cell_b, cell_a, side) for side in ("left", "right"))
    count = stop - start
    at_b = np.repeat(start, count) + _ranges(count)
    # A pair is found in every cell that both lie in; only the first, by row and column, keeps it.
    own = np.flatnonzero((np.repeat(first_a, count) | first_b[at_b]) == (FIRST_ROW | FIRST_COLUMN))
    a, b = np.repeat(face_a, count)[own], face_b[at_b[own]]
    meet = (low_a[a] < high_b[b]) & (high_a[a] > low_b[b])
    meet = np.flatnonzero(meet[:, 0] & meet[:, 1])
    return in_a[a[meet]], in_b[b[meet]]


def _cells_of(
    low: np.ndarray, high: np.ndarray, columns: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return face index, cell number and edge flags for each cell that each rectangle reaches.

    The flags, ``FIRST_ROW`` or ``FIRST_COLUMN`` or both, say whether the cell is in the first row
    and column of the rectangle's cells.
    """
    first, last = low.astype(int), high.astype(int)
    span = last - first + 1
    count = span[:, 0] * span[:, 1]
    face = np.repeat(np.arange(len(low)), count)
    row, column = np.divmod(_ranges(count), span[face, 1])
    edge = np.where(row == 0, FIRST_ROW, 0) | np.where(column == 0, FIRST_COLUMN, 0)
    return face, (first[face, 0] + row) * columns + first[face, 1] + column, edge


def _ranges(count: np.ndarray) -> np.ndarray:
    """Return 0 ... count[0] - 1, 0 ... count[1] - 1, and so on, in one array."""
    return np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
