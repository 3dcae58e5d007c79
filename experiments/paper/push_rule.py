"""The line of a push: one rule for all cases and both hands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context

from cell.simulation.phase import PhaseFailed
from experiments.paper.postures import AXES, MM, PushSpec
from experiments.paper.rig.stage import Stage
from planning.operations.push.phases import PushLine
from planning.operations.stroke import Stroke

# Least horizontal component of a unit direction for a push: beyond it the part is tilted by 84 deg.
LEVEL = 0.1


@dataclass(frozen=True)
class Fingers:
    """The closed hand, pointing down, as boxes that sweep along -y of the tip frame T.

    Attributes:
        lower, upper: (n, 3) corners of the boxes in T [m].
    """

    lower: np.ndarray
    upper: np.ndarray

    @staticmethod
    def of_hand(stage: Stage) -> Fingers:
        """Return the bounding boxes of the collision geometries of the closed hand."""
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
                shape = inspector.GetShape(geometry)
                if isinstance(shape, Box):
                    half = np.array(shape.size()) / 2
                else:
                    half = np.array([shape.radius(), shape.radius(), shape.length() / 2])
                X_TG = X_TB @ inspector.GetPoseInFrame(geometry)
                signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1)
                corners.append(X_TG @ (signs * half[:, None]))
        return Fingers(
            np.array([c.min(axis=1) for c in corners]), np.array([c.max(axis=1) for c in corners])
        )

    @property
    def below_tip(self) -> float:
        """Depth of the lowest point below the tip frame [m]."""
        return float(self.upper[:, 2].max())

    def travel(
        self, p_WQ: np.ndarray, line: np.ndarray, height: float, direction: np.ndarray
    ) -> float:
        """Return the travel of T beyond a point of the push line at first contact [m].

        Args:
            p_WQ: (3, n) points of the part's surface [m].
            line: (2,) a point of the push line [m].
            height: Of the hand's lowest point in W [m].
            direction: (3,) unit vector of the push, horizontal.

        Returns:
            Infinity if the hand would miss the part.
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


def push_line(
    stage: Stage, root: Context, push: PushSpec, X_WJ: RigidTransform, X_WP: RigidTransform
) -> PushLine:
    """Return the straight line of the tip frame T of the closed hand in a push.

    One rule for all cases, see docs/physics/push_experiment.md: the lowest point of the fingers is
    `fingertip_height` above the bed at the foot of the pushed face; the hand points down with the
    narrow sides of its fingers leading and starts `start_gap` before contact, of finger or palm.

    Args:
        stage: Part, jig and hand.
        root: Context of the diagram.
        push: The push.
        X_WJ: Pose of the jig, true or expected.
        X_WP: Pose of the part, likewise.

    Raises:
        PhaseFailed: The hand would miss the part, or the part lies on the pushed face.
    """
    numbers = stage.config.push
    foot, top = (X_WP @ (np.array(point) * MM) for point in (push.foot, push.top))
    direction = X_WP.rotation() @ AXES[push.along]
    if np.hypot(*direction[:2]) < LEVEL:
        raise PhaseFailed("approach", "the part lies on the face that is to be pushed")
    direction = np.array([direction[0], direction[1], 0.0]) / np.hypot(*direction[:2])
    height = bed_height(stage, root, X_WJ, foot[:2]) + numbers.fingertip_height
    fingers = Fingers.of_hand(stage)
    travel = fingers.travel(X_WP @ stage.surface.T, top[:2], height, direction)
    if not np.isfinite(travel):
        raise PhaseFailed("approach", "the closed hand would miss the part")
    p_WT = np.array([*top[:2], height + fingers.below_tip])
    p_WT += (travel - numbers.start_gap) * direction
    stroke = Stroke(numbers.stroke, numbers.speed, numbers.acceleration)
    return PushLine(RigidTransform(leading(direction), p_WT), direction, stroke)


def leading(direction: np.ndarray) -> RotationMatrix:
    """Return R_WT of a hand that points down with -y of T along a horizontal direction (3,)."""
    turn = float(np.arctan2(-direction[0], direction[1]))
    return RotationMatrix.MakeZRotation(turn) @ RotationMatrix.MakeXRotation(np.pi)


def bed_height(
    stage: Stage, root: Context, X_WJ: RigidTransform, p_WQ: np.ndarray, radius: float = 5e-3
) -> float:
    """Return the greatest height of the fixture in W within a radius of a point (2,) [m]."""
    p_JQ = X_WJ.inverse() @ np.array([*p_WQ, X_WJ.translation()[2]])
    ring = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    around = p_JQ[:2] + radius * np.column_stack([np.cos(ring), np.sin(ring)])
    heights = stage.fixture.height_at(root, np.vstack([p_JQ[:2], around]))
    return float(X_WJ.translation()[2] + heights.max())
