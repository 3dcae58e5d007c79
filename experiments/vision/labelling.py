"""Labels of pictures as a person gets them, with markers: nothing of the truth is used.

Every image tells by its markers where the board is in the camera. The part does not move on the
board while pictures are taken of it, so its pose there is measured once: by registering its mesh to
the depth of several pictures, starting from where the hand has let go of it. The label of a picture
is that pose, carried into the camera by the markers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from cell.machines.cameras.camera import Picture
from cell.machines.cameras.pinhole import Pinhole
from experiments.vision.studio import Shot
from planning.perception.marker_detection import detect_markers
from planning.perception.marker_pose import BoardOutOfSight, BoardPose, board_pose
from planning.perception.registration import Registration, register, views_of
from planning.perception.surface import Surface

Array = NDArray[np.float64]

REGISTERED = 8  # Pictures whose depth is used; more say the same again [A].
SHARE = 0.6  # Least share of measured points that must have a partner on the part [A].
# Of a pixel that shows the part, the model is behind what is measured by less [m] [A]: many times
# the noise of the depth, less than what a part is sunk into the bag.
BEHIND = 3e-3
UNCERTAIN = 5e-4  # Standard deviation of where the board is that a view may have [m] [A].


@dataclass(frozen=True, eq=False)
class Marked:
    """A shot in which the board was seen.

    Attributes:
        shot: What was taken.
        board: Where the board is, by its image.
    """

    shot: Shot
    board: BoardPose


def marked(shot: Shot, pinhole: Pinhole) -> Marked | None:
    """Return a shot with where its board is; None if that is out of sight, or uncertain."""
    try:
        board = board_pose(detect_markers(shot.color), pinhole)
    except BoardOutOfSight:
        return None
    sigma = np.sqrt(np.trace(board.covariance[3:, 3:]))
    return Marked(shot, board) if sigma <= UNCERTAIN else None


def measured_pose(
    shots: Sequence[Marked],
    pinhole: Pinhole,
    surface: Surface,
    X_DP: RigidTransform,
    rng: np.random.Generator,
) -> Registration | None:
    """Return where the part is on the board, with D in the place of W; None if it is not found.

    Args:
        shots: Of one placement.
        pinhole: Of the camera.
        surface: Of the part.
        X_DP: Where it is believed to be, within some millimetres.
        rng: Chooses among the measured points.
    """
    chosen = np.unique(np.linspace(0, len(shots) - 1, REGISTERED).round().astype(int))
    pictures = [
        Picture(0.0, shots[k].board.X_CD.inverse(), pinhole, shots[k].shot.depth) for k in chosen
    ]
    found = register(surface, views_of(pictures, surface, X_DP, rng), X_DP)
    return found if found is not None and found.share >= SHARE else None


def visible(depth: Array, model: Array) -> NDArray[np.bool_]:
    """Return which pixels (h, w) show the part, as the makers of the BOP datasets decide it.

    Args:
        depth: (h, w) as measured [m]; where there is none, the part is taken to be seen.
        model: (h, w) of the part alone, at its labelled pose [m]; 0 where it is not.
    """
    return (model > 0.0) & ((depth == 0.0) | (model - depth <= BEHIND))
