"""Surfaces as coarse as a tolerance allows: CAD is tessellated far finer than a wide one needs."""

from __future__ import annotations

import numpy as np

from planning.feasibility.solids import Solid

COARSE = 0.1  # [A] Of the tolerance, as STEP is tessellated: far from where a decision flips.
FINE = 1e-4  # [m] Up to here parts are decided as they are: twice the usual tolerance.
MANY = 1000  # Faces of a part; fewer are not worth simplifying.


def coarsened(solid: Solid, tolerance: float) -> Solid:
    """Return a part with fewer faces, which lie within ``COARSE`` tolerances [m] of its own.

    It is the part itself unless the tolerance is wide, and most of many faces are smaller than a
    disc of it.
    """
    if tolerance <= FINE:
        return solid
    areas = np.linalg.norm(solid.doubled_areas, axis=1) / 2.0
    if len(areas) <= MANY or float(np.median(areas)) >= np.pi * tolerance**2:
        return solid
    return solid.simplified(COARSE * tolerance)
