"""How far the facets of a curved surface lie off it: its sagitta, estimated from the mesh alone.

A cylinder of n facets lies inside its circle by r (1 - cos(pi / n)): 0.2 mm for a hole of radius 25
mm with 24 facets. A pin drawn line to line with it, but with other facets, then overlaps it by as
much. Such an overlap is tessellation and cannot be told from a fit.

Between two facets of width l at an angle phi the sagitta is l / 2 tan(phi / 4). A curve shows in
many such edges that are alike; a chamfer, or a step, in a few.
"""

from __future__ import annotations

import numpy as np
import trimesh

from planning.feasibility.solids import Solid

FLATTEST, COARSEST = 0.01, 0.56  # [rad] [A] Angles between facets: 630 to 11 facets a turn.
ALIKE = 0.5  # [A] Edges count with at least this share of the largest sagitta.
FEWEST = 6  # [A] Edges that make a curve: half a turn of 12 facets.


def sagitta(solid: Solid, low: np.ndarray, high: np.ndarray) -> float:
    """Return by how much a part's facets lie off its curved surfaces, within a box [m].

    Args:
        solid: The part.
        low: (3,) lower corner of the box in A [m].
        high: (3,) upper corner.

    Returns:
        The largest sagitta of the curves there; 0 if there are none.
    """
    lower, upper = solid.face_boxes
    near = np.all((lower <= high) & (upper >= low), axis=1)
    mesh = trimesh.Trimesh(solid.vertices, solid.faces[near], process=False)
    pairs, angle = mesh.face_adjacency, mesh.face_adjacency_angles
    curved = (angle > FLATTEST) & (angle < COARSEST)
    if np.count_nonzero(curved) < FEWEST:
        return 0.0
    pairs, angle = pairs[curved], angle[curved]
    ends = solid.vertices[mesh.face_adjacency_edges[curved]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    # A triangle's height over the common edge is the width of its facet.
    width = (2.0 * mesh.area_faces[pairs] / length[:, None]).min(axis=1)
    found = np.sort(width / 2.0 * np.tan(angle / 4.0))[::-1]
    # The largest sagitta that enough edges have, at least nearly.
    shared = found[FEWEST - 1 :] >= ALIKE * found[: len(found) - FEWEST + 1]
    return float(found[int(np.argmax(shared))]) if shared.any() else 0.0
