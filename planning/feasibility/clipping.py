"""Vectorised operations on many small convex polygons: clipping, areas, inscribed discs, union."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import manifold3d
import numpy as np

from planning.feasibility.envelope import cross

ROUNDING = 1e-12  # [m] [D] Far above that of float64 (1e-16 of 1 m), far below any tolerance.


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
        kept = self._valid() & (signed >= 0.0)
        number = np.count_nonzero(kept, axis=1)
        cut = np.flatnonzero((number > 0) & (number < self.count))
        count = np.where(number == self.count, self.count, 0)
        outlines, count[cut] = self.chosen(cut)._cut(signed[cut], kept[cut])
        most = max(3, int(count.max(initial=0)))
        corners = np.zeros((len(count), most, 2))
        own = min(most, self.corners.shape[1])
        corners[:, :own] = self.corners[:, :own]
        corners[cut, : outlines.shape[1]] = outlines
        return Polygons(corners, count)

    def within(self, centre: np.ndarray, reach: float) -> Polygons:
        """Return what lies within reach [m] of a point (2,) along both axes."""
        kept = self
        for axis in (0, 1):
            for sign in (1.0, -1.0):
                kept = kept.clipped(reach - sign * (kept.corners[..., axis] - centre[axis]))
        return kept

    def _cut(self, signed: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return corners (n, m, 2) and their numbers (n,) of polygons that the line crosses."""
        n, k = signed.shape
        row, following = np.arange(n)[:, None], np.arange(1, k + 1)
        following = np.where(following < self.count[:, None], following, 0)
        signed_next = signed[row, following]
        crossed = self._valid() & ((signed >= 0.0) != (signed_next >= 0.0))
        share = np.divide(signed, signed - signed_next, out=np.zeros_like(signed), where=crossed)
        crossings = self.corners + share[:, :, None] * (self.corners[row, following] - self.corners)
        # Each corner is followed by the crossing on its edge; without the unused slots that is the
        # clipped outline in order. It gains one corner at most, unless edges coincide and rounding
        # dents the polygon by 1e-18 m: then a line may cross it four times.
        outline = np.stack([self.corners, crossings], axis=2).reshape(n, 2 * k, 2)
        used = np.stack([kept, crossed], axis=2).reshape(n, 2 * k)
        place, count = np.cumsum(used, axis=1) - 1, np.count_nonzero(used, axis=1)
        corners = np.zeros((n, int(count.max(initial=0)), 2))
        at, slot = np.nonzero(used)
        corners[at, place[at, slot]] = outline[at, slot]
        return corners, count

    def _valid(self) -> np.ndarray:
        """Return (n, k) bool: corners that are not padding."""
        return np.arange(self.corners.shape[1]) < self.count[:, None]

    def closed(self) -> np.ndarray:
        """Return the corners with the padding collapsed onto the first one, (n, k, 2)."""
        return np.where(self._valid()[:, :, None], self.corners, self.corners[:, :1])

    def areas(self) -> np.ndarray:
        """Return the area of each polygon, (n,) [m^2]."""
        x, y = self._from_first()
        x_next, y_next = _following(x), _following(y)
        return 0.5 * np.einsum("ij->i", x * y_next - x_next * y)

    def discs(self) -> tuple[np.ndarray, np.ndarray]:
        """Return a disc in each polygon: the largest one centred on its centroid.

        Its radius is a third or more of the polygon's width, and half of it for the strips that
        facets make.

        Returns:
            Centres (n, 2) and radii (n,) [m], the latter 0 for a polygon without an area.
        """
        x, y = self._from_first()
        ex, ey = _following(x) - x, _following(y) - y
        lengths = np.sqrt(ex * ex + ey * ey)
        turns = x * ey - y * ex
        total = np.einsum("ij->i", turns)
        filled = (self.count >= 3) & (total > 0.0)
        share = turns / np.where(filled, 3.0 * total, 1.0)[:, None]
        cx = np.einsum("ij,ij->i", 2.0 * x + ex, share)
        cy = np.einsum("ij,ij->i", 2.0 * y + ey, share)
        away = ex * (cy[:, None] - y) - ey * (cx[:, None] - x)
        # Edges as short as rounding have no meaningful direction and are skipped. If all edges are,
        # the bound of twice the area over the perimeter limits the disc.
        away = np.divide(away, lengths, out=np.full_like(away, np.inf), where=lengths > ROUNDING)
        most = total / np.where(filled, np.einsum("ij->i", lengths), 1.0)
        radii = np.where(filled, np.clip(away.min(axis=1), 0.0, np.maximum(most, 0.0)), 0.0)
        return np.column_stack([cx, cy]) + self.corners[:, 0], radii

    def _from_first(self) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates (n, k) relative to the first corner, to keep precision far from A."""
        offsets = self.closed() - self.corners[:, :1]
        return offsets[..., 0], offsets[..., 1]

    def chosen(self, which: np.ndarray | slice) -> Polygons:
        """Return the polygons at the given indices or mask."""
        return Polygons(self.corners[which], self.count[which])

    def outlines(self, scale: float) -> list[np.ndarray]:
        """Return each polygon without its padding, its coordinates multiplied by a scale."""
        counts = self.count.tolist()
        return [
            own[:count] for own, count in zip(scale * self.corners, counts, strict=True) if count
        ]


def _following(values: np.ndarray) -> np.ndarray:
    """Return each corner's next value; arrays are (n, k)."""
    return np.concatenate([values[:, 1:], values[:, :1]], axis=1)


def triangle_overlaps(a: np.ndarray, b: np.ndarray) -> Polygons:
    """Intersect triangles pairwise; both (n, 3, 2), counter-clockwise."""
    polygons = Polygons(a, np.full(len(a), 3))
    for edge in range(3):
        start, end = b[:, edge], b[:, (edge + 1) % 3]
        offsets = polygons.corners - start[:, None]
        polygons = polygons.clipped(cross((end - start)[:, None], offsets))
    return polygons


def point_in_wide_union(several: Sequence[Polygons], radius: float) -> np.ndarray | None:
    """Return the centre (2,) of a disc of the radius [m] inside the union, or None."""
    # Clipper rounds to fixed decimals: lengths in units of the radius are far coarser than that.
    outlines = [outline for polygons in several for outline in polygons.outlines(1.0 / radius)]
    union = manifold3d.CrossSection(outlines, manifold3d.FillRule.NonZero)
    # Growing by a thousandth first closes the seams that rounding leaves between neighbours.
    seam = 1e-3
    grown = union.offset(seam, manifold3d.JoinType.Miter)
    core = grown.offset(-1.0 - seam, manifold3d.JoinType.Round)
    return None if core.is_empty() else radius * np.array(core.to_polygons()[0][0])
