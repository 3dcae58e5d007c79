"""Every arm of the registry: model and kinematics agree, poses that it reaches are solved."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder

from cell.errors import UnknownName
from cell.machines.arms import ARM_MODELS, ArmModel, arm_model
from cell.machines.arms.base import LIMIT_MARGIN
from cell.machines.arms.ur import UR5E, UrArm
from cell.paths import model_url, new_parser

ARMS = pytest.mark.parametrize("arm", ARM_MODELS.values(), ids=lambda arm: arm.name)


def plant_of(arm: ArmModel) -> tuple[Diagram, MultibodyPlant]:
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    (instance,) = new_parser(plant).AddModelsFromUrl(model_url(arm.sdf))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(arm.base_frame, instance))
    plant.Finalize()
    return builder.Build(), plant


def random_configurations(arm: ArmModel, count: int, seed: int) -> np.ndarray:
    """Inside the limits with their margin, each joint within half a turn either way."""
    lower, upper = arm.limits
    lower, upper = np.maximum(lower + LIMIT_MARGIN, -np.pi), np.minimum(upper - LIMIT_MARGIN, np.pi)
    return np.random.default_rng(seed).uniform(lower, upper, (count, arm.dof))


def angular_distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(np.angle(np.exp(1j * (a - b)))).max(axis=-1)


def pose_error(X: RigidTransform, X_goal: RigidTransform) -> float:
    """Largest of shift [m] and turn [rad]."""
    turn = (X.rotation().inverse() @ X_goal.rotation()).ToAngleAxis().angle()
    return max(abs(turn), float(np.linalg.norm(X.translation() - X_goal.translation())))


@ARMS
def test_own_forward_kinematics_are_those_of_the_model(arm: ArmModel) -> None:
    _, plant = plant_of(arm)
    context = plant.CreateDefaultContext()
    for q in random_configurations(arm, 20, seed=0):
        plant.SetPositions(context, q)
        X_BF = plant.GetFrameByName(arm.flange_frame).CalcPoseInWorld(context)
        np.testing.assert_allclose(
            arm.flange_pose(q).GetAsMatrix4(), X_BF.GetAsMatrix4(), atol=1e-9
        )


@ARMS
def test_model_has_the_joints_limits_and_drives_of_the_table(arm: ArmModel) -> None:
    _, plant = plant_of(arm)
    lower, upper = arm.limits
    assert [plant.get_joint(i).name() for i in plant.GetJointIndices()][: arm.dof] == list(
        arm.joints
    )
    np.testing.assert_allclose(plant.GetPositionLowerLimits(), lower, rtol=1e-9)
    np.testing.assert_allclose(plant.GetPositionUpperLimits(), upper, rtol=1e-9)
    np.testing.assert_allclose(
        plant.GetVelocityUpperLimits(), [link.speed for link in arm.links], rtol=1e-9
    )
    assert plant.GetEffortUpperLimits().tolist() == [link.effort for link in arm.links]
    assert len(arm.stiffness) == len(arm.damping) == arm.dof
    total = arm.base_mass + sum(link.mass for link in arm.links)
    assert plant.CalcTotalMass(plant.CreateDefaultContext()) == pytest.approx(total)


@ARMS
def test_inertias_are_those_of_real_bodies(arm: ArmModel) -> None:
    _, plant = plant_of(arm)
    for index in plant.GetBodyIndices(plant.GetModelInstanceByName(arm.sdf)):
        inertia = plant.get_body(index).default_spatial_inertia()
        assert inertia.get_mass() > 0 and inertia.IsPhysicallyValid()
    context = plant.CreateDefaultContext()
    assert np.linalg.eigvalsh(plant.CalcMassMatrix(context)).min() > 0.09  # Reflected rotors.


@ARMS
def test_reachable_poses_are_solved_inside_the_limits(arm: ArmModel) -> None:
    lower, upper = arm.limits
    configurations = random_configurations(arm, 200, seed=1)
    nears = random_configurations(arm, 200, seed=2)
    solved = 0
    for q, near in zip(configurations, nears, strict=True):
        X_BF = arm.flange_pose(q)
        solutions = arm.inverse(X_BF, near)
        for solution in solutions:
            assert pose_error(arm.flange_pose(solution), X_BF) < 1e-6
        inside = (solutions >= lower) & (solutions <= upper)
        solved += bool(inside.all(axis=1).any())
    assert solved >= 0.99 * len(configurations)


@ARMS
def test_a_configuration_is_found_again_from_nearby(arm: ArmModel) -> None:
    """What a straight line of the tool needs: the next point continues the last one."""
    rng = np.random.default_rng(3)
    for q in random_configurations(arm, 60, seed=4):
        if arm.is_regular(q):
            near = q + rng.uniform(-0.02, 0.02, arm.dof)
            assert angular_distance(arm.inverse(arm.flange_pose(q), near), q).min() < 0.1


@ARMS
def test_same_question_same_answer(arm: ArmModel) -> None:
    q, near = random_configurations(arm, 2, seed=5)
    first, second = (arm.inverse(arm.flange_pose(q), near) for _ in range(2))
    np.testing.assert_array_equal(first, second)


@ARMS
def test_solutions_differ_from_each_other(arm: ArmModel) -> None:
    q = np.deg2rad(arm.home_deg["gripper"])
    solutions = arm.inverse(arm.flange_pose(q), q)
    assert len(solutions) >= 4
    for i, solution in enumerate(solutions):
        assert angular_distance(np.delete(solutions, i, axis=0), solution).min() > 0.1


@ARMS
def test_too_far_has_no_solution(arm: ArmModel) -> None:
    assert arm.inverse(RigidTransform([2.5, 0.0, 0.2]), np.zeros(arm.dof)).shape == (0, arm.dof)


@ARMS
@pytest.mark.parametrize("role", ["gripper", "driver"])
def test_arm_waits_with_its_tool_down_regular_and_clear_of_itself(arm: ArmModel, role: str) -> None:
    q = np.deg2rad(arm.home_deg[role])
    assert arm.is_regular(q)
    np.testing.assert_allclose(arm.flange_pose(q).rotation().col(2), [0, 0, -1], atol=1e-9)
    diagram, plant = plant_of(arm)
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), q)
    query = plant.get_geometry_query_input_port().Eval(plant.GetMyContextFromRoot(context))
    nearest = query.ComputeSignedDistancePairwiseClosestPoints(0.1)
    assert min((pair.distance for pair in nearest), default=1.0) > 0.005


@ARMS
def test_stretched_or_at_a_limit_is_not_regular(arm: ArmModel) -> None:
    q = np.deg2rad(arm.home_deg["gripper"])
    wound = q.copy()
    wound[-1] = arm.limits[1][-1] - 0.1
    assert arm.is_regular(q) and not arm.is_regular(wound)
    assert not arm.is_regular(np.zeros(arm.dof))


def test_redundant_arm_swings_its_elbow() -> None:
    """One pose, many elbows: among the solutions some differ much and some little."""
    arm = arm_model("iiwa14")
    q = np.deg2rad(arm.home_deg["gripper"])
    solutions = arm.inverse(arm.flange_pose(q), q)
    distances = np.linalg.norm(solutions - q, axis=1)
    assert distances[0] < 1e-6 and (np.diff(distances) >= 0).all()
    lower, upper = arm.limits
    assert (solutions >= lower).all() and (solutions <= upper).all()
    assert len(solutions) > 8


@pytest.mark.parametrize("name", ["ur3e", "ur5e", "ur10e"])
def test_closed_form_finds_all(name: str) -> None:
    arm = arm_model(name)
    assert isinstance(arm, UrArm)
    for q in random_configurations(arm, 60, seed=6):
        assert angular_distance(arm.inverse(arm.flange_pose(q), q), q).min() < 1e-6
    q = np.deg2rad([10, -100, 80, -60, -80, 20])
    assert len(arm.inverse(arm.flange_pose(q), q)) == 8
    assert arm.inverse(RigidTransform([0.0, 0.0, 0.5]), q).shape == (0, 6)  # On the first axis.


def test_aligned_wrist_keeps_the_angle_it_is_given() -> None:
    """With wrist 2 at zero only the sum of wrist 1 and wrist 3 counts."""
    q = np.array([0.3, -1.5, 1.2, -0.8, 0.0, 0.4])
    solutions = UR5E.inverse(UR5E.flange_pose(q), near=np.array([0, 0, 0, 0, 0, 0.9]))
    exact = [s for s in solutions if abs(s[4]) < 1e-6 and abs(s[5] - 0.9) < 1e-9]
    assert exact
    for solution in exact:
        assert UR5E.flange_pose(solution).IsNearlyEqualTo(UR5E.flange_pose(q), 1e-6)


def test_general_kinematics_agree_with_the_closed_form() -> None:
    """The table of links alone is enough, as for an arm without a closed form."""
    for q in random_configurations(UR5E, 20, seed=7):
        X_BF = UR5E.flange_pose(q)
        assert ArmModel.flange_pose(UR5E, q).IsNearlyEqualTo(X_BF, 1e-12)
        for solution in ArmModel.inverse(UR5E, X_BF, q):
            assert angular_distance(UR5E.inverse(X_BF, q), solution).min() < 1e-4


def test_unknown_arm_lists_the_known_ones() -> None:
    with pytest.raises(UnknownName, match="No arm model 'ur5'.*Did you mean 'ur5e'.*iiwa14"):
        arm_model("ur5")
