"""The jig's displacement as the paper measured it: four screws in two pictures from above."""

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
        p_WC: Where it is [m].
        focal_length: In pixels; 615 is a D435's at 640 x 480 [R].
    """

    p_WC: np.ndarray
    focal_length: float = 615.0

    @staticmethod
    def above(X_WJ: RigidTransform, height: float = 0.5) -> Camera:
        """Return the camera over the middle of the jig [m] [A]."""
        return Camera(X_WJ.translation() + np.array([0.0, 0.0, height]))

    def pixels(self, p_WQ: np.ndarray) -> np.ndarray:
        """Return the whole pixels (n, 2) that points (n, 3) are clicked at."""
        R_CW = RotationMatrix.MakeXRotation(np.pi)
        p_CQ = (p_WQ - self.p_WC) @ R_CW.matrix().T
        return np.rint(self.focal_length * p_CQ[:, :2] / p_CQ[:, 2:])


def clicked(camera: Camera, X_WJ: RigidTransform) -> np.ndarray:
    """Return the pixels (4, 2) of the screws of a jig at a pose."""
    return camera.pixels((X_WJ @ SCREWS.T).T)


def metres_per_pixel(camera: Camera, X_WJ: RigidTransform) -> float:
    """Return the scale by the known width of the jig in the first picture."""
    edge = 0.5 * BASE_DIAMETER * np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    ends = camera.pixels((X_WJ @ edge.T).T)
    return BASE_DIAMETER / float(np.linalg.norm(ends[0] - ends[1]))


def seen_displacement(before: RigidTransform, after: RigidTransform) -> tuple[float, float]:
    """Return what the pictures say about a jig that moved, in metres.

    Returns:
        |dp_c|, the distance between the means of the screws; and the formula printed in the paper,
        sqrt(|x_e - x_i|^2 + |y_e - y_i|^2) with x = p_2 - p_c and y = p_1 - p_c: differences from
        the mean do not change in a translation, so it sees rotations only.
    """
    camera = Camera.above(before)
    scale = metres_per_pixel(camera, before)
    first, last = scale * clicked(camera, before), scale * clicked(camera, after)
    moved = float(np.linalg.norm(last.mean(axis=0) - first.mean(axis=0)))
    arms = (last - last.mean(axis=0)) - (first - first.mean(axis=0))
    return moved, float(np.linalg.norm(arms[:2]))
