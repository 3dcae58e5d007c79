"""What a colour camera makes of a rendered image: its lens softens edges, its sensor is noisy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

BLUR = 0.6  # Standard deviation of what a lens makes of a point [pixels] [A].
NOISE = 3.0  # Standard deviation of each channel, in levels of 255 [A]: a small sensor indoors.


def photographed(color: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return an image (h, w, 3) as it is taken; rendered images are sharp and without noise."""
    soft = gaussian_filter(color.astype(float), (BLUR, BLUR, 0.0))
    noisy = soft + rng.normal(scale=NOISE, size=color.shape)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)
