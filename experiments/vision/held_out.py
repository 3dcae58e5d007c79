"""A net judged by pictures that it has not learned from, against their labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import trimesh

from cell.machines.cameras.camera import Picture
from cell.machines.cameras.pinhole import Pinhole
from experiments.vision.labelled_views import LabelledView
from experiments.vision.pose_error import pose_error
from experiments.vision.pose_scores import pose_scores
from experiments.vision.training_images import ASIDE
from planning.perception.estimators import ByKeypoints
from planning.perception.keypoint_card import KeypointCard
from planning.perception.keypoint_net import KeypointNet
from planning.perception.surface import Surface


def judged(
    net: KeypointNet, mesh: trimesh.Trimesh, views: Sequence[LabelledView], pinhole: Pinhole
) -> KeypointCard:
    """Return the card of a net with its scores, and with covariances as large as its errors.

    The place that is looked at is off by as much as in training. The board is the world.

    Args:
        net: To be judged.
        mesh: Of its part [m].
        views: Kept from training.
        pinhole: Of the camera.
    """
    surface, rng, errors = Surface.of(mesh), np.random.default_rng(0), []
    for view in views:
        X_DC = view.X_CD.inverse()
        X_DP = X_DC @ view.X_CP
        place = X_DP @ surface.centre + rng.uniform(-ASIDE, ASIDE, 3)
        depth = np.zeros((pinhole.height, pinhole.width))
        picture = Picture(0.0, X_DC, pinhole, depth, view.color)
        found = ByKeypoints(net, place, rng).find([picture], None)
        errors.append(
            found and pose_error(surface, found.X_WP, X_DP, found.covariance, pinhole, X_DC)
        )
    scores = pose_scores(errors)
    scale = net.card.covariance_scale * max(1.0, scores["normalised_error"] or 1.0)
    rounded = {name: value and round(value, 4) for name, value in scores.items()}
    return replace(net.card, covariance_scale=round(scale, 2), scores=rounded)
