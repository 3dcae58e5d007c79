"""The displacement of the jig as measured in the paper: four screws in two pictures from above."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.fixtures.jig_dimensions import BASE_DIAMETER, SCREW_CIRCLE_RADIUS
from cell.machines.cameras.camera import FixedView

# The four screws that clamp the membrane, at 90 degrees [S], in J; numbered so that p_2 - p_c is x
# and p_1 - p_c is y of the jig.
SCREWS = SCREW_CIRCLE_RADIUS * np.array([[0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, 0, 0]], dtype=float)


def clicked(view: FixedView, p_WQ: np.ndarray) -> np.ndarray:
    """Return the pixels (n, 2) of points (n, 3), rounded to integers as by a mouse click."""
    p_CQ = (view.X_WC.inverse() @ p_WQ.T).T
    return np.rint(view.pinhole.project(p_CQ))


def metres_per_pixel(view: FixedView, X_WJ: RigidTransform) -> float:
    """Return the scale from the known width of the jig in the first picture."""
    edge = 0.5 * BASE_DIAMETER * np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    ends = clicked(view, (X_WJ @ edge.T).T)
    return BASE_DIAMETER / float(np.linalg.norm(ends[0] - ends[1]))


def seen_displacement(
    view: FixedView, before: RigidTransform, after: RigidTransform
) -> tuple[float, float]:
    """Return the displacement of the jig according to two pictures [m].

    Args:
        view: Of the camera above the jig.
        before: X_WJ of the jig in the first picture.
        after: The same in the second.

    Returns:
        |dp_c|, the distance between the means of the screws; and the formula printed in the paper,
        sqrt(|x_e - x_i|^2 + |y_e - y_i|^2) with x = p_2 - p_c and y = p_1 - p_c, which responds to
        rotations only: differences from the mean do not change in a translation.
    """
    scale = metres_per_pixel(view, before)
    first, last = (scale * clicked(view, (X_WJ @ SCREWS.T).T) for X_WJ in (before, after))
    moved = float(np.linalg.norm(last.mean(axis=0) - first.mean(axis=0)))
    arms = (last - last.mean(axis=0)) - (first - first.mean(axis=0))
    return moved, float(np.linalg.norm(arms[:2]))
