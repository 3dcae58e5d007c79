"""Looks at a part that has been placed: pictures, estimates in one or more ways, their errors."""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from cell.machines.cameras.camera import ABOVE, Camera, Picture, cameras_of
from cell.machines.cameras.color_image import photographed
from cell.machines.cameras.rendering import USUAL, Lighting, rendering
from cell.whole_file import whole_file
from experiments.paper.rig.stage import Observer
from experiments.vision.boxes import ESTIMATE, TRUTH, with_boxes
from experiments.vision.lighting import random_lighting, unseen_lighting
from experiments.vision.pose_error import PoseError, pose_error, random_error
from experiments.vision.pose_scores import pose_scores
from planning.perception.belief import NEVER, Estimate
from planning.perception.estimators import ByBoth, ByDepth, ByKeypoints, Estimator
from planning.perception.keypoint_net import KeypointNet
from planning.perception.surface import Surface
from planning.perception.viewpoints import viewpoints

DEPTH, KEYPOINTS, BOTH = "depth", "keypoints", "both"
ESTIMATORS = (DEPTH, KEYPOINTS, BOTH)
LIGHTINGS: Mapping[str, Callable[[np.random.Generator], Lighting]] = {
    "usual": lambda rng: USUAL,
    "random": random_lighting,
    "unseen": unseen_lighting,
}
SAMPLES = 2  # Of a pixel of a colour image along each axis [A]: as in collected pictures.


@dataclass(frozen=True)
class Looking:
    """How parts are looked at.

    Attributes:
        looks: At each part that has been placed.
        views: Of each look.
        estimator: How poses are estimated: depth, keypoints, both; several are compared.
        lighting: Of colour images: usual, random as in collected pictures, or unseen, by one low
            lamp as in none of them.
        start: Error of the pose that an estimate by depth starts from [m].
        start_deg: The same about a random axis [deg].
        kinematics: Standard deviation of where the camera is believed to be, per axis [m].
        kinematics_deg: The same about each axis [deg].
    """

    looks: int = 5
    views: int = 3
    estimator: tuple[str, ...] = (DEPTH,)
    lighting: str = "usual"
    start: float = 5e-3
    start_deg: float = 15.0
    kinematics: float = 0.0
    kinematics_deg: float = 0.0


@dataclass(frozen=True)
class _Look:
    """One estimate: its error, None if nothing was found."""

    cpu_seconds: float
    error: PoseError | None


@dataclass
class Eye:
    """Looks at parts of one posture, and keeps how wrong the estimates are.

    Attributes:
        looking: How.
        out: Folder of pictures with boxes, one of each estimator.
        label: Of the posture.
        seed: Of views, noise and lighting.
        mesh: Of the part [m].
        net: For its keypoints; None: those are not asked for.
    """

    looking: Looking
    out: Path
    label: str
    seed: int
    mesh: trimesh.Trimesh
    net: KeypointNet | None = None
    _looks: dict[str, list[_Look]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._looks = {name: [] for name in self.looking.estimator}
        self._surface = Surface.of(self.mesh)
        self._count = 0

    def see(self, event: str, observer: Observer) -> None:
        """Look at a part that has been placed."""
        if event != "placed":
            return
        stage, X_WTrue, looking = observer.stage, observer.X_WP, self.looking
        cameras = cameras_of(stage.plant, stage.scene_graph, observer.X_WJ, stage.config.camera)
        stream = zlib.crc32(self.label.encode())
        rng = np.random.default_rng([self.seed, stream, self._count])
        # Of what only colour needs: estimates by depth are the same with and without it.
        color_rng = np.random.default_rng([self.seed, stream, self._count, 1])
        place = observer.X_WJ @ np.array([0.0, 0.0, stage.fixture.entry_height])
        estimators = self._estimators(place, rng, color_rng)
        for _ in range(looking.looks):
            pictures = [
                cameras[ABOVE].placed(X_WC).take(observer.root, rng)
                for X_WC in viewpoints(X_WTrue @ self._surface.centre, looking.views, rng)
            ]
            first = self._count == 0
            if self.net is not None or first:
                camera = cameras[ABOVE].placed(pictures[0].X_WC)
                pictures[0] = self._colored(pictures[0], camera, observer, color_rng)
            believed = [_misplaced(picture, looking, rng) for picture in pictures]
            X_WStart = X_WTrue @ random_error(looking.start, looking.start_deg, rng)
            # Its covariance is not told: an estimate starts from there and is held by nothing.
            start = Estimate(X_WStart, np.zeros((6, 6)), NEVER)
            for name, estimator in estimators.items():
                began = time.process_time()
                estimate = estimator.find(believed, start)
                seconds = time.process_time() - began
                self._looks[name].append(
                    _Look(seconds, self._judged(estimate, X_WTrue, pictures[0]))
                )
                if estimate is not None and first:
                    boxes = {TRUTH: X_WTrue, ESTIMATE: estimate.X_WP}
                    image = with_boxes(pictures[0], self._surface, boxes)
                    with whole_file(
                        self.out / f"{self.label.replace('/', '_')}_{name}.png"
                    ) as file:
                        file.write_bytes(image)
            self._count += 1

    def scores(self) -> dict[str, Any]:
        """Return the figures of each estimator."""
        return {
            name: pose_scores([look.error for look in looks])
            | {
                "cpu_seconds": float(np.mean([look.cpu_seconds for look in looks]))
                if looks
                else None
            }
            for name, looks in self._looks.items()
        }

    def _estimators(
        self, place: np.ndarray, rng: np.random.Generator, color_rng: np.random.Generator
    ) -> dict[str, Estimator]:
        found: dict[str, Estimator] = {DEPTH: ByDepth(self._surface, rng)}
        if self.net is not None:
            keypoints = ByKeypoints(self.net, place, color_rng)
            found[KEYPOINTS] = keypoints
            found[BOTH] = ByBoth(keypoints, ByDepth(self._surface, color_rng))
        return {name: found[name] for name in self.looking.estimator}

    def _colored(
        self, picture: Picture, camera: Camera, observer: Observer, rng: np.random.Generator
    ) -> Picture:
        """Return a picture with its colour image."""
        lighting = LIGHTINGS[self.looking.lighting](rng)
        with rendering(camera.scene_graph, observer.root, lighting=lighting) as query:
            color = camera.render_color(query, picture.X_WC, samples=SAMPLES)
        return replace(picture, color=photographed(color, rng))

    def _judged(
        self, estimate: Estimate | None, X_WTrue: RigidTransform, picture: Picture
    ) -> PoseError | None:
        return estimate and pose_error(
            self._surface,
            estimate.X_WP,
            X_WTrue,
            estimate.covariance,
            picture.pinhole,
            picture.X_WC,
        )


def _misplaced(picture: Picture, looking: Looking, rng: np.random.Generator) -> Picture:
    """Return a picture that is believed to be taken from a little elsewhere."""
    offset = rng.normal(scale=looking.kinematics, size=3)
    turn = rng.normal(scale=np.deg2rad(looking.kinematics_deg), size=3)
    X_CBelieved = RigidTransform(RotationMatrix(Rotation.from_rotvec(turn).as_matrix()), offset)
    X_WC = picture.X_WC @ X_CBelieved
    return replace(picture, X_WC=X_WC)
