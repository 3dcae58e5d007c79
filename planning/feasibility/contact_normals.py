"""Contact normals: where the faces of two parts lie on each other, and which way they look.

A part cannot move against the normal of another part's face that it lies on. That is a local
statement, about the first moment of a motion: cheap, and necessary for leaving altogether.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planning.feasibility.clipping import triangle_overlaps
from planning.feasibility.solids import Solid, boxes_apart

OPPOSED = 0.99  # Cosine of 8 degrees: facets of a coarse cylinder on a fine one.
SAME_DIRECTION = 0.9998  # Cosine of 1 degree.
ROWS = 400_000  # Pairs of boxes compared at once: bounds the memory to some MB.
WIDEST = 400  # [M] Faces of a part near another, widest first: 10 ms a pair at most.
LEAST_AREA = 0.01  # [A] Of the tolerance squared: less common area than that is rounding.


def contact_normals(
    incoming: Sequence[Solid], target: Sequence[Solid], tolerance: float
) -> np.ndarray:
    """Return outward normals (n, 3) of the target where the incoming parts lie on it, widest first.

    Normals within a degree of each other are merged.
    """
    found, areas = [np.zeros((0, 3))], [np.zeros(0)]
    for a in incoming:
        for b in target:
            if not boxes_apart(a, b, tolerance):
                normals, area = facing(a, b, tolerance)
                found.append(normals)
                areas.append(area)
    return distinct(np.concatenate(found), np.concatenate(areas))[0]


def facing(a: Solid, b: Solid, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return b's normals (n, 3) where a face of a lies on a face of b, and the common areas [m2].

    Args:
        a: One part.
        b: The other part.
        tolerance: Largest distance of faces that lie on each other [m].
    """
    faces = [_near_faces(solid, other, tolerance) for solid, other in ((a, b), (b, a))]
    (corners_a, normals_a), (corners_b, normals_b) = faces
    rows = max(1, ROWS // max(1, len(corners_b)))
    found, areas = [np.zeros((0, 3))], [np.zeros(0)]
    low_b, high_b = corners_b.min(axis=1), corners_b.max(axis=1)
    for first in range(0, len(corners_a), rows):
        part = corners_a[first : first + rows]
        meet = normals_a[first : first + rows] @ normals_b.T < -OPPOSED
        for k in range(3):
            meet &= part[:, :, k].min(axis=1)[:, None] <= high_b[None, :, k] + tolerance
            meet &= part[:, :, k].max(axis=1)[:, None] >= low_b[None, :, k] - tolerance
        row, column = np.nonzero(meet)
        offset = part[row].mean(axis=1) - corners_b[column].mean(axis=1)
        close = np.abs((offset * normals_b[column]).sum(axis=1)) <= tolerance
        row, column = row[close], column[close]
        common = _common_areas(part[row], corners_b[column], normals_b[column])
        lies = common > LEAST_AREA * tolerance**2
        found.append(normals_b[column[lies]])
        areas.append(common[lies])
    return np.concatenate(found), np.concatenate(areas)


def distinct(directions: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors without near repetitions, heaviest first, and their summed weights.

    Args:
        directions: (n, 3) unit vectors.
        weights: (n,) one each; that of a repetition is added to the vector it repeats.
    """
    kept, sums = np.zeros((0, 3)), []
    for number in np.argsort(-weights, kind="stable"):
        cosines = kept @ directions[number]
        if len(kept) and cosines.max() >= SAME_DIRECTION:
            sums[int(cosines.argmax())] += weights[number]
        else:
            kept = np.vstack([kept, directions[number]])
            sums.append(weights[number])
    return kept, np.array(sums, float)


def _near_faces(solid: Solid, other: Solid, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return corners (m, 3, 3) and normals (m, 3) of the widest faces near another part's box."""
    low, high = solid.face_boxes
    near = np.all(low <= other.upper + tolerance, axis=1)
    near &= np.all(high >= other.lower - tolerance, axis=1)
    chosen = np.flatnonzero(near)
    lengths = np.linalg.norm(solid.doubled_areas[chosen], axis=1)
    chosen, lengths = chosen[lengths > 0.0], lengths[lengths > 0.0]
    widest = np.argsort(-lengths, kind="stable")[:WIDEST]
    chosen, lengths = chosen[widest], lengths[widest]
    return solid.triangles[chosen], solid.doubled_areas[chosen] / lengths[:, None]


def _common_areas(a: np.ndarray, b: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the common area (n,) of opposed triangles (n, 3, 3), seen along b's normals [m2]."""
    sides = np.eye(3)[np.abs(normals).argmin(axis=1)]
    across = np.cross(sides, normals)
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-30)[:, None]
    plane = np.stack([across, np.cross(normals, across)], axis=1)
    origin = b[:, :1]
    flat_a = np.einsum("nij,nkj->nki", plane, a - origin)[:, ::-1]
    flat_b = np.einsum("nij,nkj->nki", plane, b - origin)
    return triangle_overlaps(flat_a, flat_b).areas()
