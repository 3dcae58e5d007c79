"""The displacement of the jig as measured in the paper: four screws in two pictures from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cell.fixtures.jig_dimensions import BASE_DIAMETER, SCREW_CIRCLE_RADIUS

# The four screws that clamp the membrane, at 90 degrees [S], in J; numbered so that p_2 - p_c is x
# and p_1 - p_c is y of the jig.
SCREWS = SCREW_CIRCLE_RADIUS * np.array([[0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, 0, 0]], dtype=float)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera that looks straight down.

    Attributes:
        p_WC: (3,) its position [m].
        focal_length: In pixels; 615 is a D435's at 640 x 480 [R].
    """

    p_WC: np.ndarray
    focal_length: float = 615.0

    @staticmethod
    def above(X_WJ: RigidTransform, height: float = 0.5) -> Camera:
        """Return the camera at a height [m] over the middle of the jig [A]."""
        return Camera(X_WJ.translation() + np.array([0.0, 0.0, height]))

    def pixels(self, p_WQ: np.ndarray) -> np.ndarray:
        """Return the pixels (n, 2) of points (n, 3), rounded to integers as by a mouse click."""
        R_CW = RotationMatrix.MakeXRotation(np.pi)
        p_CQ = (p_WQ - self.p_WC) @ R_CW.matrix().T
        return np.rint(self.focal_length * p_CQ[:, :2] / p_CQ[:, 2:])


def clicked(camera: Camera, X_WJ: RigidTransform) -> np.ndarray:
    """Return the pixels (4, 2) of the screws of a jig at pose X_WJ."""
    return camera.pixels((X_WJ @ SCREWS.T).T)


def metres_per_pixel(camera: Camera, X_WJ: RigidTransform) -> float:
    """Return the scale from the known width of the jig in the first picture."""
    edge = 0.5 * BASE_DIAMETER * np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    ends = camera.pixels((X_WJ @ edge.T).T)
    return BASE_DIAMETER / float(np.linalg.norm(ends[0] - ends[1]))


def seen_displacement(before: RigidTransform, after: RigidTransform) -> tuple[float, float]:
    """Return the displacement of the jig according to two pictures [m].

    Returns:
        |dp_c|, the distance between the means of the screws; and the formula printed in the paper,
        sqrt(|x_e - x_i|^2 + |y_e - y_i|^2) with x = p_2 - p_c and y = p_1 - p_c, which responds to
        rotations only: differences from the mean do not change in a translation.
    """
    camera = Camera.above(before)
    scale = metres_per_pixel(camera, before)
    first, last = scale * clicked(camera, before), scale * clicked(camera, after)
    moved = float(np.linalg.norm(last.mean(axis=0) - first.mean(axis=0)))
    arms = (last - last.mean(axis=0)) - (first - first.mean(axis=0))
    return moved, float(np.linalg.norm(arms[:2]))
