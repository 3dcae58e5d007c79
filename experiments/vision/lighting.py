"""Light that differs from scene to scene, as in a room over the day."""

from __future__ import annotations

import numpy as np

from cell.machines.cameras.rendering import Lamp, Lighting

LAMPS = (1, 3)  # Fewest and most in the room [A].
LOWEST_DEG = 30.0  # Of a lamp above the horizon [A].
TOTAL = (1.1, 1.6)  # Of all intensities, as exposure leaves it: paper stays below white [A].
CAMERA_SHARE = (0.15, 0.45)  # Of light that comes from everywhere, modelled as at the camera [A].
TINT = 0.08  # Of the background, by which its channels differ [A].
BACKGROUND = (0.3, 0.95)  # [A]

# What no picture of a collection has [A]: one low lamp, so that shadows are long and sharp, hardly
# any light from elsewhere, the exposure longer for that, and a dark background.
LOW_DEG, LOW_TOTAL, LOW_CAMERA_SHARE, LOW_BACKGROUND = (14.0, 26.0), (1.7, 2.2), 0.1, (0.05, 0.25)


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
        lamps.append(_lamp(azimuth, up, float(total * share)))
    return _lit(lamps, float(total * camera), BACKGROUND, rng)


def unseen_lighting(rng: np.random.Generator) -> Lighting:
    """Return one lamp lower than any of `random_lighting`, with little light from elsewhere."""
    azimuth, total = rng.uniform(-np.pi, np.pi), rng.uniform(*LOW_TOTAL)
    up = np.sin(np.deg2rad(rng.uniform(*LOW_DEG)))
    lamp = _lamp(azimuth, float(up), total * (1.0 - LOW_CAMERA_SHARE))
    return _lit([lamp], total * LOW_CAMERA_SHARE, LOW_BACKGROUND, rng)


def _lamp(azimuth: float, up: float, intensity: float) -> Lamp:
    """Return a lamp in a direction of the sky: azimuth [rad], and sine of the height."""
    across = np.sqrt(1.0 - up**2)
    return Lamp("world", (-across * np.cos(azimuth), -across * np.sin(azimuth), -up), intensity)


def _lit(
    lamps: list[Lamp], camera: float, background: tuple[float, float], rng: np.random.Generator
) -> Lighting:
    """Return a lighting with a light at the camera, and a background between two levels."""
    at_camera = Lamp("camera", (0.0, 0.0, 1.0), camera)
    levels = rng.uniform(*background) + rng.normal(scale=TINT, size=3)
    red, green, blue = np.clip(levels, 0.0, 1.0)
    return Lighting((*lamps, at_camera), (float(red), float(green), float(blue)))
