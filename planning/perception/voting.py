"""Keypoints from pixels that point at them: where most of the lines meet, and how surely.

Peng et al., PVNet: Pixel-wise Voting Network for 6DoF Pose Estimation, CVPR 2019: pairs of pixels
are drawn, where their lines cross is a hypothesis, and its weight is how many pixels point to it.
There, mean and covariance of the hypotheses are those of the keypoint. That is the spread of what
two pixels say, not of what all of them say together. Here, the hypothesis of most weight only tells
which pixels are to be believed; the keypoint is the point nearest to their lines, in the sense of
least squares of angles, and the residuals give its covariance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST = 20  # Pixels: fewer are no part [A].
MOST = 1_000  # Pixels that vote; more say the same again [A].
HYPOTHESES = 256  # Of each keypoint [A]; PVNet: 128.
CROSSING = 0.1  # Least sine of the angle between two lines that give a hypothesis [A].
AGREES = np.deg2rad(8.0)  # [R] PVNet: cosine 0.99.
# Least and most by which a pixel may point past a keypoint in the end; between, it is three
# standard deviations of those that point nearly there [A].
SHARPEST, BLUNTEST = np.deg2rad(1.0), np.deg2rad(15.0)
# A pixel nearer to the keypoint than this is off by a distance rather than an angle [pixels] [A].
NEAR = 4.0
ROUNDS = 5  # Of adjusting a keypoint.


@dataclass(frozen=True, eq=False)
class Keypoints:
    """Where keypoints are in an image.

    Attributes:
        pixels: (K, 2).
        covariance: (K, 2, 2) of the errors [pixels2], as if those of all pixels were independent.
    """

    pixels: Array
    covariance: Array


def vote(pixels: Array, directions: Array, rng: np.random.Generator) -> Keypoints | None:
    """Return keypoints, or None if too few pixels agree on one.

    Args:
        pixels: (n, 2) of what is taken for the part.
        directions: (n, K, 2) from each pixel to each keypoint, of any length.
        rng: Draws the pairs, and who votes if there are too many.
    """
    if len(pixels) > MOST:
        chosen = rng.choice(len(pixels), MOST, replace=False)
        pixels, directions = pixels[chosen], directions[chosen]
    if len(pixels) < FEWEST:
        return None
    lengths = np.linalg.norm(directions, axis=2, keepdims=True)
    units = directions / np.maximum(lengths, 1e-12)
    found = [_meeting(pixels, units[:, k], rng) for k in range(directions.shape[1])]
    known = [one for one in found if one is not None]
    if len(known) < len(found):
        return None
    return Keypoints(np.array([point for point, _ in known]), np.array([cov for _, cov in known]))


def _meeting(pixels: Array, units: Array, rng: np.random.Generator) -> tuple[Array, Array] | None:
    """Return where lines (n, 2) through pixels (n, 2) meet, and the covariance (2, 2)."""
    normals = np.column_stack([-units[:, 1], units[:, 0]])
    offsets = np.einsum("ij,ij->i", normals, pixels)  # A line: normal . point = offset.
    i, j = rng.integers(0, len(pixels), (2, HYPOTHESES))
    sine = normals[i, 0] * normals[j, 1] - normals[i, 1] * normals[j, 0]
    i, j, sine = (values[np.abs(sine) > CROSSING] for values in (i, j, sine))
    if not len(sine):
        return None
    crossings = np.column_stack(
        [
            (offsets[i] * normals[j, 1] - offsets[j] * normals[i, 1]) / sine,
            (offsets[j] * normals[i, 0] - offsets[i] * normals[j, 0]) / sine,
        ]
    )
    weights = [(_past(point, pixels, units) < AGREES).sum() for point in crossings]
    point, covariance = crossings[np.argmax(weights)], np.zeros((2, 2))
    for _ in range(ROUNDS):
        past = _past(point, pixels, units)
        near = past[past < BLUNTEST]
        if len(near) < FEWEST:
            return None
        believed = past < np.clip(3.0 * 1.4826 * np.median(near), SHARPEST, BLUNTEST)
        step, covariance = _adjusted(point, pixels[believed], units[believed])
        point = point + step
    return point, covariance


def _adjusted(point: Array, pixels: Array, units: Array) -> tuple[Array, Array]:
    """Return the step (2,) of a point by which the angles to it fit better, and its covariance.

    Angles, not distances from the lines: these would draw the point to the pixels.
    """
    ray = point - pixels
    distance = np.maximum(np.linalg.norm(ray, axis=1), 1e-6)
    angle = (units[:, 0] * ray[:, 1] - units[:, 1] * ray[:, 0]) / distance
    row = np.column_stack([-ray[:, 1], ray[:, 0]]) / distance[:, None] ** 2
    weight = distance**2 / (distance**2 + NEAR**2)
    inverse = np.linalg.inv((row * weight[:, None]).T @ row)
    pull = row * (weight * angle)[:, None]
    # Each pixel errs as it does, wherever it is: White, Econometrica 48, 1980.
    return -inverse @ pull.sum(axis=0), inverse @ (pull.T @ pull) @ inverse


def _past(point: Array, pixels: Array, units: Array) -> Array:
    """Return the angles (n,) by which pixels point past a point [rad]."""
    ray = point - pixels
    across = units[:, 0] * ray[:, 1] - units[:, 1] * ray[:, 0]
    return np.abs(np.arctan2(across, np.einsum("ij,ij->i", ray, units)))
