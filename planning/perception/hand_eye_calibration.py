"""Where the camera is on the hand, from views of the board of markers and the arm's joint angles.

Neither the camera's mount nor the board's place needs to be known well: both are found together,
over all views. Each view tells from its image alone where the board is in the camera; with mount
and board that says where the hand is, and the arm's kinematics say so, too. Found are the mount and
the board with which the two differ least. An image is much surer of a pose than kinematics are, so
it is the latter's errors that are weighed: distances in the image would let a turn of the hand by
a twentieth of a degree outweigh its place. Frames: W of the world, M of the tool's mount, C of the
camera, D of the board.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from cell.errors import InputError
from planning.perception.marker_pose import moved

Array = NDArray[np.float64]

FEWEST = 3  # Views: two turns about different axes fix the mount, and 18 differences 12 numbers.
TURNED = np.deg2rad(10.0)  # Least turns between views, about a second axis [rad] [A].
# Errors of an arm's kinematics, per axis [rad, m] [A]: their ratio is what weighs, for the scale is
# found from the residuals. A good calibration leaves some tenths of a millimetre.
KINEMATICS = np.repeat([np.deg2rad(0.05), 1e-4], 3)
LOSS = 3.0  # Differences of more than so many times that lose their weight [A].


@dataclass(frozen=True, eq=False)
class BoardView:
    """One view of the board.

    Attributes:
        X_WM: Where the mount of the tool was, by the arm's kinematics.
        X_CD: Where the board was in the camera, by the image.
    """

    X_WM: RigidTransform
    X_CD: RigidTransform


@dataclass(frozen=True, eq=False)
class HandEyeCalibration:
    """A calibrated mount.

    Attributes:
        X_MC: The camera on the hand.
        X_WD: The board in the world.
        covariance: (12, 12) of the errors of both: for each, turns about the axes of the second
            frame [rad2], then offsets along those of the first [m2].
        offset, turn_deg: Root mean square differences between kinematics and images, as to where
            the hand is [m], [deg].
    """

    X_MC: RigidTransform
    X_WD: RigidTransform
    covariance: Array
    offset: float
    turn_deg: float


def calibrate_hand_eye(views: Sequence[BoardView], X_MC: RigidTransform) -> HandEyeCalibration:
    """Return the mount and the board on which the views agree best.

    Args:
        views: Turned about at least two axes.
        X_MC: Where the camera is believed to be: the start, good to some centimetres and degrees.

    Raises:
        InputError: Too few views, or all turned about one axis.
    """
    _check_turns(views)
    X_WD = views[0].X_WM @ X_MC @ views[0].X_CD

    def differences(step: Array) -> Array:
        """Return by what the hand by the images is off kinematics (n, 6): turns, offsets."""
        X_CM, X_WBoard = moved(X_MC, step[:6]).inverse(), moved(X_WD, step[6:])
        return np.array([_difference(v.X_WM, X_WBoard @ v.X_CD.inverse() @ X_CM) for v in views])

    fit = least_squares(
        lambda step: (differences(step) / KINEMATICS).ravel(),
        np.zeros(12), loss="soft_l1", f_scale=LOSS, x_scale=1e-3,
    )  # fmt: skip
    left = differences(fit.x)
    weighted = (left / KINEMATICS).ravel()
    variance = weighted @ weighted / (len(weighted) - 12)
    return HandEyeCalibration(
        moved(X_MC, fit.x[:6]),
        moved(X_WD, fit.x[6:]),
        variance * np.linalg.inv(fit.jac.T @ fit.jac),
        float(np.sqrt((left[:, 3:] ** 2).sum(axis=1).mean())),
        float(np.rad2deg(np.sqrt((left[:, :3] ** 2).sum(axis=1).mean()))),
    )


def _difference(X_WM: RigidTransform, X_WOther: RigidTransform) -> Array:
    """Return the step (6,) from one pose to another, as `moved` takes it."""
    turn = (X_WM.rotation().inverse() @ X_WOther.rotation()).matrix()
    return np.r_[
        Rotation.from_matrix(turn).as_rotvec(), X_WOther.translation() - X_WM.translation()
    ]


def _check_turns(views: Sequence[BoardView]) -> None:
    """Refuse views that do not fix the mount."""
    if len(views) < FEWEST:
        raise InputError(
            f"{len(views)} views of the board do not fix the camera's place on the hand: at least "
            f"{FEWEST} are needed."
        )
    first = views[0].X_WM.rotation().inverse()
    turns = [Rotation.from_matrix((first @ v.X_WM.rotation()).matrix()).as_rotvec() for v in views]
    spread = np.linalg.svd(turns, compute_uv=False) / np.sqrt(len(views))
    if spread[1] < TURNED:
        raise InputError(
            "The views of the board are turned about one axis only, by "
            f"{np.rad2deg(spread[1]):.1f} deg about any other: the camera's place on the hand "
            f"needs {np.rad2deg(TURNED):.0f}."
        )
