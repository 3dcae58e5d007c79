"""A likely cause of plans that fail: parts that are not in their assembled poses.

CAD and mesh files often hold each part in a frame of its own: all about one origin, or side by side
as they are printed. Such input is recognised by what an assembly never shows, and named where a
plan fails; nothing is decided by it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from planning.feasibility.solids import Solid

SAME_PLACE = 1e-6  # [m] Boxes that agree to this are the same place: rounding of mesh files.
MOST = 0.75  # [A] Share of the parts that make it a habit of the file, not of one part.
OFF = 0.01  # [A] Of the larger box: centres, or corners, this near are drawn at the same point.


def pose_doubt(
    solids: Sequence[Solid], contact: np.ndarray, overlapping: Sequence[tuple[str, str]] = ()
) -> str:
    """Return why the parts are probably not in assembled pose; "" if nothing speaks for it.

    Args:
        solids: All n parts in matrix order.
        contact: (n, n) strictly upper triangular C.
        overlapping: Names of parts that share volume, undeclared.
    """
    start = "the parts are probably not in their assembled poses: "
    boxes = np.array([[*solid.lower, *solid.upper] for solid in solids])
    for i, k in sorted(KDTree(boxes).query_pairs(SAME_PLACE, p=np.inf)):
        a, b = solids[i], solids[k]
        if len(a.faces) == len(b.faces) and abs(a.mass - b.mass) <= 1e-6 * a.mass:
            return f"{start}{a.name} and {b.name} are equal and in the same place"
    if overlapping and len(solids) > 2 and (point := _common_point(solids)):
        return f"{start}{point}, and {len(overlapping)} pairs overlap"
    if _laid_out(solids, contact):
        return f"{start}they lie side by side on one plane, as for printing"
    return ""


def _common_point(solids: Sequence[Solid]) -> str:
    """Return what most boxes have in common: their centre, or a corner; "" if neither."""
    lower, upper = np.array([s.lower for s in solids]), np.array([s.upper for s in solids])
    size = float((upper - lower).max())
    places = {
        "middle": (lower + upper) / 2.0,
        "middle and underside": np.column_stack([((lower + upper) / 2.0)[:, :2], lower[:, 2]]),
        "lower corner": lower,
    }
    for what, points in places.items():
        offsets = np.abs(points - np.median(points, axis=0)).max(axis=1)
        if (offsets <= OFF * size).mean() >= MOST:
            return f"most have their {what} at the same point"
    return ""


def _laid_out(solids: Sequence[Solid], contact: np.ndarray) -> bool:
    """Return whether no parts touch, all stand on one plane, and none is above another."""
    lower, upper = np.array([s.lower for s in solids]), np.array([s.upper for s in solids])
    if contact.any() or len(solids) < 3:
        return False
    size = float((upper - lower).max())
    for up in range(3):
        across = [k for k in range(3) if k != up]
        apart = (lower[:, None, across] >= upper[None, :, across]).any(axis=2)
        beside = apart | apart.T | np.eye(len(solids), dtype=bool)
        if np.ptp(lower[:, up]) <= OFF * size and beside.all():
            return True
    return False
