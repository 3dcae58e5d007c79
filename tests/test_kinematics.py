"""Inverse kinematics: every solution is one, and none is missing."""

from __future__ import annotations

import numpy as np
import pytest
from planning_cell import TOOL_DOWN, planning_cell
from pydrake.math import RigidTransform, RotationMatrix

from cell.machines.arm import Arm
from planning.motion.collision_model import CollisionModel
from planning.motion.kinematics import (
    LIMIT_MARGIN,
    Unreachable,
    flange_pose,
    ik_solutions,
    inverse,
    joint_limits,
    solve_ik,
    tool_pose,
)

ABOVE_JIG = RigidTransform(TOOL_DOWN, [0.0, 0.15, 0.35])


@pytest.fixture(scope="module")
def model() -> CollisionModel:
    return planning_cell()


def drake_pose(model: CollisionModel, arm: Arm, frame: str, q: np.ndarray) -> RigidTransform:
    context = model.plant.CreateDefaultContext()
    model.plant.SetPositions(context, arm.instance, q)
    return arm.frame(frame).CalcPoseInWorld(context)


def angular_distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(np.angle(np.exp(1j * (a - b)))).max(axis=-1)


def test_forward_kinematics_agrees_with_drake(model: CollisionModel) -> None:
    rng = np.random.default_rng(0)
    for name, frame in (("left", "wide"), ("right", "mount")):
        arm = model.arms[name]
        for q in rng.uniform(-np.pi, np.pi, (10, 6)):
            X_WT = tool_pose(arm, model.context, arm.frame(frame), q)
            expected = drake_pose(model, arm, frame, q)
            np.testing.assert_allclose(X_WT.GetAsMatrix4(), expected.GetAsMatrix4(), atol=1e-9)


def test_every_inverse_solution_reaches_the_pose() -> None:
    rng = np.random.default_rng(1)
    for q in rng.uniform(-np.pi, np.pi, (60, 6)):
        X_BF = flange_pose(q)
        for solution in inverse(X_BF):
            assert flange_pose(solution).IsNearlyEqualTo(X_BF, 1e-6)


def test_the_angles_that_made_a_pose_are_among_its_solutions() -> None:
    rng = np.random.default_rng(2)
    for q in rng.uniform(-np.pi, np.pi, (60, 6)):
        assert angular_distance(inverse(flange_pose(q)), q).min() < 1e-6


def test_solutions_differ_from_each_other() -> None:
    q = np.deg2rad([10, -100, 80, -60, -80, 20])
    solutions = inverse(flange_pose(q))
    assert len(solutions) == 8
    for i, solution in enumerate(solutions):
        assert angular_distance(np.delete(solutions, i, axis=0), solution).min() > 0.1


def test_aligned_wrist_keeps_the_angle_it_is_given() -> None:
    """With wrist 2 at zero only the sum of wrist 1 and wrist 3 counts."""
    q = np.array([0.3, -1.5, 1.2, -0.8, 0.0, 0.4])
    solutions = inverse(flange_pose(q), wrist_3=0.9)
    assert len(solutions) > 0
    exact = [s for s in solutions if abs(s[4]) < 1e-6 and abs(s[5] - 0.9) < 1e-9]
    assert exact
    for solution in exact:
        assert flange_pose(solution).IsNearlyEqualTo(flange_pose(q), 1e-6)


def test_too_far_has_no_solution() -> None:
    assert inverse(RigidTransform([1.2, 0.0, 0.2])).shape == (0, 6)
    assert inverse(RigidTransform([0.0, 0.0, 0.5])).shape == (0, 6)  # On the axis of the shoulder.


@pytest.mark.parametrize(("name", "frame"), [("left", "tip"), ("left", "nose"), ("right", "mount")])
def test_tool_frame_arrives(model: CollisionModel, name: str, frame: str) -> None:
    arm = model.arms[name]
    X_WT = RigidTransform(TOOL_DOWN, [0.0, 0.15, 0.45])
    q = solve_ik(arm, model.context, arm.frame(frame), X_WT, near=arm.home)
    assert drake_pose(model, arm, frame, q).IsNearlyEqualTo(X_WT, 1e-6)


def test_solutions_are_sorted_and_keep_away_from_the_limits(model: CollisionModel) -> None:
    arm = model.arms["left"]
    near = arm.home + np.array([0, 0, 0, 0, 0, 5.0])  # Turned almost around.
    solutions = ik_solutions(arm, model.context, arm.frame("tip"), ABOVE_JIG, near)
    distances = [np.linalg.norm(q - near) for q in solutions]
    assert distances == sorted(distances)
    lower, upper = joint_limits(arm)
    assert upper[0] == pytest.approx(2 * np.pi - LIMIT_MARGIN)
    for q in solutions:
        assert (q >= lower).all() and (q <= upper).all()
        within = np.abs(q - near) <= np.pi + 1e-9
        at_limit = (q + 2 * np.pi > upper) | (q - 2 * np.pi < lower)
        assert (within | at_limit).all()


def test_first_acceptable_solution_is_taken(model: CollisionModel) -> None:
    arm = model.arms["left"]
    solutions = ik_solutions(arm, model.context, arm.frame("tip"), ABOVE_JIG, arm.home)
    q = solve_ik(
        arm,
        model.context,
        arm.frame("tip"),
        ABOVE_JIG,
        near=arm.home,
        is_free=lambda q: not np.array_equal(q, solutions[0]),
    )
    np.testing.assert_array_equal(q, solutions[1])


def test_out_of_reach_names_frame_and_pose(model: CollisionModel) -> None:
    arm = model.arms["left"]
    X_WT = RigidTransform(RotationMatrix(), [1.5, 0.25, 0.1])
    with pytest.raises(Unreachable, match=r"left arm .*'tip' to \(1\.500, 0\.250, 0\.100\)"):
        solve_ik(arm, model.context, arm.frame("tip"), X_WT, near=arm.home)


def test_nothing_acceptable_says_how_many_collide(model: CollisionModel) -> None:
    arm = model.arms["left"]
    with pytest.raises(Unreachable, match="joint configurations collide"):
        solve_ik(
            arm,
            model.context,
            arm.frame("tip"),
            ABOVE_JIG,
            near=arm.home,
            is_free=lambda q: False,
        )
