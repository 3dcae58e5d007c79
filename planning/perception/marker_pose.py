"""Where a camera is, from one image of the board of markers alone.

The pose is the one whose projections of the markers' corners are nearest to those found. Frames: C
of the camera, D of the board.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from cell.errors import RunFailure
from cell.machines.cameras.marker_board import CODES, marker_corners
from cell.machines.cameras.pinhole import Pinhole
from planning.perception.marker_detection import homography

Array = NDArray[np.float64]

FEWEST = 3  # Markers: fewer leave the tilt of the board uncertain [A].
LOSS = 0.3  # Distances beyond this lose their weight [pixels] [A]: several times the usual.
ASTRAY = 1.0  # A corner that is off by more is left out: a shadow ends there [pixels] [A].
SHARPEST = 0.03  # No corner is trusted more [pixels] [A].


class BoardOutOfSight(RunFailure):
    """An image that shows too few markers to tell where the camera is.

    Args:
        seen: How many.
    """

    def __init__(self, seen: int) -> None:
        self.seen = seen
        super().__init__(
            f"The board of markers is out of sight: {seen} of its {len(CODES)} markers were seen, "
            f"at least {FEWEST} are needed."
        )


@dataclass(frozen=True, eq=False)
class BoardPose:
    """The board in the camera's frame.

    Attributes:
        X_CD: Its pose.
        covariance: (6, 6) of the error: turns about the axes of D [rad2], then offsets along the
            axes of C [m2].
        error_px: Root mean square distance between found and projected corners [pixels].
        markers: Numbers of those that were seen.
    """

    X_CD: RigidTransform
    covariance: Array
    error_px: float
    markers: tuple[int, ...]


def board_pose(corners: Mapping[int, Array], pinhole: Pinhole) -> BoardPose:
    """Return where the board is.

    Args:
        corners: (4, 2) [pixels] of each marker by its number, as `detect_markers` finds them.
        pinhole: Of the camera.

    Raises:
        BoardOutOfSight: There are too few markers.
    """
    numbers = np.repeat(sorted(corners), 4)
    p_DQ = marker_corners()[sorted(corners)].reshape(-1, 3)
    seen = np.concatenate([corners[number] for number in sorted(corners)])
    while True:
        markers, counts = np.unique(numbers, return_counts=True)
        markers = tuple(int(number) for number in markers[counts > 1])
        if len(markers) < FEWEST:
            raise BoardOutOfSight(len(markers))
        X_CD, covariance, apart = _fit(p_DQ, seen, pinhole)
        if apart.max() <= ASTRAY:
            error_px = float(np.sqrt(np.mean(apart**2)))
            return BoardPose(X_CD, covariance, error_px, markers)
        kept = np.arange(len(seen)) != apart.argmax()
        numbers, p_DQ, seen = numbers[kept], p_DQ[kept], seen[kept]


def _fit(p_DQ: Array, seen: Array, pinhole: Pinhole) -> tuple[RigidTransform, Array, Array]:
    """Return X_CD for points (n, 3) seen at pixels (n, 2), its covariance, and distances (n,)."""
    X_CD = _planar_pose(p_DQ[:, :2], seen, pinhole)

    def residuals(step: Array) -> Array:
        return (pinhole.project((moved(X_CD, step) @ p_DQ.T).T) - seen).ravel()

    fit = least_squares(residuals, np.zeros(6), loss="soft_l1", f_scale=LOSS, x_scale=1e-3)
    error = residuals(fit.x)
    variance = max(error @ error / (len(error) - 6), SHARPEST**2)
    # The robust fit's Jacobian is weighted, as its pairs are.
    covariance = variance * np.linalg.inv(fit.jac.T @ fit.jac)
    return moved(X_CD, fit.x), covariance, np.linalg.norm(error.reshape(-1, 2), axis=1)


def moved(X_AB: RigidTransform, step: Array) -> RigidTransform:
    """Return a pose after a small step (6,): turns about the axes of B, then offsets along A's."""
    turn = RotationMatrix(Rotation.from_rotvec(step[:3]).as_matrix())
    return RigidTransform(X_AB.rotation() @ turn, X_AB.translation() + step[3:])


def _planar_pose(xy: Array, pixels: Array, pinhole: Pinhole) -> RigidTransform:
    """Return X_CD of points (n, 2) in the plane z = 0 of D, from their homography to the image."""
    rays = (pixels - [pinhole.cx, pinhole.cy]) / pinhole.focal_length
    # Columns: the axes x and y of D and its origin, in C, all by one unknown factor.
    columns = homography(xy, rays)
    columns /= np.sqrt(np.linalg.norm(columns[:, 0]) * np.linalg.norm(columns[:, 1]))
    if columns[2, 2] < 0.0:
        columns = -columns  # The board is in front of the camera.
    x, y, p_CD = columns.T
    R_CD = RotationMatrix.ProjectToRotationMatrix(np.column_stack([x, y, np.cross(x, y)]))
    return RigidTransform(R_CD, p_CD)
