"""Footprint of a body: the convex outline of what it stands on, seen from above."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, QhullError

# [m] [M] Depth to which 20 N press the end of the standing motor's can in simulation. A body stands
# on what is less than this above its lowest point.
USUAL_DEPTH = 0.008


@dataclass(frozen=True, eq=False)
class Footprint:
    """Convex outline of the points that a body stands on.

    Attributes:
        corners: (k, 2) counter-clockwise [m].
        edges: (k, 3) lines n . p + c = 0 with unit outward normals n.
    """

    corners: np.ndarray
    edges: np.ndarray

    def margin(self, point: np.ndarray) -> float:
        """Return how far a point (2,) is inside the outline [m]; negative outside."""
        return float(-(self.edges[:, :2] @ point + self.edges[:, 2]).max())

    def lever(self, point: np.ndarray, direction: np.ndarray) -> float:
        """Return the distance of a point (2,) from the edge over which a push tips the body [m].

        Args:
            point: (2,).
            direction: (2,) unit vector of the push.
        """
        return float((self.corners @ direction).max() - point @ direction)

    def shifted(self, by: np.ndarray) -> Footprint:
        """Return the outline moved by (2,) [m]."""
        offsets = self.edges[:, 2] - self.edges[:, :2] @ by
        return Footprint(self.corners + by, np.column_stack([self.edges[:, :2], offsets]))

    @property
    def narrowest(self) -> float:
        """Smallest distance of two parallel lines around the outline [m]."""
        depths = -(self.edges[:, :2] @ self.corners.T + self.edges[:, 2:]).min(axis=1)
        return float(depths.min())

    @property
    def circle(self) -> tuple[np.ndarray, float]:
        """Centre (2,) and diameter of the smallest circle around the outline [m]."""
        centre, radius = trimesh.nsphere.minimum_nsphere(self.corners)
        return np.asarray(centre), 2.0 * float(radius)


def footprint(points: np.ndarray) -> Footprint | None:
    """Return the outline of points (n, 2), or None if they span no area."""
    if len(points) < 3:
        return None
    try:
        hull = ConvexHull(points)
    except QhullError:  # Collinear points.
        return None
    return Footprint(points[hull.vertices], hull.equations)


def standing_points(vertices: Iterable[np.ndarray], depth: float = USUAL_DEPTH) -> np.ndarray:
    """Return the plane coordinates (m, 2) of the vertices near the lowest one.

    Args:
        vertices: Per part (n, 3) corners with z up [m].
        depth: How far above the lowest one [m].
    """
    stacked = np.concatenate(list(vertices))
    return stacked[stacked[:, 2] <= stacked[:, 2].min() + depth, :2]
