"""The columns of the frozen bed: the floor under a part, and the rings around it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cell.soft_jig.columns import Column, ColumnMesh, TetMesh
from cell.soft_jig.leaning_bed import LeaningBed
from cell.soft_jig.parameters import JammedParameters
from cell.soft_jig.plane_cells import cell_edges
from cell.soft_jig.polygons import offset_loop
from cell.soft_jig.touching import LEAST_WALL

Array = NDArray[np.float64]

# Least height of a column around the part [m].
RIM_HEIGHT = 0.002
# How far beside the part the height of its wall is read [m]: the membrane and one bead.
BESIDE = 0.002
# Least angle between the directions in which neighbours of the outline look outwards [rad].
LEAST_TURN = 0.02
# Gap between the part and the foot of a wall [m]. With the part's edge inside the floor's columns
# a standing can makes half as many contact polygons as with its edge in the wall, mostly slivers.
FOOT_GAP = 6e-5


def floor_column(
    corners: list[int], plane: Array, tops: Array, center_top: float, params: JammedParameters
) -> Column:
    """Return a column under the part; its apex lies one layer below its top."""
    height = center_top - min(params.layer, center_top / 2)
    return Column(corners, tops, center_top, np.array([*plane[corners].mean(axis=0), height]))


@dataclass(frozen=True)
class Floor:
    """What is under the part.

    Attributes:
        plane: (n, 2) vertices.
        columns: On them.
        loop: Vertices of the outline, counter-clockwise.
    """

    plane: Array
    columns: list[Column]
    loop: list[int]

    @property
    def inner(self) -> Array:
        """The outline (k, 2) [m]."""
        return self.plane[self.loop]

    @property
    def feet(self) -> Array:
        """Height at both ends of each edge of the outline (k, 2) [m]."""
        height = {
            edge: (column.tops[k], column.tops[(k + 1) % len(column.tops)])
            for column in self.columns
            for k, edge in enumerate(cell_edges(column.corners))
        }
        return np.array([height[edge] for edge in cell_edges(self.loop)])


def with_rings(
    bed: LeaningBed, params: JammedParameters, floor: Floor, roof: Array, lean: Array
) -> TetMesh:
    """Surround the floor with a ring of columns at the wall and one out to the aperture.

    Args:
        bed: The frozen bed.
        params: Ring width, layer depth and squeeze.
        floor: What is under the part.
        roof: (k, 2) how high the bed may stand at both ends of each edge of the outline [m].
        lean: (2,) horizontal shift per height of the part's walls.

    Raises:
        BadMesh: A column folds over.
    """
    inner, away = floor.inner, _outward(floor.inner)
    circles = _circles(bed, inner, away, params)
    tops = _ring_heights(bed, inner + away * BESIDE, circles, roof, floor.feet)
    points = np.concatenate([floor.plane, *circles])
    shift, rate = _closing(_wall_heights(floor, tops[0]), params)
    outward = offset_loop(inner, 1.0) - inner
    points[floor.loop] += shift[:, None] * outward
    leans = np.tile(lean, (len(points), 1))
    leans[floor.loop] += rate[:, None] * outward
    added = len(floor.plane) + np.arange(2 * len(inner)).reshape(2, -1)
    rings = [floor.loop, *added.tolist()]
    columns = [*floor.columns, *_ring_columns(rings, points, tops, [floor.feet, None], params)]
    return ColumnMesh(points, columns, leans).build()


def _outward(loop: Array) -> Array:
    """Return unit vectors (n, 2) half way between the normals of both edges at a vertex.

    Where the outline has a step they are spread, so that the columns outside do not cross.
    """
    away = offset_loop(loop, 1.0) - loop
    angle = _spread(np.arctan2(away[:, 1], away[:, 0]))
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _spread(angle: Array) -> Array:
    """Return angles (n,) around a loop [rad], moved so that each is `LEAST_TURN` past the last."""
    step = (np.diff(angle, append=angle[0]) + np.pi) % (2 * np.pi) - np.pi
    start = (int(np.argmax(step)) + 1) % len(angle)
    turned = np.roll(angle, -start)[0] + np.concatenate(
        [[0.0], np.cumsum(np.roll(step, -start))[:-1]]
    )
    gap = LEAST_TURN * np.arange(len(angle))
    forward = np.maximum.accumulate(turned - gap) + gap
    backward = np.minimum.accumulate((turned - gap)[::-1])[::-1] + gap
    return np.roll((forward + backward) / 2, start)


def _circles(
    bed: LeaningBed, inner: Array, away: Array, params: JammedParameters
) -> tuple[Array, Array]:
    """Return the plane vertices (n, 2) of the ring around the wall and of the one at the rim."""
    # The cap is steep at its edge: end a little inside, with an upright face.
    radius = bed.bag.aperture_radius - 2 * bed.bag.cell
    to_edge = _distance_to_circle(inner - bed.middle, away, radius)
    middle = inner + away * np.minimum(params.ring, to_edge / 2)[:, None]
    return middle, inner + away * to_edge[:, None]


def _distance_to_circle(xy: Array, direction: Array, radius: float) -> Array:
    along = np.einsum("ij,ij->i", xy, direction)
    return -along + np.sqrt(along**2 + radius**2 - np.einsum("ij,ij->i", xy, xy))


# Heights of the rings, at both ends (n, 2) of each edge around the outline.


def _ring_heights(
    bed: LeaningBed, beside: Array, circles: Sequence[Array], roof: Array, foot: Array
) -> list[Array]:
    """Return the heights of the wall's rim and of the two rings around it."""
    lowest_roof = np.minimum(roof[:, 0], np.roll(roof[:, 1], 1))
    rim = _rim(_at_both_ends(bed.height_beside(beside)), roof, _at_both_ends(lowest_roof), foot)
    tops = [np.minimum(bed.height_beside(ring), lowest_roof) for ring in circles]
    return [rim, *(_at_both_ends(np.maximum(top, RIM_HEIGHT)) for top in tops)]


def _rim(beside: Array, roof: Array, lowest_roof: Array, foot: Array) -> Array:
    """Return the height of the wall's upper rim: the bed's, below what hangs over it."""
    rim = np.maximum(np.minimum(beside, roof), foot)
    lowered = np.minimum(rim, lowest_roof)
    # The bed beside an edge is above the floor or below it, never one at each end.
    crossing = np.any(lowered > foot, axis=1) & np.any(lowered < foot, axis=1)
    return np.where(crossing[:, None], rim, lowered)


def _at_both_ends(heights: Array) -> Array:
    return np.column_stack([heights, np.roll(heights, -1)])


# Columns.


def _wall_heights(floor: Floor, rim: Array) -> Array:
    """Return the height (n,) of the wall around one flat floor; 0 where it has a step."""
    if len(floor.columns) > 1:
        return np.zeros(len(floor.loop))
    (column,) = floor.columns
    low = column.tops[[column.corners.index(corner) for corner in floor.loop]]
    sides = np.column_stack([rim[:, 0], np.roll(rim[:, 1], 1)]) - low[:, None]
    even = sides.min(axis=1) > sides.max(axis=1) / 2
    return np.where(even, sides.max(axis=1), 0.0)


def _closing(wall: Array, params: JammedParameters) -> tuple[Array, Array]:
    """Return how far to shift the wall's foot outwards and its slope (n,); the mean stays.

    A wall that is low or uneven, or not around one flat floor, keeps its offset as a whole.
    """
    if wall.min() < max(LEAST_WALL, wall.max() / 2):
        return np.zeros(len(wall)), np.zeros(len(wall))
    shift = FOOT_GAP - params.squeeze
    return np.full(len(wall), shift), -2 * shift / wall


def _ring_columns(
    rings: Sequence[list[int]],
    points: Array,
    tops: Sequence[Array],
    feet: Sequence[Array | None],
    params: JammedParameters,
) -> Iterator[Column]:
    """Yield the columns between each ring of vertices and the next; `feet` of their inner walls."""
    for level, foot in enumerate(feet):
        (lower, upper), count = rings[level : level + 2], len(rings[level])
        for k in range(count):
            j = (k + 1) % count
            (a, d), (b, c) = tops[level][k], tops[level + 1][k]
            corners = [lower[k], upper[k], upper[j], lower[j]]
            wall = foot if foot is None else foot[k]
            yield _ring_column(corners, points, np.array([a, b, c, d]), wall, params)


def _ring_column(
    corners: list[int], plane: Array, tops: Array, foot: Array | None, params: JammedParameters
) -> Column:
    """Return a column whose apex lies behind the middle of its wall, one layer below its top."""
    xy = plane[corners].mean(axis=0)
    # Both triangles of the top face must be seen from below.
    top = min(_plane_height(plane, corners, tops, three, xy) for three in ([0, 1, 2], [0, 2, 3]))
    height = top - min(params.layer, top / 2)
    if foot is not None:
        height = min(height, (float(foot.mean()) + top) / 2)
    return Column(corners, tops, top, np.array([*xy, height]))


def _plane_height(
    plane: Array, corners: list[int], tops: Array, three: list[int], xy: Array
) -> float:
    points = np.column_stack([plane[corners][three], np.ones(3)])
    return float(np.array([*xy, 1.0]) @ np.linalg.solve(points, tops[three]))
