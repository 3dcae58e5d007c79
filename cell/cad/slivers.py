"""Convex pieces without faces that are too small for contact: Drake takes no normal from those."""

from __future__ import annotations

import numpy as np
import trimesh

# [D] Drake refuses a face whose two edges span less than 1e-10 m2, twice its area [mm2].
LEAST_FACE = 2e-4
GRIDS = (0.01, 0.02, 0.05, 0.1)  # [A] Corners that are this near become one, tried in order [mm].


def without_slivers(piece: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a convex piece [mm], its corners moved to a grid if faces are too small otherwise.

    A gear cut into convex pieces has corners a micrometre apart.
    """
    hull = piece.convex_hull
    if hull.area_faces.min() >= LEAST_FACE:
        return piece
    for grid in GRIDS:
        corners = np.unique(np.round(hull.vertices / grid), axis=0) * grid
        hull = trimesh.convex.convex_hull(corners)
        if hull.area_faces.min() >= LEAST_FACE:
            break
    return hull
