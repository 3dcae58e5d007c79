"""The frozen bed as a tetrahedral mesh that conforms to the part held in it.

The floor takes over the facets of the part's `bed_*` hulls one to one, the wall follows their
outline, and rings of columns carry the bed's own height out to the rim. A mesh that does not share
the part's facets pushes it out or lets it tip, whatever the physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cell.soft_jig.bed import Bed
from cell.soft_jig.columns import Column, ColumnMesh, TetMesh
from cell.soft_jig.leaning_bed import LeaningBed
from cell.soft_jig.parameters import JammedParameters
from cell.soft_jig.plane_cells import cell_edges, conforming_cells, largest_patch, outline
from cell.soft_jig.polygons import (
    Facet,
    area,
    clip,
    closed_up,
    contains,
    convex_hull,
    edge_normals,
    lower_facets,
    offset_loop,
    subtract,
)

Array = NDArray[np.float64]

# A bed this close below a part still touches it [m]: the error of a 1.5 mm grid on a curved part.
TOUCH = 3e-4
# Rays that find the contact's border; more only follow the dome's curvature better.
RAYS = 24
# Least height of a column around the part [m].
RIM_HEIGHT = 0.002
# Facets cut down to less than this at a border (of the contact, of a lower body) are left out [m2].
SLIVER = 1e-6
# A body that reaches further than this over the outline's edge counts as overhead [m].
OVERHANG = 5e-4
# A narrower crack between a body and a lower one beside it is the lean of their wall: 15 mm of it
# are 0.5 mm aside at 2 degrees [m].
CRACK = 5e-4
# Least angle between the directions in which neighbours of the outline look outwards [rad].
LEAST_TURN = 0.02
# A part that leans further has no upright axis: its bed is meshed as it stands [m/m].
MOST_LEAN = 0.2
# Lower walls than this are left out [m].
LEAST_WALL = 1e-3
# Gap between the part and the foot of a wall [m]. With the part's edge inside the floor's columns
# a standing can makes 440 contact polygons; with its edge in the wall it makes 950, mostly slivers.
FOOT_GAP = 6e-5


def bed_mesh(bed: Bed, params: JammedParameters) -> TetMesh:
    """Return a mesh of the bed's own surface, with no part in it."""
    angle = np.arange(RAYS) * 2 * np.pi / RAYS
    circle = 1.5 * params.ring * np.column_stack([np.cos(angle), np.sin(angle)])
    loop = list(range(RAYS))
    tops = bed.height_at(circle)
    floor = [_floor_column(loop, circle, tops, float(bed.height_at(np.zeros((1, 2)))[0]), params)]
    roof = np.full((RAYS, 2), np.inf)
    return _with_rings(LeaningBed(bed), params, circle, floor, loop, roof, np.zeros(2))


def imprint_mesh(
    bed: Bed, params: JammedParameters, hulls: Sequence[Array], lean: Array | None = None
) -> TetMesh:
    """Return a mesh of the bed with the imprint of a part.

    A part that leans is meshed in coordinates in which it stands upright (`LeaningBed`), unless it
    stands on one flat body. Where the contact is in separate patches, only the largest is a floor;
    the bed's own surface passes over the others.

    Args:
        bed: The frozen bed.
        params: Squeeze, ring width and layer depth.
        hulls: Vertices (n, 3) in J of the part's convex hulls that touch the bed.
        lean: (2,) horizontal shift per height of the part's walls; zero for an upright part.

    Raises:
        BadMesh: The contact has a hole, or the mesh folds over.
    """
    lean = np.zeros(2) if lean is None else lean
    view = LeaningBed(bed)
    undersides = _touching_bodies(view, hulls)
    if not undersides:
        return bed_mesh(bed, params)
    if _stands_flat(view, hulls) or np.linalg.norm(lean) > MOST_LEAN:
        return _imprint(view, params, undersides, lean)
    view = LeaningBed(bed, lean, min(map(_lowest, undersides)))
    undersides = _touching_bodies(view, [view.upright(hull) for hull in hulls])
    mesh = _imprint(view, params, undersides, np.zeros(2))
    return TetMesh(view.leaning(mesh.vertices), mesh.tetrahedra)


def _stands_flat(bed: LeaningBed, hulls: Sequence[Array]) -> bool:
    """Say whether the bed touches one body only, over all of its flat underside.

    Then there is nothing beside it to part from, and only the wall leans.
    """
    touching = [body for hull in hulls for body in _touching_bodies(bed, [hull])]
    if len(touching) != 1 or len(touching[0]) > 1:
        return False
    touched = sum(area(facet.polygon) for facet in _touching_facets(bed, touching))
    return touched > 0.99 * area(touching[0][0].polygon)


def _imprint(
    bed: LeaningBed, params: JammedParameters, undersides: Sequence[list[Facet]], lean: Array
) -> TetMesh:
    facets = _touching_facets(bed, undersides)
    plane, cells = conforming_cells([facet.polygon for facet in facets], params.edge)
    patch = largest_patch(plane, cells)
    if len(patch) < len(cells):
        facets = [facets[k] for k in patch]
        plane, cells = conforming_cells([facet.polygon for facet in facets], params.edge)
    loop = outline(cells)
    plane[loop] = offset_loop(plane[loop], params.squeeze)
    tops = [facet.height(plane[cell]) for facet, cell in zip(facets, cells, strict=True)]
    floor = [
        _floor_column(cell, plane, top, float(top.mean()), params)
        for cell, top in zip(cells, tops, strict=True)
    ]
    foot = _edge_feet(floor, loop)
    roof = _roof(plane[loop], foot, undersides)
    return _with_rings(bed, params, plane, floor, loop, roof, lean)


def _edge_feet(floor: Sequence[Column], loop: Sequence[int]) -> Array:
    """Return the floor's height at both ends of each edge of the outline (n, 2)."""
    height = {
        edge: (column.tops[k], column.tops[(k + 1) % len(column.tops)])
        for column in floor
        for k, edge in enumerate(cell_edges(column.corners))
    }
    return np.array([height[edge] for edge in cell_edges(list(loop))])


# Where the part touches.


def _lowest(underside: list[Facet]) -> float:
    return min(float(facet.height(facet.polygon).min()) for facet in underside)


def _silhouette(underside: list[Facet]) -> Array:
    return convex_hull(np.concatenate([facet.polygon for facet in underside]))


def _envelope(undersides: Sequence[list[Facet]], xy: Array) -> Array:
    """Return the lowest height of the bodies over (n, 2) points, infinite where there is none."""
    lowest = np.full(len(xy), np.inf)
    for underside in undersides:
        # Under a convex body the lower surface is the highest of its facets' planes.
        height = np.max([facet.height(xy) for facet in underside], axis=0)
        inside = contains(_silhouette(underside), xy)
        lowest = np.where(inside, np.minimum(lowest, height), lowest)
    return lowest


def _touching_bodies(bed: LeaningBed, hulls: Sequence[Array]) -> list[list[Facet]]:
    """Return the undersides of the bodies that reach the bed, lowest first."""
    undersides = sorted(_joined([lower_facets(hull) for hull in hulls]), key=_lowest)
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


def _touching_facets(bed: LeaningBed, undersides: Sequence[list[Facet]]) -> list[Facet]:
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


def _roof(loop: Array, foot: Array, undersides: Sequence[list[Facet]]) -> Array:
    """Return how high the bed may stand at both ends of each edge of the outline (n, 2) [m].

    That is what hangs over the place beside the edge, if any. Where the contact ends under the
    part itself there is no wall, and the roof is the floor.
    """
    normal, _ = edge_normals(loop)
    beside = (loop + np.roll(loop, -1, axis=0)) / 2 + OVERHANG * normal
    overhead = _envelope(undersides, beside)[:, None]
    return np.where(overhead < foot + LEAST_WALL, foot, overhead)


def _outward(loop: Array) -> Array:
    """Return unit vectors (n, 2) away from the middle of a loop, fanned out in the loop's order.

    They point out of both edges at a vertex, and where the outline has a step the directions are
    spread, so that the columns outside do not cross.
    """
    away = loop - (loop.min(axis=0) + loop.max(axis=0)) / 2
    away /= np.linalg.norm(away, axis=1)[:, None]
    normal, _ = edge_normals(loop)
    for side in (normal, np.roll(normal, 1, axis=0)) * 2:
        short = np.maximum(3 * LEAST_TURN - np.einsum("ij,ij->i", away, side), 0.0)
        away += short[:, None] * side
    angle = np.arctan2(away[:, 1], away[:, 0])
    step = (np.diff(angle, append=angle[0]) + np.pi) % (2 * np.pi) - np.pi
    start = (int(np.argmax(step)) + 1) % len(loop)
    turned = np.roll(angle, -start)[0] + np.concatenate(
        [[0.0], np.cumsum(np.roll(step, -start))[:-1]]
    )
    gap = LEAST_TURN * np.arange(len(loop))
    forward = np.maximum.accumulate(turned - gap) + gap
    backward = np.minimum.accumulate((turned - gap)[::-1])[::-1] + gap
    fanned = np.roll((forward + backward) / 2, start)
    return np.column_stack([np.cos(fanned), np.sin(fanned)])


# Columns.


def _floor_column(
    corners: list[int], plane: Array, tops: Array, center_top: float, params: JammedParameters
) -> Column:
    height = center_top - min(params.layer, center_top / 2)
    return Column(corners, tops, center_top, np.array([*plane[corners].mean(axis=0), height]))


def _with_rings(
    bed: LeaningBed,
    params: JammedParameters,
    plane: Array,
    floor: list[Column],
    loop: list[int],
    roof: Array,
    lean: Array,
) -> TetMesh:
    """Surround the floor with a ring of columns at the wall and one out to the aperture."""
    inner, away = plane[loop], _outward(plane[loop])
    # The cap is steep at its edge: end a little inside, with an upright face.
    to_edge = _distance_to_circle(
        inner - bed.axis, away, bed.bag.aperture_radius - 2 * bed.bag.cell
    )
    middle = inner + away * np.minimum(params.ring, to_edge / 2)[:, None]
    outer = inner + away * to_edge[:, None]
    n, count = len(plane), len(loop)
    rings = [loop, list(range(n, n + count)), list(range(n + count, n + 2 * count))]
    points = np.concatenate([plane, middle, outer])
    foot = _edge_feet(floor, loop)
    # The first cells around an imprint are half in it.
    beside = bed.height_at(inner + away * 1.5 * bed.bag.cell)
    beside = np.column_stack([beside, np.roll(beside, -1)])
    lowest_roof = np.minimum(roof[:, 0], np.roll(roof[:, 1], 1))
    rim = np.maximum(np.minimum(beside, roof), foot)
    lowered = np.minimum(rim, np.column_stack([lowest_roof, np.roll(lowest_roof, -1)]))
    # The bed beside an edge is above the floor or below it, never one at each end.
    crossing = np.any(lowered > foot, axis=1) & np.any(lowered < foot, axis=1)
    rim = np.where(crossing[:, None], rim, lowered)
    ring_tops = [
        np.maximum(np.minimum(bed.height_at(ring), lowest_roof), RIM_HEIGHT)
        for ring in (middle, outer)
    ]
    ring_tops = [np.column_stack([top, np.roll(top, -1)]) for top in ring_tops]
    lean = lean + np.zeros_like(points)
    shift, rate = _closing(_wall_heights(floor, loop, rim), params)
    outward = offset_loop(inner, 1.0) - inner
    points[loop] += shift[:, None] * outward
    lean = lean + np.zeros_like(points)
    lean[loop] += rate[:, None] * outward
    tops, feet = [rim, *ring_tops], [foot, None]
    columns = list(floor)
    for level, wall in enumerate(feet):
        for k in range(count):
            j = (k + 1) % count
            corners = [rings[level][k], rings[level + 1][k], rings[level + 1][j], rings[level][j]]
            (a, d), (b, c) = tops[level][k], tops[level + 1][k]
            top = np.array([a, b, c, d])
            columns.append(
                _ring_column(corners, points, top, wall if wall is None else wall[k], params)
            )
    return ColumnMesh(points, columns, lean).build()


def _wall_heights(floor: Sequence[Column], loop: list[int], rim: Array) -> Array:
    """Return the height (n,) of the wall around one flat floor; 0 where it has a step."""
    if len(floor) > 1:
        return np.zeros(len(loop))
    (column,) = floor
    low = column.tops[[column.corners.index(corner) for corner in loop]]
    sides = np.column_stack([rim[:, 0], np.roll(rim[:, 1], 1)]) - low[:, None]
    even = sides.min(axis=1) > sides.max(axis=1) / 2
    return np.where(even, sides.max(axis=1), 0.0)


def _closing(wall: Array, params: JammedParameters) -> tuple[Array, Array]:
    """Return how far to shift the wall's foot outwards and its slope (n,); the mean stays.

    A wall that is low or uneven, or not around one flat floor, keeps its offset as a whole.
    """
    if wall.min() < max(LEAST_WALL, wall.max() / 2):
        return np.zeros(len(wall)), np.zeros(len(wall))
    shift = FOOT_GAP - params.squeeze
    return np.full(len(wall), shift), -2 * shift / wall


def _ring_column(
    corners: list[int], plane: Array, tops: Array, foot: Array | None, params: JammedParameters
) -> Column:
    """Return a column whose apex lies behind the middle of its wall, one layer below its top."""
    xy = plane[corners].mean(axis=0)
    # Both triangles of the top face must be seen from below.
    top = min(_plane_height(plane, corners, tops, three, xy) for three in ([0, 1, 2], [0, 2, 3]))
    height = top - min(params.layer, top / 2)
    if foot is not None:
        height = min(height, (float(foot.mean()) + top) / 2)
    return Column(corners, tops, top, np.array([*xy, height]))


def _plane_height(
    plane: Array, corners: list[int], tops: Array, three: list[int], xy: Array
) -> float:
    points = np.column_stack([plane[corners][three], np.ones(3)])
    return float(np.array([*xy, 1.0]) @ np.linalg.solve(points, tops[three]))


def _distance_to_circle(xy: Array, direction: Array, radius: float) -> Array:
    along = np.einsum("ij,ij->i", xy, direction)
    return -along + np.sqrt(along**2 + radius**2 - np.einsum("ij,ij->i", xy, xy))
