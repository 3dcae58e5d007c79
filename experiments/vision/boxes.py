"""Boxes of truth and estimate over a camera's image, as the paper draws them."""

from __future__ import annotations

import io
from collections.abc import Mapping
from itertools import pairwise

from PIL import Image, ImageDraw
from pydrake.math import RigidTransform

from cell.machines.cameras.camera import Picture
from planning.perception.surface import Surface

TRUTH, ESTIMATE = (40, 170, 60), (40, 90, 230)  # Colours, green and blue as in the paper [S].
RINGS = ((0, 1, 3, 2, 0), (4, 5, 7, 6, 4), (0, 4), (1, 5), (2, 6), (3, 7))  # Edges by corners.


def with_boxes(
    picture: Picture, surface: Surface, poses: Mapping[tuple[int, int, int], RigidTransform]
) -> bytes:
    """Return the colour image of a picture as a PNG, with a part's bounding boxes drawn in.

    Args:
        picture: With colour.
        surface: Of the part.
        poses: X_WP by the colour of the box.
    """
    assert picture.color is not None
    image = Image.fromarray(picture.color)
    draw = ImageDraw.Draw(image)
    for color, X_WP in poses.items():
        X_CP = picture.X_WC.inverse() @ X_WP
        pixels = picture.pinhole.project((X_CP @ surface.corners.T).T)
        for ring in RINGS:
            for a, b in pairwise(ring):
                draw.line([*map(tuple, pixels[[a, b]])], fill=color, width=2)
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    return buffer.getvalue()
