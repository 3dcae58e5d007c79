"""Convex polygons in the plane and the underside of convex bodies, for meshing the frozen bed.

Polygons are (k, 2) arrays, counter-clockwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

Array = NDArray[np.float64]

# Faces that point down by less than this count as walls (cosine of 85 deg).
WALL_COSINE = 0.087
# Distance below which two points of a mesh are one [m].
WELD = 1e-7


@dataclass(frozen=True)
class Facet:
    """A planar face of a convex body that looks down: z = slope . xy + offset over a polygon."""

    polygon: Array
    slope: Array
    offset: float

    def height(self, xy: Array) -> Array:
        """Return z at (..., 2) points."""
        return xy @ self.slope + self.offset


def lower_facets(vertices: Array) -> list[Facet]:
    """Return the downward faces of the convex hull of (n, 3) vertices, coplanar ones merged."""
    hull = ConvexHull(vertices)
    groups: dict[tuple[float, ...], set[int]] = {}
    equations: dict[tuple[float, ...], Array] = {}
    for simplex, equation in zip(hull.simplices, hull.equations, strict=True):
        if equation[2] < -WALL_COSINE:
            key = (*np.round(equation[:3], 5), round(float(equation[3]), 6))
            groups.setdefault(key, set()).update(simplex.tolist())
            equations.setdefault(key, equation)
    facets = []
    for key, members in groups.items():
        normal, distance = equations[key][:3], equations[key][3]
        corners = vertices[sorted(members), :2]
        polygon = corners[_ccw(corners)]
        facets.append(Facet(polygon, -normal[:2] / normal[2], float(-distance / normal[2])))
    return facets


def _ccw(corners: Array) -> NDArray[np.intp]:
    offset = corners - corners.mean(axis=0)
    return np.argsort(np.arctan2(offset[:, 1], offset[:, 0]))


def convex_hull(points: Array) -> Array:
    """Return the convex hull of (n, 2) points, counter-clockwise."""
    return points[ConvexHull(points).vertices]


def edge_normals(polygon: Array) -> tuple[Array, Array]:
    """Return outward unit normals (k, 2) of the edges i -> i + 1 and their distances (k,)."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    normal = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.linalg.norm(edge, axis=1)[:, None]
    return normal, np.einsum("ij,ij->i", normal, polygon)


def contains(polygon: Array, xy: Array, tolerance: float = 1e-9) -> NDArray[np.bool_]:
    """Say which of (n, 2) points lie in a convex polygon, its border included."""
    normal, distance = edge_normals(polygon)
    return np.all(xy @ normal.T <= distance + tolerance, axis=1)


def clip_half_plane(polygon: Array, normal: Array, distance: float) -> Array:
    """Return the part of a convex polygon with normal . x <= distance; empty (0, 2) if none."""
    side = polygon @ normal - distance
    side[np.abs(side) < WELD] = 0.0
    kept = []
    for i, here in enumerate(side):
        j = (i + 1) % len(side)
        if here <= 0:
            kept.append(polygon[i])
        if here * side[j] < 0:
            kept.append(polygon[i] + (polygon[j] - polygon[i]) * here / (here - side[j]))
    return np.array(kept) if len(kept) > 2 and area(np.array(kept)) > 1e-9 else np.zeros((0, 2))


def clip(polygon: Array, window: Array) -> Array:
    """Return the intersection of two convex polygons."""
    for normal, distance in zip(*edge_normals(window), strict=True):
        if len(polygon) == 0:
            return polygon
        polygon = clip_half_plane(polygon, normal, distance)
    return polygon


def subtract(polygon: Array, hole: Array) -> list[Array]:
    """Return convex pieces of `polygon` minus the convex `hole`."""
    pieces = []
    for normal, distance in zip(*edge_normals(hole), strict=True):
        if len(polygon) == 0:
            break
        pieces.append(clip_half_plane(polygon, -normal, -distance))
        polygon = clip_half_plane(polygon, normal, distance)
    return [piece for piece in pieces if len(piece)]


def closed_up(polygon: Array, others: Sequence[Array], crack: float) -> Array:
    """Return the polygon with corners that are nearer than ``crack`` to another one moved onto it.

    To a corner of the other polygon where there is one that near, otherwise to its border.
    """
    for other in others:
        if len(polygon) == 0:
            break
        polygon = np.array([_moved_onto(corner, other, crack) for corner in polygon])
        distinct = np.abs(polygon - np.roll(polygon, 1, axis=0)).max(axis=1) > WELD
        polygon = polygon[distinct] if distinct.sum() > 2 else np.zeros((0, 2))
    return polygon


def _moved_onto(corner: Array, other: Array, crack: float) -> Array:
    edge = np.roll(other, -1, axis=0) - other
    along = np.einsum("ij,ij->i", corner - other, edge) / np.einsum("ij,ij->i", edge, edge)
    border = other + np.clip(along, 0.0, 1.0)[:, None] * edge
    for candidates in (other, border):
        distance = np.linalg.norm(candidates - corner, axis=1)
        if distance.min() < crack:
            return candidates[np.argmin(distance)]
    return corner


def area(polygon: Array) -> float:
    """Return the signed area (counter-clockwise is positive)."""
    x, y = polygon.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def offset_loop(polygon: Array, distance: float) -> Array:
    """Return the loop with every edge moved outwards by `distance` (inwards if negative)."""
    normal, _ = edge_normals(polygon)
    before = np.roll(normal, 1, axis=0)
    both = normal + before
    return polygon + distance * both / (1 + np.einsum("ij,ij->i", normal, before))[:, None]
