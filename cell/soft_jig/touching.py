"""Where a part touches the frozen bed: the facets of its underside, and what hangs over the bed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cell.soft_jig.leaning_bed import LeaningBed
from cell.soft_jig.polygons import (
    Facet,
    area,
    clip,
    closed_up,
    contains,
    convex_hull,
    edge_normals,
    lower_facets,
    subtract,
)

Array = NDArray[np.float64]

# A bed this close below a part still touches it [m]: the error of a 1.5 mm grid on a curved part.
TOUCH = 3e-4
# Rays that find the contact's border; more only follow the dome's curvature better.
RAYS = 24
# Facets cut down to less than this at a border (of the contact, of a lower body) are left out [m2].
SLIVER = 1e-6
# A body that reaches further than this over the outline's edge counts as overhead [m].
OVERHANG = 5e-4
# A narrower crack between a body and a lower one beside it is the lean of their wall: 15 mm of it
# are 0.5 mm aside at 2 degrees [m].
CRACK = 5e-4
# Lower walls than this are left out [m].
LEAST_WALL = 1e-3


def stands_flat(bed: LeaningBed, hulls: Sequence[Array]) -> bool:
    """Say whether the bed touches one body only, over all of its flat underside.

    Then there is nothing beside it to part from, and only the wall leans.
    """
    touching = [body for hull in hulls for body in touching_bodies(bed, [hull])]
    if len(touching) != 1 or len(touching[0]) > 1:
        return False
    touched = sum(area(facet.polygon) for facet in touching_facets(bed, touching))
    return touched > 0.99 * area(touching[0][0].polygon)


def lowest(underside: list[Facet]) -> float:
    """Return the height of a body's lowest point [m]."""
    return min(float(facet.height(facet.polygon).min()) for facet in underside)


def _silhouette(underside: list[Facet]) -> Array:
    return convex_hull(np.concatenate([facet.polygon for facet in underside]))


def _envelope(undersides: Sequence[list[Facet]], xy: Array) -> Array:
    """Return the lowest height of the bodies over (n, 2) points, infinite where there is none."""
    height = np.full(len(xy), np.inf)
    for underside in undersides:
        # Under a convex body the lower surface is the highest of its facets' planes.
        own = np.max([facet.height(xy) for facet in underside], axis=0)
        inside = contains(_silhouette(underside), xy)
        height = np.where(inside, np.minimum(height, own), height)
    return height


def touching_bodies(bed: LeaningBed, hulls: Sequence[Array]) -> list[list[Facet]]:
    """Return the undersides of the bodies that reach the bed, lowest first."""
    undersides = sorted(_joined([lower_facets(hull) for hull in hulls]), key=lowest)
    xy, surface = _surface(bed)
    return [body for body in undersides if np.any(_envelope([body], xy) < surface)]


def _joined(undersides: Sequence[list[Facet]]) -> list[list[Facet]]:
    """Join flat undersides in one plane to their convex hull, for example the pieces of a plate.

    A hole between the pieces is filled to the same level: the bed bulges into it a little anyway.
    """
    joined: list[list[Facet]] = []
    flat: dict[tuple[float, ...], list[Facet]] = {}
    for underside in undersides:
        if len(underside) == 1:
            facet = underside[0]
            flat.setdefault((*facet.slope.round(4), round(facet.offset, 6)), []).append(facet)
        else:
            joined.append(underside)
    for facets in flat.values():
        whole = convex_hull(np.concatenate([facet.polygon for facet in facets]))
        joined.append([replace(facets[0], polygon=whole)])
    return joined


def _surface(bed: LeaningBed) -> tuple[Array, Array]:
    xyz = bed.surface()
    return xyz[:, :2], xyz[:, 2] + TOUCH


def touching_facets(bed: LeaningBed, undersides: Sequence[list[Facet]]) -> list[Facet]:
    """Return what the bed touches of the facets; where bodies overlap, of the lower one."""
    xy, surface = _surface(bed)
    touched = _envelope(undersides, xy) < surface
    window = _contact_window(bed, undersides, xy[touched].mean(axis=0))
    facets: list[Facet] = []
    lower: list[Array] = []
    placed: list[Array] = []
    for underside in undersides:
        curved = len(underside) > 2
        for facet in underside:
            if curved:
                pieces = [facet.polygon] if _mostly_touches(facet, underside, xy, surface) else []
            else:
                piece = clip(facet.polygon, window)
                pieces = [piece] if len(piece) and area(piece) > SLIVER else []
            for footprint in lower:
                pieces = [rest for piece in pieces for rest in subtract(piece, footprint)]
            if not curved:
                pieces = [piece for piece in pieces if area(piece) > SLIVER]
                pieces = [closed_up(piece, placed, CRACK) for piece in pieces]
            facets += [replace(facet, polygon=piece) for piece in pieces if len(piece)]
        lower.append(_silhouette(underside))
        placed = [facet.polygon for facet in facets]
    return facets


def _mostly_touches(facet: Facet, underside: list[Facet], xy: Array, surface: Array) -> bool:
    """Say whether the bed touches most of a facet: a curved body's facets are kept whole."""
    over = contains(facet.polygon, xy)
    touching = _envelope([underside], xy[over]) < surface[over]
    return bool(over.any() and touching.mean() > 0.5)


def _contact_window(bed: LeaningBed, undersides: Sequence[list[Facet]], center: Array) -> Array:
    """Return a convex polygon around the contact.

    Where a ray reaches the part's outline before it leaves the bed, the window passes well outside
    the outline, so that clipping leaves the part's own edges untouched.
    """
    step, margin, clear = 0.25e-3, 0.5e-3, 4 * bed.bag.cell
    reach = np.arange(step, 2 * bed.bag.aperture_radius, step)
    window = []
    corners = np.concatenate([_silhouette(body) for body in undersides]) - center
    spread = (np.arange(RAYS) + 0.5) * 2 * np.pi / RAYS
    for angle in np.concatenate([spread, np.arctan2(corners[:, 1], corners[:, 0])]):
        ray = np.array([np.cos(angle), np.sin(angle)])
        xy = center + reach[:, None] * ray
        height = _envelope(undersides, xy)
        part_end = reach[np.isfinite(height)].max(initial=step)
        bed_end = reach[height < bed.height_at(xy) + TOUCH].max(initial=step)
        at_outline = bed_end > part_end - margin
        window.append(center + (part_end + clear if at_outline else bed_end) * ray)
    return convex_hull(np.array(window))


def roof(loop: Array, foot: Array, undersides: Sequence[list[Facet]]) -> Array:
    """Return how high the bed may stand at both ends of each edge of the outline (n, 2) [m].

    That is what hangs over the place beside the edge, if any. Where the contact ends under the
    part itself there is no wall, and the roof is the floor.
    """
    normal, _ = edge_normals(loop)
    beside = (loop + np.roll(loop, -1, axis=0)) / 2 + OVERHANG * normal
    overhead = _envelope(undersides, beside)[:, None]
    return np.where(overhead < foot + LEAST_WALL, foot, overhead)
