"""Many small convex polygons at once: clip by half planes, measure, and merge."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np

from planning.fixing.envelope import cross


@dataclass(frozen=True, eq=False)
class Polygons:
    """Convex polygons, counter-clockwise, in arrays padded to the longest.

    Attributes:
        corners: (n, k, 2) [m]; corners from ``count`` on are padding.
        count: (n,) number of corners; 0 for an empty polygon.
    """

    corners: np.ndarray
    count: np.ndarray

    def clipped(self, signed: np.ndarray) -> Polygons:
        """Keep the side where a linear function is not negative (Sutherland and Hodgman).

        Args:
            signed: (n, k) value of each polygon's linear function at its corners.
        """
        n, k = signed.shape
        row, column = np.arange(n)[:, None], np.arange(k)
        valid = column < self.count[:, None]
        following = np.where(column + 1 < self.count[:, None], column + 1, 0)
        signed_next = signed[row, following]
        corners_next = self.corners[row, following]
        kept = valid & (signed >= 0.0)
        crossed = valid & ((signed >= 0.0) != (signed_next >= 0.0))
        share = np.divide(signed, signed - signed_next, out=np.zeros_like(signed), where=crossed)
        crossings = self.corners + share[:, :, None] * (corners_next - self.corners)
        # Each corner is followed by the crossing on its edge; dropping the unused slots leaves the
        # clipped outline in order. Clipping a convex polygon adds at most one corner.
        corners = np.stack([self.corners, crossings], axis=2).reshape(n, 2 * k, 2)
        used = np.stack([kept, crossed], axis=2).reshape(n, 2 * k)
        order = np.argsort(~used, axis=1, kind="stable")[:, : k + 1]
        return Polygons(corners[row, order], used.sum(axis=1))

    def closed(self) -> np.ndarray:
        """Return the corners with the padding collapsed onto the first one, (n, k, 2)."""
        valid = np.arange(self.corners.shape[1]) < self.count[:, None]
        return np.where(valid[:, :, None], self.corners, self.corners[:, :1])

    def inradius_bounds(self) -> np.ndarray:
        """Return a lower bound on each polygon's inscribed radius, area over perimeter [m]."""
        areas, perimeters = self.areas_and_perimeters()
        return np.divide(areas, perimeters, out=np.zeros_like(areas), where=perimeters > 0.0)

    def areas_and_perimeters(self) -> tuple[np.ndarray, np.ndarray]:
        """Return both for each polygon, (n,) [m^2] and (n,) [m]."""
        corners = self.closed()
        # From the first corner, to lose no digits far from the origin.
        x, y = corners[..., 0] - corners[:, :1, 0], corners[..., 1] - corners[:, :1, 1]
        following = np.r_[1 : x.shape[1], 0]
        x_next, y_next = x[:, following], y[:, following]
        areas = 0.5 * np.einsum("ij->i", x * y_next - x_next * y)
        return areas, np.einsum("ij->i", np.hypot(x_next - x, y_next - y))

    def centres(self) -> np.ndarray:
        """Return a point (n, 2) inside each polygon that has an area: the mean of its corners."""
        valid = np.arange(self.corners.shape[1]) < self.count[:, None]
        total = np.einsum("ijk,ij->ik", self.corners, valid.astype(float))
        return total / np.maximum(self.count, 1)[:, None]

    def chosen(self, which: np.ndarray | slice) -> Polygons:
        """Return the polygons at the given indices or mask."""
        return Polygons(self.corners[which], self.count[which])

    def outlines(self) -> list[np.ndarray]:
        """Return each polygon without its padding."""
        return [corners[:count] for corners, count in zip(self.corners, self.count, strict=True)]


def triangle_overlaps(a: np.ndarray, b: np.ndarray) -> Polygons:
    """Intersect triangles pairwise; both (n, 3, 2), counter-clockwise."""
    polygons = Polygons(a, np.full(len(a), 3))
    for edge in range(3):
        start, end = b[:, edge], b[:, (edge + 1) % 3]
        offsets = polygons.corners - start[:, None]
        polygons = polygons.clipped(cross((end - start)[:, None], offsets))
    return polygons


def point_in_wide_union(outlines: list[np.ndarray], radius: float) -> np.ndarray | None:
    """Return a point (2,) of the union that a disc of the radius [m] fits around, if one does."""
    # Clipper rounds to fixed decimals: measuring in radii keeps any size of part away from that.
    scaled = [outline / radius for outline in outlines]
    union = manifold3d.CrossSection(scaled, manifold3d.FillRule.NonZero)
    # Growing by a thousandth first closes the seams that rounding leaves between neighbours.
    seam = 1e-3
    grown = union.offset(seam, manifold3d.JoinType.Miter)
    core = grown.offset(-1.0 - seam, manifold3d.JoinType.Round)
    return None if core.is_empty() else radius * np.array(core.to_polygons()[0][0])
