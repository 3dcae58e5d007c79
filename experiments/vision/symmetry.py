"""Turns after which a part looks as before: a picture cannot tell one from the other.

A net would have to say two things about the same picture, and would learn their mean. A part that
only nearly looks the same, like a round motor with its terminals out of sight, is no such part: its
net is less sure then, and its covariance is large.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from planning.perception.surface import Surface

TURNS_DEG = (180.0, 120.0, 90.0, 72.0, 60.0, 45.0, 36.0, 30.0)  # A round part: all of them.
SAME = 1e-3  # By which a surface may then be off [m] [A]: the pixel of a close-up.
SHARE = 0.99  # Of the surface that is not off by more [A].
THIN = 10  # One of so many points of the surface is turned.


def same_after(surface: Surface) -> tuple[float, str] | None:
    """Return the angle [deg] and the axis of P, "x", "y" or "z", of a turn that nothing shows.

    Axes go through the middle of the box. None: every turn shows.

    Args:
        surface: Of the part.
    """
    tree, about = KDTree(surface.points), surface.points[::THIN] - surface.centre
    for axis, name in zip(np.eye(3), "xyz", strict=True):
        for angle in TURNS_DEG:
            turn = Rotation.from_rotvec(np.deg2rad(angle) * axis)
            apart = np.asarray(tree.query(turn.apply(about) + surface.centre)[0])
            if np.quantile(apart, SHARE) < SAME:
                return angle, name
    return None
