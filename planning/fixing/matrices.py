"""From meshes to C and M_j: the parts' geometry, all that the planner's decisions rest on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from cell.product import Product
from planning.fixing.blocking import FRAGILE
from planning.fixing.checks import without_overlaps
from planning.fixing.contact import contact_matrix, gap_matrix
from planning.fixing.directions import DIRECTIONS
from planning.fixing.interference import Interference, interference
from planning.fixing.solids import Solid, solids_of
from planning.fixing.threads import Thread
from planning.fixing.tolerance import PER_CLEARANCE, default_tolerance, largest_tolerance


@dataclass(frozen=True, eq=False)
class Matrices:
    """C and M_j of a product with their evidence.

    Attributes:
        solids: The n parts in the product frame, by name in matrix order.
        tolerance: Gap that still touches, and overlap that does not block [m].
        contact: (n, n) int, strictly upper triangular C.
        contact_margin: (n, n) float: by how much the tolerance can change before an entry of C
            flips [m]; what is ``FRAGILE`` of the tolerance or more is given as that.
        leaving: The M_j with their margins and blockers.
        threads: Screw threads that were recognised.
    """

    solids: Mapping[str, Solid]
    tolerance: float
    contact: np.ndarray
    contact_margin: np.ndarray
    leaving: Interference
    threads: tuple[Thread, ...]


def matrices_of(
    product: Product, tolerance: float | None = None, solids: Mapping[str, Solid] | None = None
) -> Matrices:
    """Return the matrices of a product.

    Args:
        product: Parts in assembled poses.
        tolerance: See ``Matrices`` [m]; None for the product's own, or one derived from its sizes
            and clearances if it declares none.
        solids: The product's parts, where they are at hand.

    Raises:
        CellError: Parts overlap, and not as a bolt does in its thread.
    """
    solids = solids_of(product) if solids is None else solids
    declared = product.contact_tolerance if tolerance is None else tolerance
    parts = list(solids.values())
    reach = max(1.0 + FRAGILE, 1.0 / PER_CLEARANCE) * (declared or largest_tolerance(parts))
    gaps = gap_matrix(parts, reach)
    tolerance = declared or default_tolerance(parts, gaps)
    leaving = interference(parts, tolerance)
    fitted, threads = without_overlaps(product, solids, tolerance, _captive(solids, leaving))
    cut = [name for name in solids if fitted[name] is not solids[name]]
    for nut in cut:
        leaving = _renewed(leaving, fitted, solids, nut, tolerance)
    margin = np.minimum(np.abs(gaps - tolerance), FRAGILE * tolerance)
    return Matrices(solids, tolerance, contact_matrix(gaps, tolerance), margin, leaving, threads)


def _captive(solids: Mapping[str, Solid], leaving: Interference) -> list[tuple[str, str]]:
    """Return the pairs that block each other in all directions: all that may overlap are there."""
    blocked = np.all([leaving.free[j] == 0 for j in DIRECTIONS], axis=0)
    names = list(solids)
    return [(names[i], names[k]) for i, k in combinations(range(len(names)), 2) if blocked[i, k]]


def _renewed(
    leaving: Interference,
    fitted: Mapping[str, Solid],
    solids: Mapping[str, Solid],
    nut: str,
    tolerance: float,
) -> Interference:
    """Return the matrices with a nut's rows and columns computed anew, after its threads were cut.

    Only towards parts that it overlapped: the rest of it is as it was.
    """
    names = list(solids)
    others = [n for n in names if n != nut and _blocked_all_ways(leaving, names, n, nut)]
    free = {j: matrix.copy() for j, matrix in leaving.free.items()}
    margin = {j: matrix.copy() for j, matrix in leaving.margin.items()}
    blockers = list(leaving.blockers)
    for other in others:
        pair = interference([fitted[other], fitted[nut]], tolerance)
        i, k = names.index(other), names.index(nut)
        for j in DIRECTIONS:
            for values, new in ((free[j], pair.free[j]), (margin[j], pair.margin[j])):
                values[i, k], values[k, i] = new[0, 1], new[1, 0]
        blockers = [b for b in blockers if {b.moving, b.staying} != {other, nut}]
        blockers += pair.blockers
    return Interference(free, tuple(blockers), margin)


def _blocked_all_ways(leaving: Interference, names: list[str], a: str, b: str) -> bool:
    i, k = names.index(a), names.index(b)
    return all(leaving.free[j][i, k] == 0 for j in DIRECTIONS)
