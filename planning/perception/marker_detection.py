"""Markers in an image: which ones, and where their corners are to a fraction of a pixel.

Dark regions with four straight sides are candidates. The sides are found anew along lines across
them, where the image changes most; their crossings are the corners. A candidate is a marker if its
border is dark and its cells read like one of the codes, in one of four turns (Garrido-Jurado et
al., Automatic generation and detection of highly reliable fiducial markers under occlusion, 2014).
A marker that runs together with a shadow or with the hand is no such region: it is looked for where
those that were found say that it must be, since all are on one board.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import (
    binary_erosion,
    binary_fill_holes,
    find_objects,
    gaussian_filter,
    label,
    map_coordinates,
    maximum_filter,
)
from scipy.spatial import ConvexHull, QhullError

from cell.machines.cameras.marker_board import BITS, CELLS, CODES, marker_cells, marker_corners

Array = NDArray[np.float64]

LUMINANCE = np.array([0.299, 0.587, 0.114])  # [R] ITU-R BT.601.
WINDOW = 15  # In which dark is told from bright [pixels] [A]: a border next to paper, both ways.
SHARE = 0.4  # Dark is less than this of the brightest in the window [A]: a shadow leaves more.
DARKER = 12.0  # And darker than that by as many levels [A]: noise has 3.
SOFT = 0.7  # Standard deviation of the filter before cells are read [pixels] [A].
SMALLEST, LARGEST = 14, 240  # Edges of a candidate's bounding box [pixels] [A].
FULL = 0.85  # Least share of the convex hull that a filled candidate covers [A].
ACROSS = 3.0  # How far from a side its edge is looked for [pixels] [A].
STEP = 0.25  # Between samples across a side [pixels].
ALONG = np.linspace(0.08, 0.92, 41)  # Where on a side: away from the corners, which are round.
STRAY = 0.5  # Distance from a side's line at which its points are left out [pixels] [A].
ROUNDS = 2  # The second starts from the first's lines.
PARALLEL = 0.1  # Least sine of the angle between neighbouring sides [A].
CONTRAST = 25.0  # Least difference between white and black cells, in levels [A].
WRONG = 1  # Cells that may be misread [D]: codes differ in five.


def detect_markers(color: NDArray[np.uint8]) -> dict[int, Array]:
    """Return the corners (4, 2) [pixels] of the markers in an image, by their numbers.

    They are in the order of `cell.machines.cameras.marker_board.marker_corners`, in the pixel
    convention of `cell.machines.cameras.pinhole`.

    Args:
        color: (h, w, 3).
    """
    gray = color.astype(float) @ LUMINANCE
    soft = gaussian_filter(gray, SOFT)
    found: dict[int, Array] = {}
    for rough in _candidates(soft):
        corners = _refined(gray, rough)
        read = _read(soft, corners) if corners is not None else None
        if corners is not None and read is not None:
            number, turn = read
            found[number] = np.roll(corners, -turn, axis=0)
    return _completed(gray, soft, found)


def _completed(gray: Array, soft: Array, found: Mapping[int, Array]) -> dict[int, Array]:
    """Return markers with those that are found where they must be beside them."""
    known, places = dict(found), marker_corners()[:, :, :2]
    while known:
        board = places[list(known)].reshape(-1, 2)
        to_image = homography(board, np.concatenate([*known.values()]))
        more = {}
        for number in set(range(len(CODES))) - set(known):
            expected = projected(to_image, places[number])
            if not (expected > 0.0).all() or not (expected < gray.shape[::-1]).all():
                continue
            corners = _refined(gray, expected)
            if corners is not None and _read(soft, corners) == (number, 0):
                more[number] = corners
        if not more:
            break
        known |= more
    return known


def _candidates(gray: Array) -> Iterator[Array]:
    """Yield rough corners (4, 2) of dark regions with four sides, clockwise in the image."""
    bright = maximum_filter(gray, WINDOW)
    regions, _ = label((gray < SHARE * bright) & (gray < bright - DARKER))  # type: ignore[misc]
    for number, box in enumerate(find_objects(regions), start=1):
        size = [edge.stop - edge.start for edge in box]
        if min(size) < SMALLEST or max(size) > LARGEST:
            continue
        rows, columns = box[0].start, box[1].start
        far = box[0].stop == gray.shape[0] or box[1].stop == gray.shape[1]
        if min(rows, columns) == 0 or far:
            continue  # Cut off by the edge of the image.
        region = np.asarray(binary_fill_holes(regions[box] == number), bool)
        inside = np.asarray(binary_erosion(region), bool)
        outline = np.argwhere(region & ~inside)[:, ::-1]
        try:
            hull = ConvexHull(outline)
        except QhullError:
            continue
        if region.sum() >= FULL * hull.volume:
            yield _four_corners(outline[hull.vertices].astype(float)) + [columns, rows]


def _four_corners(polygon: Array) -> Array:
    """Return the polygon (4, 2) that is left when corners that cut off least are left out.

    Args:
        polygon: (n, 2) convex, counterclockwise with y up: clockwise in an image.
    """
    while len(polygon) > 4:
        before, after = np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0)
        area = np.abs(_cross(polygon - before, after - before))
        polygon = np.delete(polygon, area.argmin(), axis=0)
    return polygon


def _cross(a: Array, b: Array) -> Array:
    """Return the third components (n,) of cross products in the plane."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _refined(gray: Array, rough: Array) -> Array | None:
    """Return the crossings (4, 2) of the lines through the edges beside four sides, or None."""
    corners = rough
    for _ in range(ROUNDS):
        pairs = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        lines = [line for a, b in pairs if (line := _edge_line(gray, a, b)) is not None]
        if len(lines) < 4:
            return None
        normals, offsets = np.array(lines)[:, :2], np.array(lines)[:, 2]
        crossings = []
        for k in range(4):
            pair = [k - 1, k]
            if abs(np.linalg.det(normals[pair])) < PARALLEL:
                return None
            crossings.append(np.linalg.solve(normals[pair], offsets[pair]))
        corners = np.array(crossings)
    return corners if np.abs(corners - rough).max() < 2.0 * ACROSS else None


def _edge_line(gray: Array, a: Array, b: Array) -> Array | None:
    """Return the line (n_x, n_y, d) with n q = d through the edge beside a side; None: no edge."""
    way = b - a
    if np.linalg.norm(way) < SMALLEST / 2:
        return None
    outward = np.array([way[1], -way[0]]) / np.linalg.norm(way)
    across = np.arange(-ACROSS, ACROSS + STEP / 2, STEP)
    base = a + ALONG[:, None] * way
    points = base[:, None] + across[:, None] * outward
    values = map_coordinates(gray, points[..., ::-1].transpose(2, 0, 1), order=1, mode="nearest")
    # Outside is bright: what rises outwards belongs to the edge, and its centroid is the edge.
    rise = np.clip(np.diff(values, axis=1), 0.0, None)
    total = rise.sum(axis=1)
    clear = total > CONTRAST
    if clear.sum() < len(ALONG) / 2:
        return None
    middle = (across[:-1] + across[1:]) / 2
    place = (rise[clear] @ middle) / total[clear]
    edge = base[clear] + place[:, None] * outward
    while len(edge) >= len(ALONG) / 3:
        centre = edge.mean(axis=0)
        normal = np.linalg.svd(edge - centre)[2][1]
        near = np.abs((edge - centre) @ normal) < STRAY
        if near.all():
            return np.array([*normal, normal @ centre])
        edge = edge[near]
    return None


def _read(gray: Array, corners: Array) -> tuple[int, int] | None:
    """Return the number of a marker and how it is turned: which corner is its first; or None."""
    middles = (np.arange(CELLS) + 0.5) / CELLS
    u, v = np.meshgrid(middles, middles)
    square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    places = projected(homography(square, corners), np.column_stack([u.ravel(), v.ravel()]))
    values = map_coordinates(gray, places[:, ::-1].T, order=1, mode="nearest")
    low, high = values.min(), values.max()
    if high - low < CONTRAST:
        return None
    white = (values > (low + high) / 2).reshape(CELLS, CELLS)
    inner = white[1 : 1 + BITS, 1 : 1 + BITS]
    if white.sum() - inner.sum() > WRONG:
        return None
    for number, code in enumerate(CODES):
        for turn in range(4):
            if (np.rot90(inner, turn) != marker_cells(code)).sum() <= WRONG:
                return number, turn
    return None


def homography(plane: Array, image: Array) -> Array:
    """Return H (3, 3) that takes points (n, 2) of a plane to the image (n, 2), by least squares.

    Args:
        plane: At least four, no three of them on a line.
        image: [pixels].
    """
    # Both about their middles and of size one: otherwise the smallest singular value is lost.
    to_plane, to_image = _normalising(plane), _normalising(image)
    one, zero = np.ones(len(plane)), np.zeros((len(plane), 3))
    p = np.column_stack([plane, one]) @ to_plane.T
    u, v = (np.column_stack([image, one]) @ to_image.T)[:, :2, None].transpose(1, 0, 2)
    rows = np.concatenate([np.hstack([p, zero, -u * p]), np.hstack([zero, p, -v * p])])
    H = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    return np.linalg.inv(to_image) @ H @ to_plane


def _normalising(points: Array) -> Array:
    """Return the matrix (3, 3) that brings points (n, 2) about the origin, to a size of one."""
    middle = points.mean(axis=0)
    scale = 1.0 / np.abs(points - middle).max()
    return np.array([[scale, 0, -scale * middle[0]], [0, scale, -scale * middle[1]], [0, 0, 1.0]])


def projected(H: Array, plane: Array) -> Array:
    """Return the image (n, 2) of points (n, 2) of a plane under a homography (3, 3)."""
    image = np.column_stack([plane, np.ones(len(plane))]) @ H.T
    return np.asarray(image[:, :2] / image[:, 2:], np.float64)
