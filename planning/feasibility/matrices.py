"""From meshes to C and M_j: the parts' geometry, all that the planner's decisions rest on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cell.products.product import Product
from planning.feasibility.blocking import FRAGILE
from planning.feasibility.checks import without_overlaps
from planning.feasibility.contact import contact_matrix, gap_matrix
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.interference import Interference, interference
from planning.feasibility.solids import Solid, solids_of
from planning.feasibility.threads import Thread
from planning.feasibility.tolerance import PER_CLEARANCE, default_tolerance, largest_tolerance


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
    captive = _captive(gaps, leaving, tolerance)
    names = list(solids)
    suspects = [(names[i], names[k]) for i, k in np.argwhere(np.triu(captive, 1))]
    fitted, threads = without_overlaps(product, solids, tolerance, suspects)
    for nut, name in enumerate(names):
        if fitted[name] is not solids[name]:
            others = np.flatnonzero(captive[nut])
            leaving = _renewed(leaving, list(fitted.values()), nut, others, tolerance)
    margin = np.minimum(np.abs(gaps - tolerance), FRAGILE * tolerance)
    return Matrices(solids, tolerance, contact_matrix(gaps, tolerance), margin, leaving, threads)


def _captive(gaps: np.ndarray, leaving: Interference, tolerance: float) -> np.ndarray:
    """Return (n, n) bool: the pairs that may overlap by more than the tolerance.

    Their surfaces meet, and in no direction does one leave the other with margin to spare: a layer
    of overlap between one and two tolerances thick is too narrow to block across it, but only just.
    """
    sure = FRAGILE * tolerance * (1.0 - 1e-9)
    blocked = [(leaving.free[j] == 0) | (leaving.margin[j] < sure) for j in DIRECTIONS]
    return (gaps == 0.0) & np.all(blocked, axis=0)


def _renewed(
    leaving: Interference,
    fitted: Sequence[Solid],
    nut: int,
    others: np.ndarray,
    tolerance: float,
) -> Interference:
    """Return the matrices with a nut's entries computed anew, after its threads were cut.

    Only towards the other parts that it may overlap: the rest of it is as it was.
    """
    free = {j: matrix.copy() for j, matrix in leaving.free.items()}
    margin = {j: matrix.copy() for j, matrix in leaving.margin.items()}
    blockers = list(leaving.blockers)
    for other in others:
        pair = interference([fitted[other], fitted[nut]], tolerance)
        for j in DIRECTIONS:
            for values, new in ((free[j], pair.free[j]), (margin[j], pair.margin[j])):
                values[other, nut], values[nut, other] = new[0, 1], new[1, 0]
        names = {fitted[other].name, fitted[nut].name}
        blockers = [b for b in blockers if {b.moving, b.staying} != names]
        blockers += pair.blockers
    return Interference(free, tuple(blockers), margin)
