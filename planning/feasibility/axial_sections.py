"""Sections of a part in half-planes through an axis, and how parts meet in them as they turn.

A screw motion takes a section in one half-plane to the next one, shifted along the axis. So one set
of sections of each part serves for every angle of a turn and every advance: what would be a boolean
operation of two solids is a shift and an intersection of plane polygons, exact in each half-plane.
"""

from __future__ import annotations

from collections.abc import Sequence

import manifold3d
import numpy as np
from manifold3d import CrossSection, JoinType

COUNT = 24  # Half-planes, 15 degrees apart: two to three see each corner of a hexagon.
FIRST = 0.1  # [rad] [A] Of the first one: off the planes in which meshes have their corners.
FINE = 1e-3  # [mm] Corners of a section that deviate less are left out.


def axial_sections(
    manifold: manifold3d.Manifold, axis: np.ndarray, centre: np.ndarray
) -> list[CrossSection]:
    """Return a part's sections in ``COUNT`` half-planes about an axis.

    Args:
        manifold: The part [m].
        axis: (3,) unit vector.
        centre: (3,) point on it [m].

    Returns:
        Polygons in (r, z) [mm], by angle, right-handed about the axis; r >= 0, z from the centre.
    """
    x = np.linalg.svd(axis[None])[2][1]
    y = np.cross(axis, x)
    low, high = _along(manifold, axis, centre)
    half = CrossSection.square([high, high - low]).translate([0.0, low])
    found: list[CrossSection] = [CrossSection()] * COUNT
    for k in range(COUNT // 2):
        angle = FIRST + 2.0 * np.pi * k / COUNT
        across = np.cos(angle) * x + np.sin(angle) * y
        rows = 1e3 * np.array([across, axis, np.cross(across, axis)])
        flat = manifold.transform(np.c_[rows, -rows @ centre]).slice(0.0).simplify(FINE)
        found[k] = flat ^ half
        found[k + COUNT // 2] = flat.mirror([1.0, 0.0]) ^ half
    return found


def _along(
    manifold: manifold3d.Manifold, axis: np.ndarray, centre: np.ndarray
) -> tuple[float, float]:
    """Return bounds of a part along an axis from a point on it [mm], generous ones."""
    box = np.array(manifold.bounding_box()).reshape(2, 3)
    reach = 1e3 * float(np.linalg.norm(np.abs(box - centre).max(axis=0))) + 1.0
    return -reach, reach


def shrunk(sections: Sequence[CrossSection], depth: float) -> list[CrossSection]:
    """Return sections without a layer of some depth [mm] at their boundary."""
    return [section.offset(-depth, JoinType.Miter, 2.0) for section in sections]


def meeting(
    moving: Sequence[CrossSection], staying: Sequence[CrossSection], turn: int, advance: float
) -> np.ndarray:
    """Return where two parts share material after a screw motion, (COUNT,) areas [mm2].

    Args:
        moving: Sections of the part that moves.
        staying: Those of the part that stays.
        turn: Angle by which it turns, in steps of a turn divided by ``COUNT``.
        advance: Distance by which it moves along the axis [mm].
    """
    return np.array(
        [
            (moving[(k - turn) % COUNT].translate([0.0, advance]) ^ staying[k]).area()
            for k in range(COUNT)
        ]
    )


def filled_widths(
    sections: Sequence[CrossSection], inner: float, outer: float, heights: np.ndarray
) -> np.ndarray:
    """Return how much of a band of radii is filled at each height, (COUNT, n) [mm].

    Args:
        sections: Of a part.
        inner: Radius at which the band begins [mm].
        outer: Radius at which it ends [mm].
        heights: (n,) ascending [mm].
    """
    widths = np.zeros((len(sections), len(heights)))
    for own, section in zip(widths, sections, strict=True):
        for polygon in section.to_polygons():
            start, end = polygon, np.roll(polygon, -1, axis=0)
            first = np.searchsorted(heights, np.minimum(start[:, 1], end[:, 1]))
            count = np.searchsorted(heights, np.maximum(start[:, 1], end[:, 1])) - first
            edge = np.repeat(np.arange(len(polygon)), count)
            place = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - first, count)
            rise = end[edge, 1] - start[edge, 1]
            share = (heights[place] - start[edge, 1]) / rise
            radius = start[edge, 0] + share * (end[edge, 0] - start[edge, 0])
            np.add.at(own, place, np.sign(rise) * np.clip(radius, inner, outer))
    return widths
