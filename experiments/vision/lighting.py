"""Light that differs from scene to scene, as in a room over the day."""

from __future__ import annotations

import numpy as np

from cell.machines.cameras.rendering import Lamp, Lighting

LAMPS = (1, 3)  # Fewest and most in the room [A].
LOWEST_DEG = 30.0  # Of a lamp above the horizon [A].
TOTAL = (1.1, 1.6)  # Of all intensities, as exposure leaves it: paper stays below white [A].
CAMERA_SHARE = (0.15, 0.45)  # Of light that comes from everywhere, modelled as at the camera [A].
TINT = 0.08  # Of the background, by which its channels differ [A].


def random_lighting(rng: np.random.Generator) -> Lighting:
    """Return some lamps above, a light at the camera, and a background."""
    count = int(rng.integers(LAMPS[0], LAMPS[1] + 1))
    total, camera = rng.uniform(*TOTAL), rng.uniform(*CAMERA_SHARE)
    shares = rng.dirichlet(np.ones(count)) * (1.0 - camera)
    lamps = []
    for share in shares:
        azimuth = rng.uniform(-np.pi, np.pi)
        # Evenly over the part of the sky that is high enough.
        up = rng.uniform(np.sin(np.deg2rad(LOWEST_DEG)), 1.0)
        across = np.sqrt(1.0 - up**2)
        direction = (-across * np.cos(azimuth), -across * np.sin(azimuth), -up)
        lamps.append(Lamp("world", direction, float(total * share)))
    lamps.append(Lamp("camera", (0.0, 0.0, 1.0), float(total * camera)))
    red, green, blue = np.clip(rng.uniform(0.3, 0.95) + rng.normal(scale=TINT, size=3), 0.0, 1.0)
    return Lighting(tuple(lamps), (float(red), float(green), float(blue)))
