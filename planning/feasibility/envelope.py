"""A solid seen along an axis: its up-faces and down-faces, projected across the axis."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planning.feasibility.solids import Solid

# Right-handed (u, v, h): coordinates across the axis, and height h along it.
PLANE = {0: (1, 2, 0), 1: (2, 0, 1), 2: (0, 1, 2)}

# A face steeper than this counts as a wall: 0.1 m of it is 0.1 um wide seen from above, far below
# any tolerance on fits, and rounding in a float32 mesh file (1e-8 m over 5 mm) tilts walls by that.
WALL_SLOPE = 1e-6


@dataclass(frozen=True, eq=False)
class Faces:
    """Triangles that all face up, or all face down, projected along the axis, widest first.

    Attributes:
        facing: +1 up, -1 down.
        corners: (m, 3, 2) projections on the (u, v) plane, counter-clockwise [m].
        planes: (m, 3) rows (g, k, c) with height = g u + k v + c [m].
        low, high: (m, 3) bounding boxes in (u, v, h) [m].
    """

    facing: int
    corners: np.ndarray
    planes: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @cached_property
    def lower(self) -> np.ndarray:
        """(3,) lower corner of the faces' common bounding box [m]."""
        return self.low.min(axis=0)

    @cached_property
    def upper(self) -> np.ndarray:
        """(3,) upper corner of the faces' common bounding box [m]."""
        return self.high.max(axis=0)

    def chosen(self, which: np.ndarray) -> Faces:
        """Return the faces at the given indices."""
        corners, planes = self.corners[which], self.planes[which]
        return Faces(self.facing, corners, planes, self.low[which], self.high[which])


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
    """Split a solid's faces into up- and down-faces along axis 0, 1 or 2; walls are left out."""
    normals = solid.doubled_areas
    area2 = normals[:, axis]  # Of the projections, doubled: negative where a face looks down.
    wall = WALL_SLOPE * np.sqrt(np.einsum("ij,ij->i", normals, normals))
    up, down = (_faces(solid, axis, np.flatnonzero(f * area2 > wall), f) for f in (1, -1))
    low, high = solid.lower[list(PLANE[axis])], solid.upper[list(PLANE[axis])]
    return Envelope(solid.name, up, down, low, high)


def _faces(solid: Solid, axis: int, chosen: np.ndarray, facing: int) -> Faces:
    """Project the chosen faces along the axis; the corners of down-faces are reversed."""
    normals, (low, high) = solid.doubled_areas, solid.face_boxes
    chosen = chosen[np.argsort(-facing * normals[chosen, axis], kind="stable")]
    u, v, h = PLANE[axis]
    corners = solid.triangles[chosen][:, ::facing]
    across = normals[chosen]
    g, k = -across[:, u] / across[:, h], -across[:, v] / across[:, h]
    c = corners[:, 0, h] - g * corners[:, 0, u] - k * corners[:, 0, v]
    seen = list(PLANE[axis])
    planes = np.stack([g, k, c], axis=1)
    return Faces(facing, corners[:, :, [u, v]], planes, low[chosen][:, seen], high[chosen][:, seen])
