"""Tolerances of a product: which gap counts as contact, and which overlap does not block.

A user may give one length for both, and a product may declare it. Otherwise they are derived.

The overlap is 0.05 mm, above the sagitta and the rounding of typical meshes; less for small parts;
and less than the smallest clearance. A part that lies apart from all others has no say in it.

The gap that counts as contact is the same where it connects the product, so that a part with play
does not touch the wall of its hole. Where it leaves the product in pieces, as in prints, whose
parts have a clearance all round, it is raised to the smallest gap at which the pieces hang
together, if that is plausible as the clearance of a fit. The overlap stays as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from planning.feasibility.blocking import FRAGILE
from planning.feasibility.contact import gap_matrix
from planning.feasibility.solids import Solid

USUAL = 5e-5  # [m] [A] Seven times the sagitta of a fine mesh (7 um: r 6, n 64).
PER_SIZE = 1.0 / 200.0  # [A] Of the smallest part's length: 0.05 mm for a screw of 10 mm.
PER_CLEARANCE = 2.0 / 3.0  # [A] Leaves a third of the clearance as margin.
LINE_TO_LINE = 0.2  # [A] Of the tolerance: gaps up to this are rounding or sagitta, not clearance.

LARGEST_FIT = 5e-4
"""[m] [A] largest clearance between parts that are meant to hang together: prints have 0.2 to 0.3
mm, loose running fits (ISO 286: H11/c11) 0.3 mm up to a diameter of 50 mm."""

PER_FIT = 1.25  # [A] Of the clearance at which the product hangs together: a margin of a fifth.


@dataclass(frozen=True)
class Tolerances:
    """Lengths that decide contact and blocking.

    Attributes:
        contact: Largest gap that counts as contact [m].
        overlap: Largest overlap that does not block a motion [m].
        source: Where they are from, in words.
    """

    contact: float
    overlap: float
    source: str


def tolerances_of(
    solids: Sequence[Solid], given: float | None, source: str
) -> tuple[Tolerances, np.ndarray]:
    """Return the tolerances of a product, and the gaps between its parts.

    Args:
        solids: The n parts.
        given: One length for both [m]; None to derive them.
        source: Who gave it.

    Returns:
        The tolerances, and the gaps (n, n) as ``gap_matrix`` returns them [m], at least up to
        (1 + ``FRAGILE``) times the contact tolerance.
    """
    if given is not None:
        return Tolerances(given, given, source), gap_matrix(solids, (1.0 + FRAGILE) * given)
    gaps = gap_matrix(solids, (1.0 + FRAGILE) * USUAL)
    apart = _pieces(gaps, (1.0 + FRAGILE) * USUAL)
    if apart.max() > 0:
        gaps = np.minimum(gaps, gap_matrix(solids, LARGEST_FIT, apart[:, None] != apart))
    overlap, source = _overlap(solids, gaps)
    if not _pieces(gaps, overlap).any():
        return Tolerances(overlap, overlap, source), gaps
    # Edges of length 0 would be none: contacts are set to the smallest length there is.
    edges = np.where(np.isfinite(gaps), np.maximum(gaps, 1e-12), 0.0)
    tree = minimum_spanning_tree(csr_array(edges))
    largest = float(tree.max()) if tree.nnz else 0.0
    if largest <= overlap:
        return Tolerances(overlap, overlap, source), gaps
    i, k = (int(index) for index in np.argwhere(tree.toarray() == largest)[0])
    found = (
        f"{source}; contact up to {1e3 * PER_FIT * largest:.3g} mm, since the product hangs "
        f"together only at a clearance of {1e3 * largest:.3g} mm ({solids[i].name}, "
        f"{solids[k].name})"
    )
    contact = PER_FIT * largest
    return Tolerances(contact, overlap, found), gap_matrix(solids, (1.0 + FRAGILE) * contact)


def _pieces(gaps: np.ndarray, tolerance: float) -> np.ndarray:
    """Return, per part, the number (n,) of the connected piece that it belongs to."""
    return connected_components(csr_array(gaps <= tolerance), directed=False)[1]


def _overlap(solids: Sequence[Solid], gaps: np.ndarray) -> tuple[float, str]:
    """Return the tolerance on overlaps [m], from the sizes of parts and clearances, and why."""
    near = np.isfinite(gaps.min(axis=1))
    connected = [solid for solid, has in zip(solids, near, strict=True) if has] or solids
    smallest = min(connected, key=_length)
    largest = min(USUAL, PER_SIZE * _length(smallest))
    clearances = np.where(gaps > LINE_TO_LINE * largest, gaps, np.inf)
    least = float(clearances.min())
    if PER_CLEARANCE * least < largest:
        i, k = (int(index) for index in np.argwhere(clearances == least)[0])
        names = f"{solids[i].name}, {solids[k].name}"
        reason = f"two thirds of the smallest clearance, {1e3 * least:.3g} mm ({names})"
        return PER_CLEARANCE * least, f"derived: {reason}"
    if largest < USUAL:
        return largest, f"derived: 1/200 of the smallest part, {smallest.name}"
    return largest, "by default"


def _length(solid: Solid) -> float:
    return float(np.max(solid.upper - solid.lower))
