"""The frozen bed as a tetrahedral mesh that conforms to the part held in it.

The floor takes over the facets of the part's `bed_*` hulls one to one, the wall follows their
outline, and rings of columns carry the bed's own height out to the rim. A mesh that does not share
the part's facets pushes it out or lets it tip, whatever the physics.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cell.soft_jig.bed import Bed
from cell.soft_jig.columns import TetMesh
from cell.soft_jig.leaning_bed import LeaningBed
from cell.soft_jig.parameters import JammedParameters
from cell.soft_jig.plane_cells import conforming_cells, largest_patch, outline
from cell.soft_jig.polygons import Facet, offset_loop
from cell.soft_jig.rings import Floor, floor_column, with_rings
from cell.soft_jig.touching import (
    lowest,
    roof,
    stands_flat,
    touching_bodies,
    touching_facets,
)

Array = NDArray[np.float64]

# Corners of the bare bed's middle; more only follow the dome's curvature better.
CORNERS = 24
# A part that leans further has no upright axis: its bed is meshed as it stands [m/m].
MOST_LEAN = 0.2


def bed_mesh(bed: Bed, params: JammedParameters) -> TetMesh:
    """Return a mesh of the bed's own surface, with no part in it."""
    angle = np.arange(CORNERS) * 2 * np.pi / CORNERS
    circle = 1.5 * params.ring * np.column_stack([np.cos(angle), np.sin(angle)])
    loop = list(range(CORNERS))
    tops = bed.height_at(circle)
    column = floor_column(loop, circle, tops, float(bed.height_at(np.zeros((1, 2)))[0]), params)
    floor = Floor(circle, [column], loop)
    open_sky = np.full((CORNERS, 2), np.inf)
    return with_rings(LeaningBed(bed), params, floor, open_sky, np.zeros(2))


def imprint_mesh(
    bed: Bed, params: JammedParameters, hulls: Sequence[Array], lean: Array | None = None
) -> TetMesh:
    """Return a mesh of the bed with the imprint of a part.

    A part that leans is meshed in coordinates in which it stands upright (`LeaningBed`), unless it
    stands on one flat body. Where the contact is in separate patches, only the largest is a floor;
    the bed's own surface passes over the others, and under a part so lightly pressed that it covers
    no facet by half.

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
    undersides = touching_bodies(view, hulls)
    if not undersides:
        return bed_mesh(bed, params)
    if stands_flat(view, hulls) or np.linalg.norm(lean) > MOST_LEAN:
        return _imprint(view, params, undersides, lean)
    view = LeaningBed(bed, lean, min(map(lowest, undersides)))
    undersides = touching_bodies(view, [view.upright(hull) for hull in hulls])
    if not undersides:
        return bed_mesh(bed, params)
    mesh = _imprint(view, params, undersides, np.zeros(2))
    return TetMesh(view.leaning(mesh.vertices), mesh.tetrahedra)


def _imprint(
    bed: LeaningBed, params: JammedParameters, undersides: Sequence[list[Facet]], lean: Array
) -> TetMesh:
    facets = touching_facets(bed, undersides)
    if not facets:
        return bed_mesh(bed.bed, params)
    plane, cells = conforming_cells([facet.polygon for facet in facets], params.edge)
    patch = largest_patch(plane, cells)
    if len(patch) < len(cells):
        facets = [facets[k] for k in patch]
        plane, cells = conforming_cells([facet.polygon for facet in facets], params.edge)
    loop = outline(cells)
    plane[loop] = offset_loop(plane[loop], params.squeeze)
    tops = [facet.height(plane[cell]) for facet, cell in zip(facets, cells, strict=True)]
    columns = [
        floor_column(cell, plane, top, float(top.mean()), params)
        for cell, top in zip(cells, tops, strict=True)
    ]
    floor = Floor(plane, columns, loop)
    return with_rings(bed, params, floor, roof(floor.inner, floor.feet, undersides), lean)
