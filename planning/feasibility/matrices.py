"""The paper's matrices of a product: C, M_j, W_j, and the lists A(P_t, P_i) read from them.

C says which parts touch (``contact``), M_j which part leaves which other along j
(``interference``). Their elementwise product W_j = (C + C^T) * M_j holds the reachable directions:
W_j[i, k] = 1 if part i touches part k and leaves it along j.

The paper leaves open whether P_t or P_i moves. Here A_j(P_t, P_i) = 1 means that the incoming part
P_i leaves the target P_t along j (the column of W_j that belongs to P_t). The literal row reading,
P_t displaced along j, flips every sign and contradicts the paper's table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cell.products.product import Product
from planning.feasibility.blocking import FRAGILE
from planning.feasibility.cad_threads import CadThread
from planning.feasibility.coarse import COARSE
from planning.feasibility.contact import contact_matrix, gap_matrix
from planning.feasibility.directions import DIRECTIONS, opposite
from planning.feasibility.fitting import fitted_solids, refitted
from planning.feasibility.helical_threads import helical_threads
from planning.feasibility.interference import Blocker, Interference, interference
from planning.feasibility.overlaps import Overlap, Overlaps, find_overlaps
from planning.feasibility.solids import Solid, solids_of
from planning.feasibility.tolerance import (
    LARGEST_FIT,
    PER_FIT,
    Tolerances,
    connecting,
    tolerances_of,
)
from planning.feasibility.undercut import Undercut, snap_direction, stretch_directions

MEETING = 2.0 * COARSE  # [D] Of the tolerance: both surfaces may have been simplified.

Progress = Callable[[int, int], None]
"""Is told how many comparisons of two parts have been made, of how many."""


@dataclass(frozen=True, eq=False)
class AssemblyMatrices:
    """C and M_j of a product, with the geometry and the evidence that they rest on.

    Attributes:
        solids: The n parts in the product frame, by name in matrix order.
        tolerances: What counts as contact, and what does not block.
        contact: (n, n) int, strictly upper triangular C.
        contact_margin: (n, n) float: change of the tolerance at which an entry of C flips [m],
            capped at ``FRAGILE`` times the tolerance.
        interference: The M_j with their margins and blockers.
        overlaps: Threads, declared overlaps, and errors of the CAD.
        undercuts: What declared snap fits and flexible parts bend over.
    """

    solids: Mapping[str, Solid]
    tolerances: Tolerances
    contact: np.ndarray
    contact_margin: np.ndarray
    interference: Interference
    overlaps: Overlaps
    undercuts: tuple[Undercut, ...] = ()

    @property
    def tolerance(self) -> float:
        """Largest overlap that does not block a motion [m]; less for small parts."""
        return self.tolerances.overlap

    @property
    def threads(self) -> tuple[CadThread, ...]:
        """Screw threads that were recognised in the meshes."""
        return self.overlaps.threads

    @property
    def errors(self) -> tuple[Overlap, ...]:
        """Overlaps that nothing explains."""
        return tuple(one for one in self.overlaps.others if not one.kind)

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
        tolerance: Largest gap that counts as contact and largest overlap that does not block [m];
            None for the product's own, or those derived from its sizes and clearances if it
            declares none.
        solids: The product's parts, if they have been built already.
        progress: Each pair counts four times: its distance, and its motions along three axes.
    """
    solids = solids_of(product) if solids is None else solids
    declared = product.contact_tolerance if tolerance is None else tolerance
    source = "declared by the product" if tolerance is None else "as given"
    parts, names = list(solids.values()), list(solids)
    every = len(parts) * (len(parts) - 1) // 2
    tolerances, gaps = tolerances_of(
        parts, declared, source, lambda done: progress(done, 4 * every)
    )
    overlap = tolerances.overlaps(names)
    leaving = interference(parts, overlap, lambda done: progress(every + done, 4 * every))
    # Pairs that may overlap by more than the tolerance: their surfaces meet, and neither leaves the
    # other with a margin to spare. A layer of overlap between one and two tolerances thick is too
    # narrow to block across it, but only just.
    sure = FRAGILE * overlap * (1.0 - 1e-9)
    held = [(leaving.free[j] == 0) | (leaving.margin[j] < sure) for j in DIRECTIONS]
    # Surfaces that have been simplified may lie a little apart where those of the parts meet.
    suspect = (gaps <= MEETING * overlap) & np.all(held, axis=0)
    suspects = [(names[i], names[k]) for i, k in np.argwhere(np.triu(suspect, 1))]
    overlaps = find_overlaps(product, solids, tolerances, suspects)
    locked = np.all([leaving.free[j] + leaving.free[j].T == 0 for j in DIRECTIONS], axis=0)
    apart = [(parts[i], parts[k]) for i, k in np.argwhere(np.triu(locked & ~suspect, 1))]
    turning = helical_threads(apart, tolerances.overlap)
    overlaps = replace(overlaps, threads=(*turning, *overlaps.threads))
    for thread in overlaps.threads:
        bolt, nut = names.index(thread.bolt), names.index(thread.nut)
        gaps[bolt, nut] = gaps[nut, bolt] = 0.0  # Flanks bear, whatever clearance is drawn.
    if declared is None:
        tolerances, gaps = connecting(tolerances, parts, gaps)
    fitted, pairs = fitted_solids(solids, overlaps, tolerances)
    leaving = refitted(leaving, fitted, pairs, overlaps.threads, tolerances)
    undercuts = tuple(_undercuts(product, fitted, leaving, tolerances.overlap))
    for one in undercuts:
        i, k = names.index(one.part), names.index(one.other)
        others = [k] if one.kind == "snap" else [n for n in range(len(names)) if n != i]
        leaving = _freed(leaving, names, one.direction, i, others, tolerances.overlap)
    touch = tolerances.contacts(names)
    contact = contact_matrix(gaps, touch)
    margin = np.minimum(np.abs(gaps - touch), FRAGILE * touch)
    return AssemblyMatrices(solids, tolerances, contact, margin, leaving, overlaps, undercuts)


def looser_contact(matrices: AssemblyMatrices) -> AssemblyMatrices | None:
    """Return matrices with the next larger gap counted as contact; None if none is plausible."""
    parts, names = list(matrices.solids.values()), list(matrices.solids)
    tolerances = matrices.tolerances
    touching = matrices.contact + matrices.contact.T > 0
    gaps = np.where(touching, 0.0, gap_matrix(parts, LARGEST_FIT))
    larger = gaps[(gaps > tolerances.contacts(names)) & np.isfinite(gaps)]
    if not len(larger):
        return None
    gap = float(larger.min())
    i, k = (int(index) for index in np.argwhere(gaps == gap)[0])
    source = (
        f"{tolerances.source.split(';')[0]}; there is an order only if parts with a clearance of "
        f"{1e3 * gap:.3g} mm count as touching ({names[i]}, {names[k]})"
    )
    looser = replace(tolerances, contact=max(PER_FIT * gap, tolerances.contact), source=source)
    touch = looser.contacts(names)
    margin = np.minimum(np.abs(gaps - touch), FRAGILE * touch)
    return replace(
        matrices,
        tolerances=looser,
        contact=contact_matrix(gaps, touch),
        contact_margin=margin,
    )


def _undercuts(
    product: Product, solids: Mapping[str, Solid], leaving: Interference, tolerance: float
) -> Iterator[Undercut]:
    """Yield what declared snap fits and flexible parts bend over, where anything is in the way."""
    names = list(solids)
    for part, other in (sorted(pair, key=names.index) for pair in product.declared.snap):
        i, k = names.index(part), names.index(other)
        if not any(leaving.free[j][i, k] for j in DIRECTIONS):
            found = snap_direction(solids[part], solids[other], tolerance)
            if found is not None:
                yield found
    for part in (name for name in names if name in product.declared.flexible):
        i = names.index(part)
        others = [k for k in range(len(names)) if k != i]
        free = {j: leaving.free[j][i, others] == 1 for j in DIRECTIONS}
        if not any(row.all() for row in free.values()):
            rest = [solids[names[k]] for k in others]
            yield from stretch_directions(solids[part], rest, free, tolerance)


def _freed(
    leaving: Interference,
    names: Sequence[str],
    direction: str,
    part: int,
    others: Sequence[int],
    tolerance: float,
) -> Interference:
    """Let a part leave others along a direction."""
    free = {j: matrix.copy() for j, matrix in leaving.free.items()}
    margin = {j: matrix.copy() for j, matrix in leaving.margin.items()}
    for other in others:
        for j, i, k in ((direction, part, other), (opposite(direction), other, part)):
            free[j][i, k], margin[j][i, k] = 1, FRAGILE * tolerance

    def freed(blocker: Blocker) -> bool:
        i, k = names.index(blocker.moving), names.index(blocker.staying)
        return bool(free[blocker.direction][i, k])

    kept = tuple(blocker for blocker in leaving.blockers if not freed(blocker))
    return Interference(free, kept, margin)


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
