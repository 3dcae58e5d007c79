"""Pinhole geometry, in the pixel convention of OpenCV.

The camera frame C has x to the right of the image, y down and z into the scene. The centre of the
pixel in the upper left corner is (0, 0). Drake counts from the corner of that pixel: its principal
point is half a pixel more, a difference that is worth 0.4 mm at 0.32 m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.sensors import CameraInfo

Array = NDArray[np.float64]

HALF_PIXEL = 0.5  # From the centre of a pixel to its corner.


def looking_at(p_WC: ArrayLike, p_WTarget: ArrayLike) -> RigidTransform:
    """Return the pose X_WC of an upright camera that looks at a point.

    Args:
        p_WC: (3,) where it is [m].
        p_WTarget: (3,) what it looks at, not vertically above or below it [m].
    """
    forward = np.subtract(p_WTarget, p_WC)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    columns = [right, np.cross(forward, right), forward]
    R_WC = np.stack([column / np.linalg.norm(column) for column in columns], axis=1)
    return RigidTransform(RotationMatrix(R_WC), np.asarray(p_WC, float))


@dataclass(frozen=True)
class Pinhole:
    """Size of an image, focal length and principal point.

    Attributes:
        width, height: [pixels].
        focal_length: Of both axes: pixels are square [pixels].
        cx, cy: Principal point [pixels].
    """

    width: int
    height: int
    focal_length: float
    cx: float
    cy: float

    @staticmethod
    def centred(width: int, height: int, focal_length: float) -> Pinhole:
        """Return a camera whose optical axis meets the middle of its image."""
        return Pinhole(width, height, focal_length, (width - 1) / 2.0, (height - 1) / 2.0)

    def finer(self, factor: int) -> Pinhole:
        """Return the same camera with each pixel divided into so many along both axes."""
        cx, cy = (factor * (c + HALF_PIXEL) - HALF_PIXEL for c in (self.cx, self.cy))
        size = factor * self.width, factor * self.height
        return Pinhole(*size, factor * self.focal_length, cx, cy)

    @property
    def matrix(self) -> Array:
        """(3, 3) K, as OpenCV takes it."""
        f = self.focal_length
        return np.array([[f, 0.0, self.cx], [0.0, f, self.cy], [0.0, 0.0, 1.0]])

    @property
    def drake(self) -> CameraInfo:
        """The same camera as Drake describes it."""
        centre = self.cx + HALF_PIXEL, self.cy + HALF_PIXEL
        f = self.focal_length
        return CameraInfo(self.width, self.height, f, f, *centre)

    def project(self, p_CQ: Array) -> Array:
        """Return the pixels (n, 2) of points (n, 3) in front of the camera [m]."""
        centre = np.array([self.cx, self.cy])
        return np.asarray(self.focal_length * p_CQ[:, :2] / p_CQ[:, 2:] + centre, np.float64)

    def points(self, depth: Array) -> Array:
        """Return p_CQ (n, 3) of every pixel that has a depth [m].

        Args:
            depth: (height, width) along z [m]; 0 where there is none.
        """
        row, column = np.nonzero(depth > 0.0)
        z = depth[row, column].astype(float)
        x, y = ((k - c) / self.focal_length for k, c in ((column, self.cx), (row, self.cy)))
        return np.asarray(np.column_stack([x * z, y * z, z]), np.float64)
