"""What a net for keypoints learns from: close-ups of labelled pictures, each time a bit different.

A close-up is aimed beside the part, turned and scaled at random, since neither is known when the
net is used. In half of them the part is in other surroundings, from elsewhere in the pictures: the
part lies about the same way on the jig every time, and the jig must not tell how. Then what is
around the part is covered with patches, and something is put in front of it; a shadow falls, and
colours, sharpness and noise change. Ranges are [A].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cell.machines.cameras.pinhole import Pinhole
from experiments.vision.labelled_views import LabelledView
from planning.perception.close_up import CloseUp
from planning.perception.keypoint_card import KeypointCard
from planning.perception.keypoint_net import centres
from planning.perception.opencv import opencv

Array = NDArray[np.float64]

ASIDE = 0.02  # Of the point aimed at, at most, along each axis of C [m].
ROLL = np.deg2rad(12.0)  # At most.
SCALE = (0.87, 1.15)  # Where the part is on the line of sight is known to some 4 cm.
ELSEWHERE, TRIES = 0.5, 4  # Share of close-ups in other surroundings; tries to find some.
LIGHTEST_SHADOW, DARKEST_SHADOW = 0.9, 0.35  # What is left of the light.


@dataclass(frozen=True, eq=False)
class Batch:
    """Close-ups, and what a net should say about them.

    Attributes:
        images: (n, size, size, 3).
        masks: (n, cells, cells) 1 where a cell's middle shows the part, else 0.
        directions: (n, 2 K, cells, cells) unit vectors (x, y) to each keypoint.
    """

    images: NDArray[np.uint8]
    masks: NDArray[np.float32]
    directions: NDArray[np.float32]


def batch(
    views: Sequence[LabelledView], pinhole: Pinhole, card: KeypointCard, rng: np.random.Generator
) -> Batch:
    """Return one close-up of each view, at random.

    Args:
        views: What was taken.
        pinhole: Of the camera.
        card: Of the net that is to learn from them.
        rng: Of all that changes.
    """
    p_PK, images, masks, directions = np.array(card.p_PK), [], [], []
    count = card.size // card.stride
    cells = centres(np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1), card.stride)
    for view in views:
        p_CAim = view.X_CP @ p_PK[0] + rng.uniform(-ASIDE, ASIDE, 3)
        scale = card.pixels_per_metre * rng.uniform(*SCALE)
        up_C, roll = view.X_CD.rotation().matrix()[:, 2], rng.uniform(-ROLL, ROLL)
        close_up = CloseUp.of(p_CAim, up_C, card.size, scale, roll)
        image = close_up.taken(view.color, pinhole).astype(np.float32)
        seen = close_up.taken(view.visible, pinhole, smooth=False) > 0
        if rng.random() < ELSEWHERE:
            around = _surroundings(views, pinhole, card, rng)
            image = np.where(seen[..., None], image, around)
        seen &= ~_covered(image, seen, rng)
        keypoints = close_up.pinhole.project((close_up.X_CV.inverse() @ view.X_CP @ p_PK.T).T)
        middle = card.stride // 2
        masks.append(seen[middle :: card.stride, middle :: card.stride])
        ray = keypoints[:, None, None] - cells
        unit = ray / np.maximum(np.linalg.norm(ray, axis=3, keepdims=True), 1e-6)
        directions.append(unit.transpose(0, 3, 1, 2).reshape(-1, count, count))
        images.append(_developed(image, rng))
    return Batch(np.array(images), np.array(masks, np.float32), np.array(directions, np.float32))


def _surroundings(
    views: Sequence[LabelledView], pinhole: Pinhole, card: KeypointCard, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Return a close-up in which no part is seen; of one colour if there is none."""
    for _ in range(TRIES):
        view = views[int(rng.integers(len(views)))]
        pixel = rng.uniform(0.0, [pinhole.width, pinhole.height])
        ray = np.r_[(pixel - [pinhole.cx, pinhole.cy]) / pinhole.focal_length, 1.0]
        p_CAim = np.linalg.norm(view.X_CP.translation()) / np.linalg.norm(ray) * ray
        up_C, roll = view.X_CD.rotation().matrix()[:, 2], rng.uniform(-np.pi, np.pi)
        scale = card.pixels_per_metre * rng.uniform(0.7, 2.0)
        close_up = CloseUp.of(p_CAim, up_C, card.size, scale, roll)
        if not close_up.taken(view.visible, pinhole, smooth=False).any():
            return close_up.taken(view.color, pinhole).astype(np.float32)
    return np.full((card.size, card.size, 3), rng.uniform(0.0, 255.0), np.float32)


def _covered(
    image: NDArray[np.float32], seen: NDArray[np.bool_], rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Put patches into an image behind and before the part; return what is hidden by them."""
    hidden = np.zeros_like(seen)
    for _ in range(rng.integers(0, 4)):  # Behind: rectangles of one colour, or chequered.
        patch = _patch(seen.shape, rng) & ~seen
        image[patch] = _paint(seen.shape, rng)[patch]
    if rng.random() < 0.3:  # Before.
        hidden = _patch(seen.shape, rng)
        image[hidden] = _paint(seen.shape, rng)[hidden]
    return hidden


def _patch(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return a turned rectangle somewhere in an image."""
    size = shape[0]
    row, column = np.indices(shape) - rng.uniform(0.0, size, 2)[:, None, None]
    angle = rng.uniform(0.0, np.pi)
    along = np.cos(angle) * column + np.sin(angle) * row
    across = np.cos(angle) * row - np.sin(angle) * column
    length, width = rng.uniform(0.03, 0.2, 2) * size
    return (np.abs(along) < length) & (np.abs(across) < width)


def _paint(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float32]:
    """Return one colour all over an image, or a chequered pattern of two, as of a marker."""
    two = np.repeat(rng.uniform(0.0, 255.0, (2, 1)), 3, axis=1) + rng.normal(
        scale=15.0, size=(2, 3)
    )
    edge = rng.integers(3, 12)
    row, column = np.indices(shape) // edge
    second = (row + column) % 2 if rng.random() < 0.5 else np.zeros(shape, int)
    return two[second].astype(np.float32)


def _developed(image: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return an image with shadow, colours, sharpness and noise changed at random."""
    size = image.shape[0]
    if rng.random() < 0.5:  # The edge of a shadow, sharp or soft.
        angle, offset = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.4, 0.4) * size
        row, column = np.indices(image.shape[:2]) - size / 2.0
        depth = np.cos(angle) * column + np.sin(angle) * row - offset
        lit = 1.0 / (1.0 + np.exp(-np.clip(depth / rng.uniform(0.5, 20.0), -50.0, 50.0)))
        dark = rng.uniform(DARKEST_SHADOW, LIGHTEST_SHADOW)
        image = image * (dark + (1.0 - dark) * lit)[..., None]
    if rng.random() < 0.6:
        image = opencv().GaussianBlur(image, (0, 0), rng.uniform(0.2, 1.1))
    bright = 255.0 * (np.clip(image, 0.0, 255.0) / 255.0) ** rng.uniform(0.75, 1.35)
    bright = bright * rng.uniform(0.65, 1.35) * rng.uniform(0.93, 1.07, 3) + rng.uniform(
        -20.0, 20.0
    )
    bright = bright + rng.uniform(0.0, 8.0) * rng.standard_normal(image.shape, np.float32)
    return np.clip(np.round(bright), 0, 255).astype(np.uint8)
