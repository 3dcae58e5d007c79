"""Which points lie inside of a closed surface."""

from __future__ import annotations

import numpy as np

AT_ONCE = 2_000_000  # Pairs of point and triangle that are held in memory.


def inside(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return whether points (n, 3) lie inside of closed surfaces, given as triangles (m, 3, 3).

    The winding number tells: the solid angle of all triangles over 4 pi, wherever they are seen
    from [R] (Van Oosterom and Strackee, 1983).
    """
    found = np.zeros(len(points), bool)
    many = max(1, AT_ONCE // max(1, len(triangles)))
    for start in range(0, len(points), many):
        seen = triangles[None] - points[start : start + many, None, None]
        a, b, c = seen[:, :, 0], seen[:, :, 1], seen[:, :, 2]
        x, y, z = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
        dot = [np.einsum("pij,pij->pi", p, q) for p, q in ((b, c), (c, a), (a, b))]
        volume = np.einsum("pij,pij->pi", a, np.cross(b, c))
        half = np.arctan2(volume, x * y * z + dot[0] * x + dot[1] * y + dot[2] * z)
        found[start : start + many] = np.abs(half.sum(axis=1)) > np.pi
    return found
