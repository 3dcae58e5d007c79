"""Where a camera looks at a part from: several sides, at a distance that its depth is good at."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.machines.cameras.pinhole import looking_at

# [M] Between the least depth of a D435, 0.17 m, with the part's size, and where its noise, which
# grows with the square of the distance, exceeds half a millimetre.
DISTANCE = 0.28
ELEVATIONS_DEG = (50.0, 75.0)  # From steep enough to see over the bag's rim to short of vertical.


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
        across = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        ray = across + np.array([0.0, 0.0, np.sin(elevation)])
        poses.append(looking_at(p_WTarget + DISTANCE * ray, p_WTarget))
    return poses
