"""The one tolerance of a plan: how small a gap still touches, how small an overlap does not block.

A product may declare it. Otherwise it follows from the product: 0.05 mm, above the sagitta and the
rounding of usual meshes; less for small parts; and less than its smallest clearance, so that a part
with play counts as not touching the wall of its hole, whatever the play is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planning.feasibility.solids import Solid

USUAL = 5e-5  # [m] [A] Ten times the sagitta of a fine mesh (7 um for r 6 mm, n 64).
PER_SIZE = 1.0 / 200.0  # [A] Of the smallest part's length: 0.05 mm for a screw of 10 mm.
PER_CLEARANCE = 2.0 / 3.0  # [A] Leaves a third of the clearance as margin.
LINE_TO_LINE = 0.2  # [A] Of the tolerance: gaps up to this are rounding or sagitta, not clearance.


def largest_tolerance(solids: Sequence[Solid]) -> float:
    """Return the default tolerance of parts without clearances [m], from their sizes."""
    smallest = min(float(np.max(solid.upper - solid.lower)) for solid in solids)
    return min(USUAL, PER_SIZE * smallest)


def default_tolerance(solids: Sequence[Solid], gaps: np.ndarray) -> float:
    """Return the default tolerance [m].

    Args:
        solids: The n parts.
        gaps: (n, n) distances between their surfaces, as ``gap_matrix`` returns them [m].
    """
    largest = largest_tolerance(solids)
    clearances = gaps[gaps > LINE_TO_LINE * largest]
    return min(largest, PER_CLEARANCE * float(np.min(clearances, initial=np.inf)))
