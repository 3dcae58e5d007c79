"""How wrong an estimated pose is, by the measures that the literature uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from cell.machines.cameras.pinhole import Pinhole
from planning.perception.surface import Surface

ADD_SHARE = 0.1  # Of the diameter: Hinterstoisser et al., ACCV 2012.
SMALL = 1e-3, 1.0  # What the assembly asks for [m, deg].


@dataclass(frozen=True)
class PoseError:
    """The error of one estimate.

    Attributes:
        translation: Of the middle of the part [m].
        rotation_deg: Angle of the whole rotation.
        yaw_deg: Its component about the vertical.
        tilt_deg: The rest.
        add_share: Mean distance of the surface's points (ADD) by the part's diameter.
        adds_share: The same with each point's nearest instead of itself (ADD-S): a part that hardly
            changes when it is turned, as a round one about its axis, may be turned.
        pixels: Mean distance of their projections.
        normalised: Its square by the estimate's covariance, in six degrees of freedom.
    """

    translation: float
    rotation_deg: float
    yaw_deg: float
    tilt_deg: float
    add_share: float
    adds_share: float
    pixels: float
    normalised: float

    @property
    def small(self) -> bool:
        """Whether both are at most 1 mm and 1 degree."""
        return self.translation <= SMALL[0] and self.rotation_deg <= SMALL[1]


def pose_error(
    surface: Surface,
    X_WP: RigidTransform,
    X_WTrue: RigidTransform,
    covariance: np.ndarray,
    pinhole: Pinhole,
    X_WC: RigidTransform,
) -> PoseError:
    """Compare an estimate with the truth.

    Args:
        surface: Of the part.
        X_WP: Estimated pose.
        X_WTrue: True pose.
        covariance: (6, 6) of the estimate, as in `planning.perception.belief.Estimate`.
        pinhole: Of the camera into which points are projected.
        X_WC: Of that camera.
    """
    offset = X_WP @ surface.centre - X_WTrue @ surface.centre
    turn_P = Rotation.from_matrix((X_WTrue.inverse() @ X_WP).rotation().matrix()).as_rotvec()
    turn_W = X_WTrue.rotation().matrix() @ turn_P
    found, true = ((X @ surface.points.T).T for X in (X_WP, X_WTrue))
    diameter = float(np.linalg.norm(surface.upper - surface.lower))
    X_CW = X_WC.inverse()
    seen, meant = (pinhole.project((X_CW @ points.T).T) for points in (found, true))
    error = np.r_[turn_P, X_WP.translation() - X_WTrue.translation()]
    return PoseError(
        translation=float(np.linalg.norm(offset)),
        rotation_deg=float(np.rad2deg(np.linalg.norm(turn_W))),
        yaw_deg=float(np.rad2deg(abs(turn_W[2]))),
        tilt_deg=float(np.rad2deg(np.linalg.norm(turn_W[:2]))),
        add_share=float(np.linalg.norm(found - true, axis=1).mean()) / diameter,
        adds_share=float(np.mean(KDTree(found).query(true)[0])) / diameter,
        pixels=float(np.linalg.norm(seen - meant, axis=1).mean()),
        normalised=float(error @ np.linalg.solve(covariance, error)),
    )


def apart(
    X_AB: RigidTransform, X_ATrue: RigidTransform, p_BQ: np.ndarray | None = None
) -> tuple[float, float]:
    """Return by how much a pose is off, at a point of B [mm], and the angle of its turn [deg]."""
    p_BQ = np.zeros(3) if p_BQ is None else p_BQ
    turn = Rotation.from_matrix((X_ATrue.inverse() @ X_AB).rotation().matrix()).magnitude()
    return float(1e3 * np.linalg.norm(X_AB @ p_BQ - X_ATrue @ p_BQ)), float(np.rad2deg(turn))


def random_error(offset: float, angle_deg: float, rng: np.random.Generator) -> RigidTransform:
    """Return an error of a stated size [m, deg] in a random direction, about a random axis."""
    way, axis = (vector / np.linalg.norm(vector) for vector in rng.normal(size=(2, 3)))
    turn = Rotation.from_rotvec(np.deg2rad(angle_deg) * axis).as_matrix()
    return RigidTransform(RotationMatrix(turn), offset * way)
