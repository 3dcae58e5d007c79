"""How far the hand can go along a line before one of its pieces touches a part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Box, Cylinder

from experiments.paper.rig.stage import Stage


@dataclass(frozen=True)
class Fingers:
    """The closed hand, pointing down, as boxes that are swept along -y of the tip frame T.

    Attributes:
        lower, upper: (n, 3) corners of the boxes in T [m].
    """

    lower: np.ndarray
    upper: np.ndarray

    @staticmethod
    def of_hand(stage: Stage) -> Fingers:
        """Read the boxes (and the palm, by its bounding box) from the closed hand's model."""
        plant, inspector = stage.plant, stage.scene_graph.model_inspector()
        context = plant.CreateDefaultContext()
        for name in ("finger_left_joint", "finger_right_joint"):
            plant.GetJointByName(name, stage.gripper.instance).set_translation(context, 0.0)
        X_TW = (
            plant.GetFrameByName("tip", stage.gripper.instance).CalcPoseInWorld(context).inverse()
        )
        corners = []
        for body in map(plant.get_body, plant.GetBodyIndices(stage.gripper.instance)):
            X_TB = X_TW @ plant.EvalBodyPoseInWorld(context, body)
            for geometry in plant.GetCollisionGeometriesForBody(body):
                half = _half_size(inspector.GetShape(geometry))
                X_TG = X_TB @ inspector.GetPoseInFrame(geometry)
                signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1)
                corners.append(X_TG @ (signs * half[:, None]))
        return Fingers(
            np.array([c.min(axis=1) for c in corners]), np.array([c.max(axis=1) for c in corners])
        )

    @property
    def below_tip(self) -> float:
        """How far the lowest point is below the tip frame [m]."""
        return float(self.upper[:, 2].max())

    def travel(
        self, p_WQ: np.ndarray, line: np.ndarray, height: float, direction: np.ndarray
    ) -> float:
        """Return how far T goes beyond a point of the push line when the hand first touches.

        Args:
            p_WQ: (3, n) points of the part's surface.
            line: (2,) a point of the push line.
            height: Of the hand's lowest point in W [m].
            direction: (3,) of the push, level.
        """
        across = np.array([-direction[1], direction[0]])
        offset = p_WQ[:2].T - line
        ahead, aside = offset @ direction[:2], offset @ across
        down = height + self.below_tip - p_WQ[2]  # Along z of T, which points down.
        reach = np.inf
        for lower, upper in zip(self.lower, self.upper, strict=True):
            # Turned so that -y of T leads, x of T is across.
            hit = (aside > lower[0]) & (aside < upper[0]) & (down > lower[2]) & (down < upper[2])
            if hit.any():
                reach = min(reach, float(ahead[hit].min() + lower[1]))
        return reach


def _half_size(shape: Box | Cylinder) -> np.ndarray:
    if isinstance(shape, Box):
        return np.array(shape.size()) / 2
    return np.array([shape.radius(), shape.radius(), shape.length() / 2])
