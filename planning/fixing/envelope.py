"""A solid seen along an axis: its up-faces and down-faces as planes over their projections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planning.fixing.solids import Solid

# Right-handed (u, v, h): coordinates across the axis, and height h along it.
PLANE = {0: (1, 2, 0), 1: (2, 0, 1), 2: (0, 1, 2)}

# A face steeper than this is a wall: 0.1 m of it is 0.1 um wide seen from above, far below any
# tolerance on fits, and rounding in a float32 mesh file (1e-8 m over 5 mm) tilts walls that much.
WALL_SLOPE = 1e-6


@dataclass(frozen=True, eq=False)
class Faces:
    """Triangles that all face up, or all face down, projected along the axis.

    Attributes:
        corners: (m, 3, 2) projections on the (u, v) plane, counter-clockwise [m].
        planes: (m, 3) rows (g, k, c) with height = g u + k v + c [m].
        low, high: (m, 3) bounding boxes in (u, v, h) [m].
    """

    corners: np.ndarray
    planes: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def heights_over(self, point: np.ndarray) -> np.ndarray:
        """Return the heights at which these faces cross the vertical line over (u, v)."""
        near = np.all((self.low[:, :2] <= point) & (self.high[:, :2] >= point), axis=1)
        corners = self.corners[near]
        edges = np.roll(corners, -1, axis=1) - corners
        inside = np.all(cross(edges, point - corners) >= 0.0, axis=1)
        return self.planes[near][inside] @ np.append(point, 1.0)


@dataclass(frozen=True, eq=False)
class Envelope:
    """Up- and down-faces of one solid along one axis.

    Attributes:
        name: Of the part.
        up: Faces whose outward normal has a component along the axis.
        down: Faces whose outward normal has a component against it.
        low, high: (3,) bounding box in (u, v, h) [m].
    """

    name: str
    up: Faces
    down: Faces
    low: np.ndarray
    high: np.ndarray


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the z component of the cross product of plane vectors (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def envelope(solid: Solid, axis: int) -> Envelope:
    """Sort a solid's faces by the side from which they are seen along axis 0, 1 or 2."""
    triangles = solid.vertices[:, PLANE[axis]][solid.faces]
    edges = triangles[:, 1:] - triangles[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    lengths = np.linalg.norm(normals, axis=1)
    slopes = np.divide(normals[:, 2], lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
    up = _faces(triangles[slopes > WALL_SLOPE])
    down = _faces(triangles[slopes < -WALL_SLOPE][:, ::-1])
    corners = solid.vertices[:, PLANE[axis]]
    return Envelope(solid.name, up, down, corners.min(axis=0), corners.max(axis=0))


def _faces(triangles: np.ndarray) -> Faces:
    """Project (m, 3, 3) triangles in (u, v, h), counter-clockwise seen from above."""
    e1, e2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area2 = cross(e1, e2)
    g = (e1[:, 2] * e2[:, 1] - e2[:, 2] * e1[:, 1]) / area2
    k = (e1[:, 0] * e2[:, 2] - e2[:, 0] * e1[:, 2]) / area2
    c = triangles[:, 0, 2] - g * triangles[:, 0, 0] - k * triangles[:, 0, 1]
    planes = np.stack([g, k, c], axis=1)
    return Faces(triangles[:, :, :2], planes, triangles.min(axis=1), triangles.max(axis=1))
