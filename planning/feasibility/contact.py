"""Contact matrix C: which parts touch in the assembled product, and within which tolerance.

Two parts touch when their surfaces are no further apart than the tolerance, or when one lies in the
other's material. CAD puts a gap into every fit, so the tolerance lies above the gaps that mean
"touches" (line-to-line faces: rounding, 1e-9 m) and below the clearances that do not (0.075 mm
radial between boss and bore, 0.2 mm between bolt and clearance hole).

Distances come from FCL's triangle BVH. Compared with coal's ``security_margin`` on motor, plate and
six bolts lifted apart by 0 ... 0.3 mm, every answer was the same, at 10-38 ms a product against
1-105 ms, for 28 MB installed instead of 316 MB. Building a BVH costs most, 4 us a face [M], so it
holds only faces whose boxes come near the other part's faces; and if a few of the widest of these
touch already, the rest are skipped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import fcl
import numpy as np

from planning.feasibility.face_pairs import box_pairs
from planning.feasibility.solids import Solid

WIDEST = 16  # Faces of one part that are compared with the other's before all are.
WIDE = 1e-4  # [m] [M] From here on, too many boxes meet for finding them to save time.
TOUCHING = 1e-9  # [m] [D] Faces drawn on each other coincide to the rounding of float64, 1e-16 m.


def surface_gap(a: Solid, b: Solid) -> float:
    """Return the distance between two surfaces [m]; 0 where they touch or cross."""
    return max(0.0, fcl.distance(a.proximity, b.proximity))


def near_gap(a: Solid, b: Solid, reach: float) -> float:
    """Return the distance between two surfaces if it is at most the reach [m], else infinity."""
    faces_a, faces_b = _near_faces(a, b, reach), _near_faces(b, a, reach)
    # First a few of the widest faces, with some faces of the other part near them.
    few = faces_a[:WIDEST]
    low_a, high_a, low_b, high_b = _boxes(a, b, few, faces_b, reach)
    meet = (low_a[:, None] <= high_b) & (high_a[:, None] >= low_b)
    near = np.flatnonzero(meet.all(axis=2).any(axis=0))
    if _gap(a, b, few, faces_b[near[: 2 * WIDEST]]) <= TOUCHING:
        return 0.0
    if reach <= WIDE:
        faces_a, faces_b = _meeting(a, b, faces_a, faces_b, reach)
    gap = _gap(a, b, faces_a, faces_b)
    return gap if gap <= reach else np.inf


def _near_faces(solid: Solid, other: Solid, reach: float) -> np.ndarray:
    """Return the faces whose boxes are within reach of the other part's, widest first."""
    low, high = solid.face_boxes
    near = (low <= other.upper + reach) & (high >= other.lower - reach)
    near = np.flatnonzero(near[:, 0] & near[:, 1] & near[:, 2])
    normals = solid.doubled_areas[near]
    return near[np.argsort(-np.einsum("ij,ij->i", normals, normals), kind="stable")]


def _boxes(
    a: Solid, b: Solid, faces_a: np.ndarray, faces_b: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the boxes of faces, those of the first part enlarged by the reach."""
    (low_a, high_a), (low_b, high_b) = a.face_boxes, b.face_boxes
    return low_a[faces_a] - reach, high_a[faces_a] + reach, low_b[faces_b], high_b[faces_b]


def _meeting(
    a: Solid, b: Solid, faces_a: np.ndarray, faces_b: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces whose boxes are within reach of a box of the other part's faces."""
    # Rectangles are compared along the axes in which the common box is longest.
    common = np.minimum(a.upper, b.upper) - np.maximum(a.lower, b.lower)
    thin, *wide = np.argsort(common)
    low_a, high_a, low_b, high_b = _boxes(a, b, faces_a, faces_b, reach)
    row, column = box_pairs(low_a[:, wide], high_a[:, wide], low_b[:, wide], high_b[:, wide])
    meet = low_a[row, thin] <= high_b[column, thin]
    meet &= high_a[row, thin] >= low_b[column, thin]
    return faces_a[np.unique(row[meet])], faces_b[np.unique(column[meet])]


def _gap(a: Solid, b: Solid, faces_a: np.ndarray, faces_b: np.ndarray) -> float:
    """Return the distance between faces of two parts [m]; infinity if either has none."""
    if not len(faces_a) or not len(faces_b):
        return np.inf
    return max(0.0, fcl.distance(a.proximity_of(faces_a), b.proximity_of(faces_b)))


def one_inside_other(a: Solid, b: Solid) -> bool:
    """Return whether a part lies in the other's material, given that their surfaces are apart."""
    a_in_b = np.all(a.lower >= b.lower) and np.all(a.upper <= b.upper)
    b_in_a = np.all(b.lower >= a.lower) and np.all(b.upper <= a.upper)
    # A ball in the cavity of a box has no common volume with it, a ball in its wall has.
    return bool(a_in_b or b_in_a) and (a.manifold ^ b.manifold).volume() > 0.0


def gap_matrix(
    solids: Sequence[Solid],
    reach: float,
    wanted: np.ndarray | None = None,
    tell: Callable[[int], None] = lambda done: None,
) -> np.ndarray:
    """Return the pairwise distances between parts, up to a reach.

    Args:
        solids: The n parts, in matrix order.
        reach: Gap beyond which the distance does not matter [m].
        wanted: (n, n) bool, symmetric: pairs to measure; None for all.
        tell: Is told how many pairs have been measured.

    Returns:
        (n, n) [m], symmetric: 0 where parts touch or one lies in the other's material, infinity
        where they are further apart than the reach or not wanted, and on the diagonal.
    """
    gaps = np.full((len(solids), len(solids)), np.inf)
    lower, upper = np.array([s.lower for s in solids]), np.array([s.upper for s in solids])
    near = (lower[:, None] - upper[None]).max(axis=2) <= reach
    near &= near.T if wanted is None else near.T & wanted
    pairs = np.argwhere(np.triu(near, 1))
    apart = len(solids) * (len(solids) - 1) // 2 - len(pairs)
    for done, (i, k) in enumerate(pairs):
        tell(apart + done)
        gap = near_gap(solids[i], solids[k], reach)
        inside = gap > 0.0 and one_inside_other(solids[i], solids[k])
        gaps[i, k] = gaps[k, i] = 0.0 if inside else gap
    return gaps


def contact_matrix(gaps: np.ndarray, tolerance: float | np.ndarray) -> np.ndarray:
    """Return C of the paper.

    Args:
        gaps: (n, n) as ``gap_matrix`` returns them [m].
        tolerance: Gap up to which two parts count as touching [m]; one for all, or (n, n).

    Returns:
        (n, n) int, strictly upper triangular: C[i, k] = 1 if i < k and part i touches part k. Kept
        triangular so that C + C^T holds no 2.
    """
    return np.triu(gaps <= tolerance, 1).astype(int)
