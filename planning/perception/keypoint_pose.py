"""A part's pose from where its keypoints are in an image, each weighted by how surely it is known.

It starts from SQPnP (Terzakis and Lourakis, ECCV 2020), which heeds no weights, of all keypoints
and of the surer half; then the squared distances between projected and found keypoints, in units of
their covariances, are made least by Gauss-Newton's method. The Hessian is the inverse of the pose's
covariance. Frames: C of the camera, P of the part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from cell.machines.cameras.pinhole import Pinhole
from planning.perception.marker_pose import moved
from planning.perception.opencv import opencv
from planning.perception.voting import Keypoints

Array = NDArray[np.float64]

FEWEST = 4  # Keypoints that a pose takes.
SHARPEST = 0.02  # No keypoint is trusted more [pixels] [A].
LOSS = 3.0  # Standard deviations beyond which a keypoint loses its weight [A].
ROUNDS, STILL = 30, 1e-9  # A round that moves and turns by less is the last [m, rad].


@dataclass(frozen=True, eq=False)
class KeypointPose:
    """A pose and how well it fits.

    Attributes:
        X_CP: The pose.
        covariance: (6, 6) of the error: turns about the axes of P [rad2], then offsets along the
            axes of C [m2]. Keypoints that disagree by more than their covariances allow make it
            larger by that factor.
        misfit: Mean square of the distances by the covariances, per degree of freedom: about 1 if
            these are right.
        error_px: Root mean square distance between found and projected keypoints [pixels].
    """

    X_CP: RigidTransform
    covariance: Array
    misfit: float
    error_px: float


def pose_of_keypoints(p_PK: Array, keypoints: Keypoints, pinhole: Pinhole) -> KeypointPose | None:
    """Return the pose in which keypoints are projected to where they were found, None without one.

    Args:
        p_PK: (K, 3) keypoints of the part [m].
        keypoints: Where they are in the image.
        pinhole: Of the camera.

    Raises:
        InputError: OpenCV is not installed.
    """
    known = keypoints.covariance + SHARPEST**2 * np.eye(2)
    whitening = np.asarray(np.linalg.inv(np.linalg.cholesky(known)), float)
    order = np.argsort(np.trace(known, axis1=1, axis2=2))
    ends = []
    for count in (len(p_PK), max(FEWEST + 1, len(p_PK) // 2)):
        surest = np.sort(order[:count])
        start = _unweighted(p_PK[surest], keypoints.pixels[surest], pinhole)
        if start is not None:
            ends.append(_descended(start, p_PK, keypoints.pixels, whitening, pinhole))
    ends = [end for end in ends if end is not None]
    if not ends:
        return None
    X_CP, form, cost = min(ends, key=lambda end: end[2])
    misfit = cost / max(2 * len(p_PK) - 6, 1)
    off = pinhole.project((X_CP @ p_PK.T).T) - keypoints.pixels
    error_px = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
    return KeypointPose(X_CP, max(misfit, 1.0) * np.linalg.inv(form), misfit, error_px)


def _unweighted(p_PK: Array, pixels: Array, pinhole: Pinhole) -> RigidTransform | None:
    """Return X_CP of points (n, 3) at pixels (n, 2), all of the same weight; None behind C."""
    cv2 = opencv()
    solved, turn, shift = cv2.solvePnP(p_PK, pixels, pinhole.matrix, None, flags=cv2.SOLVEPNP_SQPNP)
    if not solved or not np.isfinite([turn, shift]).all():
        return None
    R_CP = RotationMatrix.ProjectToRotationMatrix(cv2.Rodrigues(turn)[0])
    X_CP = RigidTransform(R_CP, shift.ravel())
    return X_CP if _ahead(X_CP, p_PK) else None


def _ahead(X_CP: RigidTransform, p_PK: Array) -> bool:
    return bool(((X_CP @ p_PK.T)[2] > 0.0).all())


def _descended(
    X_CP: RigidTransform, p_PK: Array, pixels: Array, whitening: Array, pinhole: Pinhole
) -> tuple[RigidTransform, Array, float] | None:
    """Return the pose of least cost near a start, the form (6, 6) there and its cost."""
    damping, (form, slope, cost) = 1e-6, _cost(X_CP, p_PK, pixels, whitening, pinhole)
    for _ in range(ROUNDS):
        damped = form + damping * np.diag(np.diag(form))
        step = np.asarray(-np.linalg.solve(damped, slope), float)
        tried = moved(X_CP, step)
        better = _ahead(tried, p_PK)
        if better:
            then = _cost(tried, p_PK, pixels, whitening, pinhole)
            better = then[2] <= cost
        if not better:
            damping *= 10.0
            continue
        X_CP, (form, slope, cost), damping = tried, then, max(damping / 10.0, 1e-9)
        if np.abs(step).max() < STILL:
            break
    return (X_CP, form, cost) if np.linalg.cond(form) < 1e15 else None


def _cost(
    X_CP: RigidTransform, p_PK: Array, pixels: Array, whitening: Array, pinhole: Pinhole
) -> tuple[Array, Array, float]:
    """Return form (6, 6), slope (6,) and value of the robust cost (Huber's) at a pose."""
    p_CK, R_CP = (X_CP @ p_PK.T).T, X_CP.rotation().matrix()
    z, f = p_CK[:, 2], pinhole.focal_length
    to_pixel = np.zeros((len(p_PK), 2, 3))
    to_pixel[:, 0, 0] = to_pixel[:, 1, 1] = f / z
    to_pixel[:, :, 2] = -f * p_CK[:, :2] / z[:, None] ** 2
    motion = np.zeros((len(p_PK), 3, 6))
    # A turn about the axes of P moves p_PK by w x p_PK.
    motion[:, :, :3] = np.einsum(
        "ij,kjl->kil", R_CP, np.cross(np.eye(3), p_PK[:, None]).transpose(0, 2, 1)
    )
    motion[:, :, 3:] = np.eye(3)
    rows = whitening @ to_pixel @ motion
    off = np.einsum("kij,kj->ki", whitening, pinhole.project(p_CK) - pixels)
    size = np.linalg.norm(off, axis=1)
    weight = np.minimum(1.0, LOSS / np.maximum(size, 1e-12))
    form = np.einsum("k,kim,kin->mn", weight, rows, rows)
    slope = np.einsum("k,kim,ki->m", weight, rows, off)
    value = np.where(size < LOSS, size**2, LOSS * (2.0 * size - LOSS)).sum()
    return form, slope, float(value)
