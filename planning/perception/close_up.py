"""A close-up of a picture: what a virtual camera shows that is turned towards a point.

It stands where the camera stood, so that it sees the same and no depth is needed: pixels are mapped
to pixels. Frames: C of the camera, V of the virtual one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from cell.machines.cameras.pinhole import Pinhole
from planning.perception.opencv import opencv

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CloseUp:
    """See the module.

    Attributes:
        pinhole: Of the virtual camera, square, centred.
        X_CV: Its pose: turned only.
    """

    pinhole: Pinhole
    X_CV: RigidTransform

    @staticmethod
    def of(
        p_CQ: Array, up_C: Array, size: int, pixels_per_metre: float, roll: float = 0.0
    ) -> CloseUp:
        """Return a close-up with a point in its middle, where it has a stated scale.

        Args:
            p_CQ: (3,) the point, in front of the camera [m].
            up_C: (3,) what is up in the close-up, however the camera is turned; not along the line
                of sight.
            size: Edge of the image [pixels].
            pixels_per_metre: Of what lies across the line of sight at that point.
            roll: By which it is turned about its axis [rad].
        """
        distance = float(np.linalg.norm(p_CQ))
        across = np.cross(p_CQ, up_C)
        columns = [across, np.cross(p_CQ, across), p_CQ]
        R_CV = RotationMatrix(np.column_stack([c / np.linalg.norm(c) for c in columns]))
        X_CV = RigidTransform(R_CV @ RotationMatrix.MakeZRotation(roll), np.zeros(3))
        return CloseUp(Pinhole.centred(size, size, pixels_per_metre * distance), X_CV)

    def taken(self, image: NDArray, pinhole: Pinhole, *, smooth: bool = True) -> NDArray:
        """Return the close-up (size, size, ...) of an image; what is outside of that is black.

        Args:
            image: (h, w) or (h, w, 3).
            pinhole: Of the camera that took it.
            smooth: Whether to interpolate; masks are not.

        Raises:
            InputError: OpenCV is not installed.
        """
        cv2 = opencv()
        R_CV = self.X_CV.rotation().matrix()
        to_image = pinhole.matrix @ R_CV @ np.linalg.inv(self.pinhole.matrix)
        flags = cv2.WARP_INVERSE_MAP | (cv2.INTER_LINEAR if smooth else cv2.INTER_NEAREST)
        size = self.pinhole.width, self.pinhole.height
        return np.asarray(cv2.warpPerspective(image, to_image, size, flags=flags))
