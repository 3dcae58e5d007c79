"""Kinematics of an arm that stands in the cell with a tool on its flange."""

from __future__ import annotations

import numpy as np
import pytest
from planning_cell import TOOL_DOWN, planning_cell
from pydrake.math import RigidTransform, RotationMatrix

from cell.machines.arm import Arm, Unreachable
from cell.machines.arms.base import LIMIT_MARGIN
from planning.motion.collision_model import CollisionModel

ABOVE_JIG = RigidTransform(TOOL_DOWN, [0.0, 0.15, 0.35])


@pytest.fixture(scope="module")
def model() -> CollisionModel:
    return planning_cell()


def drake_pose(model: CollisionModel, arm: Arm, frame: str, q: np.ndarray) -> RigidTransform:
    context = model.plant.CreateDefaultContext()
    model.plant.SetPositions(context, arm.instance, q)
    return arm.frame(frame).CalcPoseInWorld(context)


def test_forward_kinematics_agrees_with_drake(model: CollisionModel) -> None:
    rng = np.random.default_rng(0)
    for name, frame in (("left", "wide"), ("right", "mount")):
        arm = model.arms[name]
        for q in rng.uniform(-np.pi, np.pi, (10, 6)):
            X_WT = arm.tool_pose(model.context, arm.frame(frame), q)
            expected = drake_pose(model, arm, frame, q)
            np.testing.assert_allclose(X_WT.GetAsMatrix4(), expected.GetAsMatrix4(), atol=1e-9)


@pytest.mark.parametrize(("name", "frame"), [("left", "tip"), ("left", "nose"), ("right", "mount")])
def test_tool_frame_arrives(model: CollisionModel, name: str, frame: str) -> None:
    arm = model.arms[name]
    X_WT = RigidTransform(TOOL_DOWN, [0.0, 0.15, 0.45])
    q = arm.reach(model.context, arm.frame(frame), X_WT, arm.home)
    assert drake_pose(model, arm, frame, q).IsNearlyEqualTo(X_WT, 1e-6)


def test_solutions_are_sorted_and_keep_away_from_the_limits(model: CollisionModel) -> None:
    arm = model.arms["left"]
    near = arm.home + np.array([0, 0, 0, 0, 0, 5.0])  # Turned almost around.
    solutions = arm.configurations(model.context, arm.frame("tip"), ABOVE_JIG, near)
    distances = [np.linalg.norm(q - near) for q in solutions]
    assert distances == sorted(distances)
    lower, upper = arm.joint_limits
    assert upper[0] == pytest.approx(2 * np.pi - LIMIT_MARGIN)
    for q in solutions:
        assert (q >= lower).all() and (q <= upper).all()
        within = np.abs(q - near) <= np.pi + 1e-9
        at_limit = (q + 2 * np.pi > upper) | (q - 2 * np.pi < lower)
        assert (within | at_limit).all()


def test_nearest_solution_is_taken(model: CollisionModel) -> None:
    arm = model.arms["left"]
    solutions = arm.configurations(model.context, arm.frame("tip"), ABOVE_JIG, arm.home)
    q = arm.reach(model.context, arm.frame("tip"), ABOVE_JIG, arm.home)
    np.testing.assert_array_equal(q, solutions[0])


def test_out_of_reach_names_frame_and_pose(model: CollisionModel) -> None:
    arm = model.arms["left"]
    X_WT = RigidTransform(RotationMatrix(), [1.5, 0.25, 0.1])
    with pytest.raises(Unreachable, match=r"left arm .*'tip' to \(1\.500, 0\.250, 0\.100\)"):
        arm.reach(model.context, arm.frame("tip"), X_WT, arm.home)
