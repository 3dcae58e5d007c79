"""What is expected before anything has been seen: every part in its place in the tray.

It is what a perception source starts from, and all that a blind run has. Frames: T of the tray.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from cell.configuration.config import CellConfig
from cell.products.product import Product
from planning.perception.belief import NEVER, Estimate

# Of a part in its nest, standard deviations [m], [rad] [A]: nests are cut with some tenths of play.
PLAY, PLAY_ANGLE = 2e-4, np.deg2rad(0.5)


def tray_expected(config: CellConfig) -> Estimate:
    """Return where the tray is by the layout, as certain as its `disturbance` is small."""
    sigma = config.disturbance
    place, yaw = sigma.tray_position_sigma, np.deg2rad(sigma.tray_yaw_sigma_deg)
    spread = np.array([0.0, 0.0, yaw, place, place, 0.0])
    return Estimate(config.workcell.X_WT, np.diag(spread**2), NEVER)


def parts_in_tray(product: Product, tray: Estimate) -> dict[str, Estimate]:
    """Return where parts are that lie in their places in a tray.

    Args:
        product: Its parts; those that have no place in the tray are left out.
        tray: Where the tray is.
    """
    return {
        part.name: _borne(tray, part.X_TrayP)
        for part in product.parts.values()
        if part.X_TrayP is not None
    }


def _borne(tray: Estimate, X_TP: RigidTransform) -> Estimate:
    """Return the estimate of a part whose place in the tray is known but for its play."""
    R_PT, R_WT = X_TP.rotation().inverse().matrix(), tray.X_WP.rotation().matrix()
    J = np.zeros((6, 6))
    J[:3, :3], J[3:, 3:] = R_PT, np.eye(3)
    J[3:, :3] = -R_WT @ np.cross(X_TP.translation(), np.eye(3)).T  # A turn moves it, too.
    play = np.repeat([PLAY_ANGLE, PLAY], 3)
    covariance = J @ tray.covariance @ J.T + np.diag(play**2)
    return Estimate(tray.X_WP @ X_TP, covariance, tray.time)


@dataclass
class Blind:
    """A source that sees nothing: parts are where they are expected, and where they were put.

    Attributes:
        duration: See `planning.perception.belief.Source`.
    """

    duration: float = 0.0

    def look(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> dict[str, Estimate]:
        """Return nothing."""
        return {}

    def save(self) -> np.ndarray:
        """Return nothing to remember."""
        return np.zeros(0)

    def restore(self, state: np.ndarray) -> None:
        """Return to a saved state: there is none."""
