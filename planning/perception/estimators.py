"""Ways to tell a part's pose from pictures, behind one interface: depth, keypoints, both.

- `ByDepth` registers the depth of several views against the part's mesh. It needs a prior.
- `ByKeypoints` takes one colour picture and needs no prior of the pose. The part has to be about a
  place that the planner knows, such as the middle of the jig's bag: a close-up of that is what the
  net gets. It is taken twice, the second time of where the net has seen the part. However the
  camera is turned, up in the world is up in the close-up.
- `ByBoth` finds the part by its keypoints and finishes by depth.

Frames: W of the world, C of the camera, V of the close-up, P of the part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cell.errors import InputError
from cell.machines.cameras.camera import Picture
from planning.perception.belief import Estimate
from planning.perception.close_up import CloseUp
from planning.perception.keypoint_net import KeypointNet
from planning.perception.keypoint_pose import pose_of_keypoints
from planning.perception.registration import register, views_of
from planning.perception.surface import Surface
from planning.perception.voting import FEWEST, vote

Array = NDArray[np.float64]

LOOKS = 2  # The first for where the part is.
# Where keypoints are projected to is off by less of the part's size, or it was not seen [A].
MISFIT = 0.1
ASTRAY = 0.06  # A part that is found further from its place is something else [m] [A].


class Estimator(Protocol):
    """A way to tell the pose of one part from pictures."""

    def find(self, pictures: Sequence[Picture], prior: Estimate | None) -> Estimate | None:
        """Return where the part is, or None if the pictures do not show it.

        Args:
            pictures: Taken while it stood still.
            prior: What is believed; None: nothing.

        Raises:
            InputError: What the estimator needs is not there: a prior, or colour.
        """
        ...


@dataclass(frozen=True, eq=False)
class ByDepth:
    """See the module.

    Attributes:
        surface: Of the part.
        rng: Chooses among too many points.
    """

    surface: Surface
    rng: np.random.Generator

    def find(self, pictures: Sequence[Picture], prior: Estimate | None) -> Estimate | None:
        """See `Estimator`; the prior is a start."""
        if prior is None:
            raise InputError("Depth alone finds a part from a prior estimate only.")
        views = views_of(pictures, self.surface, prior.X_WP, self.rng)
        found = register(self.surface, views, prior.X_WP)
        return found and Estimate(found.X_WP, found.covariance, pictures[0].time)


@dataclass(frozen=True, eq=False)
class ByKeypoints:
    """See the module.

    Attributes:
        net: For the part.
        place: (3,) p_W about which it is [m].
        rng: Of the votes.
    """

    net: KeypointNet
    place: Array
    rng: np.random.Generator

    def find(self, pictures: Sequence[Picture], prior: Estimate | None) -> Estimate | None:
        """See `Estimator`; the prior is not used. Of several pictures, the surest is believed."""
        if all(picture.color is None for picture in pictures):
            raise InputError("Keypoints are found in colour pictures, and none has colour.")
        found = [self._in_one(picture, picture.color) for picture in pictures]
        known = [one for one in found if one is not None]
        return min(known, key=lambda one: float(np.linalg.det(one.covariance)), default=None)

    def _in_one(self, picture: Picture, color: NDArray[np.uint8] | None) -> Estimate | None:
        if color is None:
            return None
        card, X_CW = self.net.card, picture.X_WC.inverse()
        up_C, p_CQ = X_CW.rotation().matrix()[:, 2], X_CW @ self.place
        for _ in range(LOOKS):
            close_up = CloseUp.of(p_CQ, up_C, card.size, card.pixels_per_metre)
            seen = self.net.see(close_up.taken(color, picture.pinhole))
            if len(seen.pixels) < FEWEST:
                return None
            pinhole = close_up.pinhole
            ray_V = np.r_[(seen.pixels.mean(axis=0) - pinhole.cx) / pinhole.focal_length, 1.0]
            ray_C = close_up.X_CV @ ray_V
            p_CQ = np.linalg.norm(p_CQ) / np.linalg.norm(ray_C) * ray_C
        keypoints = vote(seen.pixels, seen.directions, self.rng)
        p_PK = np.array(card.p_PK)
        pose = keypoints and pose_of_keypoints(p_PK, keypoints, pinhole)
        if pose is None or pose.error_px > MISFIT * card.size:
            return None
        X_WV = picture.X_WC @ close_up.X_CV
        X_WP = X_WV @ pose.X_CP
        if np.linalg.norm(X_WP @ p_PK[0] - self.place) > ASTRAY:
            return None
        J = np.eye(6)
        J[3:, 3:] = X_WV.rotation().matrix()
        covariance = card.covariance_scale * J @ pose.covariance @ J.T
        return Estimate(X_WP, covariance, picture.time)


@dataclass(frozen=True, eq=False)
class ByBoth:
    """See the module.

    Attributes:
        keypoints: Finds the part.
        depth: Finishes.
    """

    keypoints: ByKeypoints
    depth: ByDepth

    def find(self, pictures: Sequence[Picture], prior: Estimate | None) -> Estimate | None:
        """See `Estimator`; the prior is not used."""
        start = self.keypoints.find(pictures, prior)
        return start and self.depth.find(pictures, start)
