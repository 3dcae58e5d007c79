"""Markers painted over in an image, so that nothing is learned from what is absent later.

It is done with what the image itself says: the pose of the board found in it, and its depth. Every
pixel of a marker that is not behind something else gets the colour of the blank paper around it,
and as much noise as that has.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from pydrake.math import RigidTransform
from scipy.ndimage import distance_transform_edt, uniform_filter

from cell.machines.cameras.marker_board import HOLE, SIDE, marker_corners
from cell.machines.cameras.pinhole import Pinhole

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MARGIN = 2.5e-3  # About a marker that is painted over, too [m] [A]: as far as a lens spreads black.
PAPER_MARGIN = 1e-3  # At the edges of the sheet, whose colour is not taken [m] [A].
IN_FRONT = 4e-3  # What is nearer than the board by more hides it [m] [A]: ten times the noise.
EDGE = 2.5  # So near to something in front, what has no depth belongs to it [pixels] [A].
WIDTHS = (13, 81)  # Over which paper is averaged [pixels] [A]; the wider where it is far away.
ENOUGH = 0.02  # Least share of paper in such a neighbourhood [A].


def without_markers(
    color: NDArray[np.uint8],
    depth: Array,
    pinhole: Pinhole,
    X_CD: RigidTransform,
    kept: Mask,
    rng: np.random.Generator,
) -> NDArray[np.uint8]:
    """Return an image (h, w, 3) in which the markers are painted over.

    Args:
        color: (h, w, 3).
        depth: (h, w) as measured, from the same place [m]; 0 where there is none.
        pinhole: Of both.
        X_CD: The board in the camera, as found.
        kept: (h, w) what is known to be in front of the board, whatever its depth.
        rng: Of the noise.
    """
    shape = depth.shape
    hidden = kept | _in_front(depth, pinhole, X_CD)
    markers = _covered(marker_corners(MARGIN), pinhole, X_CD, shape)
    sheet = _covered(_square(SIDE / 2 - PAPER_MARGIN)[None], pinhole, X_CD, shape)
    hole = _covered(_square(HOLE / 2 + PAPER_MARGIN)[None], pinhole, X_CD, shape)
    painted, paper = markers & ~hidden, sheet & ~hole & ~markers & ~hidden
    if not painted.any() or not paper.any():
        return color.copy()
    rows, columns = np.nonzero(sheet | markers)
    box = slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)
    smooth = _spread(color[box].astype(float), paper[box])
    # The median leaves out the edges of shadows.
    noise = 1.4826 * np.median(np.abs(color[box] - smooth)[paper[box]], axis=0)
    filled = smooth[painted[box]] + rng.normal(size=(int(painted.sum()), 3)) * noise
    result = color.copy()
    result[painted] = np.clip(np.round(filled), 0, 255).astype(np.uint8)
    return result


def _in_front(depth: Array, pinhole: Pinhole, X_CD: RigidTransform) -> Mask:
    """Return which pixels (h, w) show something nearer than the board's plane."""
    rows, columns = np.indices(depth.shape)
    rays = np.stack([(columns - pinhole.cx), (rows - pinhole.cy)], axis=-1) / pinhole.focal_length
    normal = X_CD.rotation().matrix()[:, 2]
    board = normal @ X_CD.translation() / (rays @ normal[:2] + normal[2])
    front = (depth > 0.0) & (board - depth > IN_FRONT)
    if not front.any():
        return front
    # What has no depth is taken for the board: only one of the two imagers sees it, beside
    # something that is nearer. Right at the edge of that it is either.
    near = np.asarray(distance_transform_edt(~front)) <= EDGE
    return front | (near & (depth == 0.0))


def _square(half: float) -> Array:
    """Return corners (4, 3) of a square about the board's centre, in D."""
    return half * np.array([(-1.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (-1.0, -1.0, 0.0)])


def _covered(p_DQ: Array, pinhole: Pinhole, X_CD: RigidTransform, shape: tuple[int, ...]) -> Mask:
    """Return which pixels (h, w) polygons (n, k, 3) on the board cover."""
    image = Image.new("1", (shape[1], shape[0]))
    draw = ImageDraw.Draw(image)
    for corners in p_DQ:
        p_CQ = (X_CD @ corners.T).T
        if (p_CQ[:, 2] > 0.0).all():
            draw.polygon([*map(tuple, pinhole.project(p_CQ))], fill=1)
    return np.array(image)


def _spread(color: Array, paper: Mask) -> Array:
    """Return the mean colour of the paper around each pixel (h, w, 3)."""
    result = np.broadcast_to(color[paper].mean(axis=0), color.shape).copy()
    only = np.where(paper[..., None], color, 0.0)
    for width in reversed(WIDTHS):
        share = uniform_filter(paper.astype(float), width)
        enough = share > ENOUGH
        total = uniform_filter(only, width, axes=(0, 1))
        result[enough] = total[enough] / share[enough, None]
    return result
