"""Contact matrix C: which parts touch in the assembled product.

Two parts touch when their surfaces are no further apart than the product's contact tolerance, or
when one lies in the other's material. The tolerance (0.05 mm unless the product says otherwise)
is declared because CAD puts a gap into every fit: choose it above the gaps that mean "touches"
(line-to-line faces: rounding, 1e-9 m) and below the clearances that do not (0.075 mm radial between
boss and bore, 0.2 mm between bolt and clearance hole).

Distances come from FCL's triangle BVH. Compared with coal's ``security_margin`` on motor, plate and
six bolts lifted apart by 0 ... 0.3 mm, every answer was the same, at 10-38 ms a product against
1-105 ms, for 28 MB installed instead of 316 MB.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import fcl
import numpy as np

from planning.fixing.solids import Solid, boxes_apart


def surface_gap(a: Solid, b: Solid) -> float:
    """Return the distance between two surfaces [m]; 0 where they touch or cross."""
    return max(0.0, fcl.distance(a.proximity, b.proximity))


def one_inside_other(a: Solid, b: Solid) -> bool:
    """Say whether a part lies in the other's material; only asked when the surfaces are apart."""
    a_in_b = np.all(a.lower >= b.lower) and np.all(a.upper <= b.upper)
    b_in_a = np.all(b.lower >= a.lower) and np.all(b.upper <= a.upper)
    # A ball in the cavity of a box has no common volume with it, a ball in its wall has.
    return bool(a_in_b or b_in_a) and (a.manifold ^ b.manifold).volume() > 0.0


def in_contact(a: Solid, b: Solid, tolerance: float) -> bool:
    """Say whether two parts touch: surfaces within the tolerance [m], or one inside the other."""
    if boxes_apart(a, b, tolerance):
        return False
    return surface_gap(a, b) <= tolerance or one_inside_other(a, b)


def contact_matrix(solids: Sequence[Solid], tolerance: float) -> np.ndarray:
    """Return C of the paper.

    Args:
        solids: The n parts, in matrix order.
        tolerance: Gap up to which two parts count as touching [m].

    Returns:
        (n, n) int, strictly upper triangular: C[i, k] = 1 if i < k and part i touches part k. Kept
        triangular so that C + C^T holds no 2.
    """
    matrix = np.zeros((len(solids), len(solids)), int)
    for i, k in combinations(range(len(solids)), 2):
        matrix[i, k] = in_contact(solids[i], solids[k], tolerance)
    return matrix
