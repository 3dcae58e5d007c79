"""The paper's matrices of a product: C, M_j, W_j, and the lists A(P_t, P_i) read from them.

C says which parts touch (``contact``), M_j which part leaves which other along j
(``interference``). Their elementwise product W_j = (C + C^T) * M_j holds the reachable directions:
W_j[i, k] = 1 if part i touches part k and leaves it along j.

The paper leaves open whether P_t or P_i moves. Here A_j(P_t, P_i) = 1 means that the incoming part
P_i leaves the target P_t along j (the column of W_j that belongs to P_t). The literal row reading,
P_t displaced along j, flips every sign and contradicts the paper's table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cell.products.product import Product
from planning.feasibility.blocking import FRAGILE
from planning.feasibility.cad_threads import CadThread
from planning.feasibility.contact import (
    PER_CLEARANCE,
    contact_matrix,
    default_tolerance,
    gap_matrix,
    largest_tolerance,
)
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.interference import Interference, interference
from planning.feasibility.overlaps import without_overlaps
from planning.feasibility.solids import Solid, solids_of

Progress = Callable[[int, int], None]
"""Is told how many comparisons of two parts have been made, of how many."""


@dataclass(frozen=True, eq=False)
class AssemblyMatrices:
    """C and M_j of a product, with the geometry and the evidence that they rest on.

    Attributes:
        solids: The n parts in the product frame, by name in matrix order.
        tolerance: Largest gap that counts as contact and largest overlap that does not block [m].
        contact: (n, n) int, strictly upper triangular C.
        contact_margin: (n, n) float: change of the tolerance at which an entry of C flips [m],
            capped at ``FRAGILE`` times the tolerance.
        interference: The M_j with their margins and blockers.
        threads: Screw threads that were recognised in the meshes.
    """

    solids: Mapping[str, Solid]
    tolerance: float
    contact: np.ndarray
    contact_margin: np.ndarray
    interference: Interference
    threads: tuple[CadThread, ...]

    def indices(self, names: Sequence[str]) -> list[int]:
        """Return the matrix indices of parts."""
        order = list(self.solids)
        return [order.index(name) for name in names]


def matrices_of(
    product: Product,
    tolerance: float | None = None,
    solids: Mapping[str, Solid] | None = None,
    progress: Progress = lambda done, total: None,
) -> AssemblyMatrices:
    """Compute the matrices of a product.

    Args:
        product: Parts in assembled poses.
        tolerance: See ``AssemblyMatrices`` [m]; None for the product's own, or one derived from its
            sizes and clearances if it declares none.
        solids: The product's parts, if they have been built already.
        progress: Each pair counts four times: its distance, and its motions along three axes.

    Raises:
        InputError: Parts overlap, and not as a bolt does in its thread.
    """
    solids = solids_of(product) if solids is None else solids
    declared = product.contact_tolerance if tolerance is None else tolerance
    parts = list(solids.values())
    reach = max(1.0 + FRAGILE, 1.0 / PER_CLEARANCE) * (declared or largest_tolerance(parts))
    every = len(parts) * (len(parts) - 1) // 2
    gaps = gap_matrix(parts, reach, lambda done: progress(done, 4 * every))
    tolerance = declared or default_tolerance(parts, gaps)
    leaving = interference(parts, tolerance, lambda done: progress(every + done, 4 * every))
    # Pairs that may overlap by more than the tolerance: their surfaces meet, and neither leaves the
    # other with a margin to spare. A layer of overlap between one and two tolerances thick is too
    # narrow to block across it, but only just.
    sure = FRAGILE * tolerance * (1.0 - 1e-9)
    held = [(leaving.free[j] == 0) | (leaving.margin[j] < sure) for j in DIRECTIONS]
    suspect = (gaps == 0.0) & np.all(held, axis=0)
    names = list(solids)
    pairs = [(names[i], names[k]) for i, k in np.argwhere(np.triu(suspect, 1))]
    fitted, threads = without_overlaps(product, solids, tolerance, pairs)
    for nut, name in enumerate(names):
        if fitted[name] is not solids[name]:
            others = np.flatnonzero(suspect[nut])
            leaving = _updated(leaving, list(fitted.values()), nut, others, tolerance)
    margin = np.minimum(np.abs(gaps - tolerance), FRAGILE * tolerance)
    contact = contact_matrix(gaps, tolerance)
    return AssemblyMatrices(solids, tolerance, contact, margin, leaving, threads)


def _updated(
    leaving: Interference, fitted: Sequence[Solid], nut: int, others: np.ndarray, tolerance: float
) -> Interference:
    """Recompute the entries of a nut whose threads have been cut, with the parts it may overlap."""
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


def reachable_matrices(
    contact: np.ndarray, free: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Return W_j per direction, (n, n) int each.

    Args:
        contact: (n, n) strictly upper triangular C.
        free: Per direction the (n, n) matrix M_j.
    """
    return {j: (contact + contact.T) * free[j] for j in DIRECTIONS}


def touching(contact: np.ndarray, target: Sequence[int], incoming: Sequence[int]) -> bool:
    """Return whether any of the target parts touches any of the incoming ones."""
    return bool((contact + contact.T)[np.ix_(incoming, target)].any())


def reachable_directions(
    contact: np.ndarray,
    free: Mapping[str, np.ndarray],
    target: Sequence[int],
    incoming: Sequence[int],
) -> dict[str, int]:
    """Return A(P_t, P_i) of two combined parts, given by the matrix indices of their members.

    A combined part moves as one: it is free where all its members are (AND over M), and in contact
    where any of them is (OR over C).
    """
    touches = touching(contact, target, incoming)
    pairs = np.ix_(incoming, target)
    return {j: int(touches and bool(free[j][pairs].all())) for j in DIRECTIONS}
