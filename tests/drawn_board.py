"""Images of the board of markers drawn without a renderer, and poses to draw it from."""

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cell.machines.cameras import marker_board as board
from cell.machines.cameras.pinhole import Pinhole, looking_at

PINHOLE = Pinhole.centred(848, 480, 424.0)
TABLE, PAPER, INK = 90.0, 200.0, 15.0  # Levels.
FINER = 3  # Samples of a pixel along each axis.


def viewed_from(
    azimuth_deg: float, elevation_deg: float, distance: float, roll_deg: float = 0.0
) -> RigidTransform:
    """Return X_CD of a camera that looks at the middle of the board."""
    azimuth, elevation = np.deg2rad([azimuth_deg, elevation_deg])
    across = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    X_DC = looking_at(distance * (across + [0.0, 0.0, np.sin(elevation)]), np.zeros(3))
    roll = RotationMatrix.MakeZRotation(np.deg2rad(roll_deg))
    return (X_DC @ RigidTransform(roll, np.zeros(3))).inverse()


def plane_depth(X_CD: RigidTransform, pinhole: Pinhole = PINHOLE) -> np.ndarray:
    """Return the depth (h, w) of the board's plane, which goes on for ever [m]."""
    rays, normal = _rays(pinhole), X_CD.rotation().matrix()[:, 2]
    return normal @ X_CD.translation() / (rays @ normal)


def drawn(X_CD: RigidTransform, rng: np.random.Generator) -> np.ndarray:
    """Return an image (h, w, 3) of the board on a table, with noise."""
    fine = PINHOLE.finer(FINER)
    points = plane_depth(X_CD, fine)[..., None] * _rays(fine)
    p_DQ = (points - X_CD.translation()) @ X_CD.rotation().matrix()
    x, y = p_DQ[..., 0], p_DQ[..., 1]
    square = np.maximum(abs(x), abs(y))
    level = np.where(square < board.SIDE / 2, PAPER, TABLE)
    for code, (cx, cy) in zip(board.CODES, board.marker_centres(), strict=True):
        white = np.pad(board.marker_cells(code), 1)
        u, v = (x - cx) / board.MARKER + 0.5, 0.5 - (y - cy) / board.MARKER
        inside = (u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0)
        row, column = (np.floor(board.CELLS * w[inside]).astype(int) for w in (v, u))
        level[inside] = np.where(white[row, column], PAPER, INK)
    level[square < board.HOLE / 2] = TABLE
    size = PINHOLE.height, FINER, PINHOLE.width, FINER
    image = np.repeat(level.reshape(size).mean(axis=(1, 3))[..., None], 3, axis=2)
    return np.clip(image + rng.normal(scale=3.0, size=image.shape), 0, 255).astype(np.uint8)


def _rays(pinhole: Pinhole) -> np.ndarray:
    v, u = np.indices((pinhole.height, pinhole.width))
    x, y = (u - pinhole.cx) / pinhole.focal_length, (v - pinhole.cy) / pinhole.focal_length
    return np.stack([x, y, np.ones_like(x)], axis=-1)
