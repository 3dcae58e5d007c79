"""Where a camera looks at a part from: several sides, at a distance that its depth is good at."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cell.machines.cameras.pinhole import looking_at

# [M] Between the least depth of a D435, 0.17 m, with the part's size, and where its noise, which
# grows with the square of the distance, exceeds half a millimetre.
DISTANCE = 0.28
ELEVATIONS_DEG = (50.0, 75.0)  # From steep enough to see over the bag's rim to short of vertical.

# Of scattered views [A]: as near as the depth allows, as far as markers of 40 mm are still sharp;
# as flat as the arm reaches.
SCATTERED_DISTANCES, SCATTERED_ELEVATIONS_DEG = (0.28, 0.42), (42.0, 84.0)
ROLL_SPREAD_DEG = 20.0

# Of a sector, in the order in which they are tried [deg] [A].
SECTOR_AZIMUTHS_DEG, SECTOR_ELEVATIONS_DEG = (0.0, -30.0, 30.0), (60.0, 75.0, 50.0)
ROLLS_DEG = (0.0, 90.0, 180.0, 270.0)  # An image may stand on its head: the wrist chooses.


def viewpoints(p_WTarget: np.ndarray, count: int, rng: np.random.Generator) -> list[RigidTransform]:
    """Return poses X_WC that look at a point from evenly spread sides.

    Args:
        p_WTarget: (3,) [m].
        count: How many.
        rng: Draws the first azimuth, and every elevation.
    """
    first = rng.uniform(0.0, 2.0 * np.pi)
    poses = []
    for k in range(count):
        azimuth = first + 2.0 * np.pi * k / count
        elevation = np.deg2rad(rng.uniform(*ELEVATIONS_DEG))
        poses.append(_from(p_WTarget, azimuth, elevation))
    return poses


def sector(p_WTarget: np.ndarray, azimuth: float) -> Iterator[list[RigidTransform]]:
    """Yield groups of poses X_WC that look at a point from about one side, the best group first.

    Those of a group differ in elevation, and in how the camera is turned about its axis.

    Args:
        p_WTarget: (3,) [m].
        azimuth: Of the side [rad].
    """
    rolls = [RotationMatrix.MakeZRotation(roll) for roll in np.deg2rad(ROLLS_DEG)]
    for aside in np.deg2rad(SECTOR_AZIMUTHS_DEG):
        poses = [
            _from(p_WTarget, azimuth + aside, elevation)
            for elevation in np.deg2rad(SECTOR_ELEVATIONS_DEG)
        ]
        yield [X_WC @ RigidTransform(R, np.zeros(3)) for X_WC in poses for R in rolls]


def scattered(p_WTarget: np.ndarray, rng: np.random.Generator) -> list[RigidTransform]:
    """Return poses X_WC that look at a point from one random place, and differ in roll.

    Args:
        p_WTarget: (3,) [m].
        rng: Draws the place, and how the camera is turned about its axis.
    """
    azimuth, elevation = rng.uniform(-np.pi, np.pi), rng.uniform(*SCATTERED_ELEVATIONS_DEG)
    distance, aside = rng.uniform(*SCATTERED_DISTANCES), rng.uniform(-1.0, 1.0) * ROLL_SPREAD_DEG
    X_WC = _from(p_WTarget, azimuth, np.deg2rad(elevation), distance)
    turns = [RotationMatrix.MakeZRotation(a) for a in np.deg2rad(np.add(ROLLS_DEG, aside))]
    return [X_WC @ RigidTransform(R, np.zeros(3)) for R in turns]


def _from(
    p_WTarget: np.ndarray, azimuth: float, elevation: float, distance: float = DISTANCE
) -> RigidTransform:
    """Return the pose X_WC of an upright camera that looks at a point from an angle [rad], [m]."""
    across = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    ray = across + np.array([0.0, 0.0, np.sin(elevation)])
    return looking_at(p_WTarget + distance * ray, p_WTarget)
