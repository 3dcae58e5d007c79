"""Tolerances of a product: which gap counts as contact, and which overlap does not block.

A user may give one length for both, and a product may declare it. Otherwise they are derived.

The overlap is 0.05 mm, above the sagitta and the rounding of typical meshes; less between two parts
of which one is small or thin, and for these two alone.

The gap that counts as contact is below the smallest clearance, so that a part with play does not
touch the wall of its hole. Where that leaves the product in pieces, as in prints, whose parts have
a clearance all round, it is raised to the smallest gap at which the pieces hang together, if that
is plausible as the clearance of a fit. The overlap stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from planning.feasibility.blocking import FRAGILE
from planning.feasibility.coarse import coarsened
from planning.feasibility.contact import gap_matrix
from planning.feasibility.solids import Solid

USUAL = 5e-5  # [m] [A] Seven times the sagitta of a fine mesh (7 um: r 6, n 64).
PER_SIZE = 1.0 / 200.0  # [A] Of a part's length: 0.05 mm for a screw of 10 mm.
PER_THICKNESS = 0.4  # [A] Of a part's thickness: what is 2.5 tolerances thick blocks edge on.
PER_CLEARANCE = 2.0 / 3.0  # [A] Leaves a third of the clearance as margin.
LINE_TO_LINE = 0.2  # [A] Of the overlap: gaps up to this are rounding or sagitta, not clearance.

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
        small: Overlap of each part that is too small or thin for the usual one [m], by name; it
            holds for every pair with this part.
    """

    contact: float
    overlap: float
    source: str
    small: Mapping[str, float] = field(default_factory=dict)

    def overlap_of(self, part: str, other: str) -> float:
        """Return the largest overlap of two parts that does not block a motion [m]."""
        return min(self.small.get(part, self.overlap), self.small.get(other, self.overlap))

    def overlaps(self, names: Sequence[str]) -> np.ndarray:
        """Return the same for all pairs of n parts, (n, n) [m]."""
        own = np.array([self.small.get(name, self.overlap) for name in names])
        return np.minimum.outer(own, own)

    def contacts(self, names: Sequence[str]) -> np.ndarray:
        """Return the largest gap that counts as contact for all pairs of n parts, (n, n) [m]."""
        pairs = self.overlaps(names)
        if self.contact > self.overlap:  # Raised to what holds the product together.
            return np.full_like(pairs, self.contact)
        return np.minimum(self.contact, pairs)


def tolerances_of(
    solids: Sequence[Solid],
    given: float | None,
    source: str,
    tell: Callable[[int], None] = lambda done: None,
) -> tuple[Tolerances, np.ndarray]:
    """Return the tolerances of a product, and the gaps between its parts.

    Args:
        solids: The n parts.
        given: One length for both [m]; None to derive them.
        source: Who gave it.
        tell: Is told how many pairs have been measured.

    Returns:
        The tolerances, and the gaps (n, n) as ``gap_matrix`` returns them [m], at least up to
        (1 + ``FRAGILE``) times the contact tolerance.
    """
    if given is not None:
        coarse = [coarsened(solid, given) for solid in solids]
        gaps = gap_matrix(coarse, (1.0 + FRAGILE) * given, tell=tell)
        return Tolerances(given, given, source), gaps
    gaps = gap_matrix(solids, (1.0 + FRAGILE) * USUAL, tell=tell)
    return _derived(solids, gaps), gaps


def connecting(
    tolerances: Tolerances, solids: Sequence[Solid], gaps: np.ndarray
) -> tuple[Tolerances, np.ndarray]:
    """Return tolerances at which the product hangs together, and gaps as far as they count.

    The contact tolerance is raised to the longest edge of the tree that connects the parts, if it
    is plausible as the clearance of a fit.

    Args:
        tolerances: As derived.
        solids: The n parts.
        gaps: (n, n) between them [m]; 0 where they are known to touch.
    """
    pieces = _pieces(gaps <= tolerances.contacts([solid.name for solid in solids]))
    if not pieces.any():
        return tolerances, gaps
    wide = np.minimum(gaps, gap_matrix(solids, LARGEST_FIT, pieces[:, None] != pieces))
    # Edges of length 0 would be none: contacts are set to the smallest length there is.
    edges = np.where(np.isfinite(wide), np.maximum(wide, 1e-12), 0.0)
    tree = minimum_spanning_tree(csr_array(edges)).toarray()
    longest = float(tree.max())
    if longest <= tolerances.contact:
        return tolerances, gaps
    i, k = (int(index) for index in np.argwhere(tree == longest)[0])
    source = (
        f"{tolerances.source}; the product hangs together only at a clearance of "
        f"{1e3 * longest:.3g} mm ({solids[i].name}, {solids[k].name})"
    )
    contact = PER_FIT * longest
    wide = np.minimum(gaps, gap_matrix(solids, (1.0 + FRAGILE) * contact))
    return replace(tolerances, contact=contact, source=source), wide


def _pieces(touching: np.ndarray) -> np.ndarray:
    """Return, per part, the number (n,) of the connected piece that it belongs to."""
    return connected_components(csr_array(touching), directed=False)[1]


def _derived(solids: Sequence[Solid], gaps: np.ndarray) -> Tolerances:
    """Return the tolerances that follow from sizes and clearances."""
    overlap = {solid.name: _overlap(solid) for solid in solids}
    most = max(overlap.values())
    small = {name: value for name, value in overlap.items() if value < most}
    tolerances = Tolerances(most, most, "by default", small)
    pairs = tolerances.overlaps(list(overlap))
    clearance = float(np.min(gaps[gaps > LINE_TO_LINE * pairs], initial=np.inf))
    return replace(tolerances, contact=min(most, PER_CLEARANCE * clearance))


def _overlap(solid: Solid) -> float:
    """Return the largest overlap that does not block one part [m].

    For a small or thin one it is the usual one over a power of the root of two, so that there are
    few lengths to decide for.
    """
    length = float(np.max(solid.upper - solid.lower))
    wanted = min(USUAL, PER_SIZE * length, PER_THICKNESS * solid.thickness)
    return USUAL * 2.0 ** (float(np.floor(2.0 * np.log2(max(wanted, 1e-9) / USUAL))) / 2.0)
