"""What an active stereo camera measures of a scene whose depth is known.

Depth comes from the disparity d = f B / z between two images, found by matching small windows. That
is where all of its errors are from:

- d is noisy by a fraction of a pixel, alike within a window, so that the depth error is
  z^2 sigma / (f B): it grows with the square of the distance;
- d is a multiple of a subpixel step;
- what only one of the two imagers sees has no depth: a shadow beside every edge, on one side;
- d is limited, so that nothing nearer than some 0.17 m has a depth;
- at an edge the window covers two depths, and many pixels have none;
- a decalibrated camera is off by a constant disparity.

The numbers are those of a RealSense D435 and are settings. No real camera has been measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

Array = NDArray[np.float64]

WINDOW = 1.5  # [pixels] [A] Standard deviation of the filter that makes neighbours alike.
EDGE = 0.02  # [A] Of the depth: a larger step between neighbours is an edge.
NEARER = 0.5  # [pixels] Less than this much nearer hides nothing: it is the same surface.


@dataclass(frozen=True)
class StereoDepth:
    """A stereo camera, rectified; its left image is the one that has the depth.

    Attributes:
        focal_length: [pixels].
        baseline: Between the two imagers [m].
        noise: Standard deviation of the disparity [pixels].
        step: Of the disparity [pixels].
        most: Largest disparity that is searched [pixels].
        bias: Added to every disparity [pixels].
        edge_loss: Share of the pixels at an edge that have no depth.
        dropouts: Share of all pixels that have none.
    """

    focal_length: float
    baseline: float
    noise: float
    step: float
    most: float
    bias: float
    edge_loss: float
    dropouts: float

    @property
    def nearest(self) -> float:
        """Smallest depth that is measured [m]."""
        return self.focal_length * self.baseline / self.most

    def sigma(self, depth: float) -> float:
        """Return the standard deviation of a measured depth [m] by the formula above."""
        return depth**2 * self.noise / (self.focal_length * self.baseline)

    def measured(self, depth: Array, rng: np.random.Generator) -> Array:
        """Return the measured depth (h, w) [m], 0 where there is none.

        Args:
            depth: (h, w) true depth along the optical axis [m]; 0 or infinite where there is none.
            rng: Of the noise.
        """
        seen = np.isfinite(depth) & (depth > 0.0)
        true = np.where(seen, depth, np.inf)
        disparity = self.focal_length * self.baseline / true
        seen &= ~_hidden_from_the_right(disparity)
        seen &= rng.random(depth.shape) >= self.dropouts
        # At a step both windows that cover it are at a loss.
        low, high = minimum_filter(true, 3), maximum_filter(true, 3)
        with np.errstate(invalid="ignore"):
            edge = ~(high - low <= EDGE * low)
        seen &= ~(edge & (rng.random(depth.shape) < self.edge_loss))
        found = disparity + self.bias + self.noise * _alike(rng, depth.shape)
        found = self.step * np.round(found / self.step)
        seen &= (found > 0.0) & (found <= self.most)
        return np.where(seen, self.focal_length * self.baseline / np.where(seen, found, 1.0), 0.0)


def _alike(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return noise of unit variance that is alike within a matching window."""
    white = rng.normal(size=shape)
    # A Gaussian filter of width s divides the variance of white noise by 4 pi s^2.
    return gaussian_filter(white, WINDOW, mode="wrap") * np.sqrt(4.0 * np.pi) * WINDOW


def _hidden_from_the_right(disparity: Array) -> NDArray[np.bool_]:
    """Return which pixels of the left image (h, w) the right imager does not see.

    A point at column u is at u - d in the right image. It is hidden if one further right in the
    left image is at the same place there, or further left: that one is nearer.
    """
    place = np.arange(disparity.shape[1]) - disparity
    leftmost = np.minimum.accumulate(place[:, ::-1], axis=1)[:, ::-1]
    hidden = np.zeros(disparity.shape, bool)
    hidden[:, :-1] = leftmost[:, 1:] < place[:, :-1] - NEARER
    return hidden
