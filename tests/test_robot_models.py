"""The machines' SDF models: published kinematics, the tools' frames, and room for the product."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import QueryObject, Role
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Diagram, DiagramBuilder
from solids import assert_same_solid

from cell.cad import robots, workcell
from cell.errors import UnknownName
from cell.machines.arms import ARM_MODELS
from cell.machines.grippers import GRIPPER_MODELS, HAND_E, GripperModel, gripper_model
from cell.paths import MODELS, model_url, new_parser

NAMES = (
    *ARM_MODELS,
    *GRIPPER_MODELS,
    "screwdriver",
    "table",
    "riser",
    "force_plate",
    "jig_base",
)
GRIPPERS = pytest.mark.parametrize("gripper", GRIPPER_MODELS.values(), ids=lambda g: g.name)
# Denavit-Hartenberg parameters of the UR5e published by its maker.
A = [0, -0.425, -0.3922, 0, 0, 0]
D = [0.1625, 0, 0, 0.1333, 0.0997, 0.0996]
ALPHA = [np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0]
HOME = np.deg2rad([0, -90, 90, -90, -90, 0])


def dh_pose(q: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    for theta, d, a, alpha in zip(q, D, A, ALPHA, strict=True):
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        pose = pose @ np.array(
            [
                [c, -s * ca, s * sa, a * c],
                [s, c * ca, -c * sa, a * s],
                [0, sa, ca, d],
                [0, 0, 0, 1],
            ]
        )
    return pose


def load(name: str, root: str) -> tuple[Diagram, MultibodyPlant, ModelInstanceIndex]:
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    (instance,) = new_parser(plant).AddModelsFromUrl(model_url(name))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root, instance))
    plant.Finalize()
    return builder.Build(), plant, instance


@pytest.fixture(scope="module")
def arm() -> tuple[Diagram, MultibodyPlant]:
    diagram, plant, _ = load("ur5e", "base_link")
    return diagram, plant


def test_models_on_disk_are_what_the_code_writes(tmp_path: Path) -> None:
    robots.write_models(tmp_path)
    workcell.write_models(tmp_path)
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert {path.parent.name for path in written} == set(NAMES)
    for path in written:
        committed = MODELS / "sdf" / path.relative_to(tmp_path)
        if path.suffix == ".obj":
            assert_same_solid(committed, path)
        else:
            assert committed.read_bytes() == path.read_bytes(), path.name


@pytest.mark.parametrize("name", NAMES)
def test_parses_without_warning_in_strict_mode(name: str) -> None:
    plant = MultibodyPlant(1e-3)
    parser = Parser(plant)
    parser.package_map().AddPackageXml(str(MODELS / "package.xml"))
    parser.SetStrictParsing()
    parser.AddModelsFromUrl(model_url(name))
    plant.Finalize()


def test_flange_follows_the_published_parameters(arm: tuple[Diagram, MultibodyPlant]) -> None:
    _, plant = arm
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(0)
    for q in rng.uniform(-np.pi, np.pi, (20, 6)):
        plant.SetPositions(context, q)
        X_BF = plant.GetFrameByName("flange").CalcPoseInWorld(context)
        np.testing.assert_allclose(X_BF.GetAsMatrix4(), dh_pose(q), atol=1e-9)


def test_arm_mass_and_limits_are_the_published_ones(arm: tuple[Diagram, MultibodyPlant]) -> None:
    _, plant = arm
    assert plant.CalcTotalMass(plant.CreateDefaultContext()) == pytest.approx(21.7)
    assert plant.GetEffortUpperLimits().tolist() == [150, 150, 150, 28, 28, 28]
    np.testing.assert_allclose(plant.GetVelocityUpperLimits(), np.pi, rtol=1e-6)
    np.testing.assert_allclose(
        plant.GetPositionUpperLimits() / np.pi, [2, 2, 1, 2, 2, 2], rtol=1e-6
    )


def test_rotors_add_a_tenth_kg_m2_to_every_joint(arm: tuple[Diagram, MultibodyPlant]) -> None:
    _, plant = arm
    context = plant.CreateDefaultContext()
    with_rotors = plant.CalcMassMatrix(context)
    for index in plant.GetJointActuatorIndices():
        plant.get_joint_actuator(index).SetRotorInertia(context, 0.0)
    difference = with_rotors - plant.CalcMassMatrix(context)
    np.testing.assert_allclose(difference, 0.1 * np.eye(6), atol=1e-9)


def test_arm_does_not_touch_itself_at_home(arm: tuple[Diagram, MultibodyPlant]) -> None:
    diagram, plant = arm
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), HOME)
    query = plant.get_geometry_query_input_port().Eval(plant.GetMyContextFromRoot(context))
    nearest = query.ComputeSignedDistancePairwiseClosestPoints(0.1)
    assert min((pair.distance for pair in nearest), default=1.0) > 0.005


def test_arm_shapes_touch_as_points(arm: tuple[Diagram, MultibodyPlant]) -> None:
    diagram, _ = arm
    inspector = diagram.GetSubsystemByName("scene_graph").model_inspector()
    for shape in inspector.GetAllGeometryIds(Role.kProximity):
        assert not inspector.GetProximityProperties(shape).HasProperty(
            "hydroelastic", "compliance_type"
        )


@GRIPPERS
def test_jaw_frames_are_where_the_grasps_expect_them(gripper: GripperModel) -> None:
    _, plant, _ = load(gripper.sdf, gripper.mount_frame)
    context = plant.CreateDefaultContext()
    z = gripper.tip_z
    for name, p_MJaw in {
        "tip": [0, 0, z],
        "wide": [0, 0.022, z],
        "nose": [0, 0, z + 0.0225],
    }.items():
        X_MJaw = plant.GetFrameByName(name).CalcPoseInWorld(context)
        assert X_MJaw.IsNearlyEqualTo(RigidTransform(p_MJaw), 1e-12), name


@GRIPPERS
@pytest.mark.parametrize("frame", ["tip", "nose", "wide"])
def test_jaw_faces_stand_half_the_opening_from_the_frame(gripper: GripperModel, frame: str) -> None:
    """Each finger travels s/2, so the faces are at +-(s + setback)/2, centred laterally."""
    diagram, plant, _ = load(gripper.sdf, gripper.mount_frame)
    pad, offset = f"pad_{frame}", gripper.setback[frame] / 2
    context = diagram.CreateDefaultContext()
    mine = plant.GetMyMutableContextFromRoot(context)
    inspector = diagram.GetSubsystemByName("scene_graph").model_inspector()
    opening = 0.034
    plant.SetPositions(mine, [opening / 2, opening / 2])
    for finger, side in (("finger_left", 1), ("finger_right", -1)):
        body = plant.GetBodyByName(finger)
        frame_id = plant.GetBodyFrameIdOrThrow(body.index())
        shape = inspector.GetGeometryIdByName(frame_id, Role.kProximity, f"{_model(plant)}::{pad}")
        X_WPad = body.EvalPoseInWorld(mine) @ inspector.GetPoseInFrame(shape)
        p_JawPad = plant.GetFrameByName(frame).CalcPoseInWorld(mine).inverse() @ X_WPad
        thickness = inspector.GetShape(shape).size()[0]
        face = side * p_JawPad.translation()[0] - thickness / 2
        assert face == pytest.approx(opening / 2 + offset)
        assert p_JawPad.translation()[1] == pytest.approx(0.0)


def _model(plant: MultibodyPlant) -> str:
    return plant.GetModelInstanceName(plant.GetBodyByName("palm").model_instance())


@GRIPPERS
def test_only_pads_are_hydroelastic(gripper: GripperModel) -> None:
    diagram, _, _ = load(gripper.sdf, gripper.mount_frame)
    inspector = diagram.GetSubsystemByName("scene_graph").model_inspector()
    soft = {
        inspector.GetName(shape).split("::")[-1]
        for shape in inspector.GetAllGeometryIds(Role.kProximity)
        if inspector.GetProximityProperties(shape).HasProperty("hydroelastic", "compliance_type")
    }
    assert soft == {"pad_tip", "pad_wide", "pad_nose"}


@GRIPPERS
def test_one_drive_moves_both_fingers_apart(gripper: GripperModel) -> None:
    _, plant, _ = load(gripper.sdf, gripper.mount_frame)
    assert plant.num_actuators() == 1
    assert plant.GetEffortUpperLimits().tolist() == [gripper.effort]
    drive = plant.GetJointByName(gripper.drive_joint)
    assert drive.position_upper_limits()[0] == pytest.approx(gripper.stroke / 2)
    assert drive.velocity_upper_limits()[0] == pytest.approx(gripper.speed)
    assert plant.num_constraints() == 1
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, [0.01, 0.01])
    left, right = (
        plant.GetBodyByName(f"finger_{side}").EvalPoseInWorld(context).translation()
        for side in ("left", "right")
    )
    np.testing.assert_allclose(left - right, [0.02, 0, 0], atol=1e-12)


@GRIPPERS
def test_gripper_weighs_what_its_maker_says_and_its_fingertips(gripper: GripperModel) -> None:
    _, plant, instance = load(gripper.sdf, gripper.mount_frame)
    for index in plant.GetBodyIndices(instance):
        assert plant.get_body(index).default_spatial_inertia().IsPhysicallyValid()
    steel_tips = 2 * 0.063  # [kg] Of both fingers.
    published = gripper.palm_mass + 2 * gripper.finger_mass
    total = plant.CalcTotalMass(plant.CreateDefaultContext())
    assert total == pytest.approx(published + steel_tips, abs=1e-3)


def test_grippers_have_the_published_strokes() -> None:
    strokes = {name: model.stroke for name, model in GRIPPER_MODELS.items()}
    assert strokes == pytest.approx({"hand_e": 0.050, "gripper_85": 0.085})
    assert HAND_E.setback == pytest.approx({"tip": 0.0, "nose": 0.0, "wide": 0.024})
    with pytest.raises(UnknownName, match="No gripper model 'hande'.*Did you mean 'hand_e'"):
        gripper_model("hande")


def test_bit_turns_about_the_tool_axis_and_ends_280_mm_from_the_mount() -> None:
    _, plant, _ = load("screwdriver", "mount")
    context = plant.CreateDefaultContext()
    spindle = plant.GetJointByName("spindle_joint")
    spindle.set_angle(context, 0.7)
    X_MTip = plant.GetFrameByName("bit_tip").CalcPoseInWorld(context)
    expected = RigidTransform(RollPitchYaw(0, 0, 0.7), [0, 0, 0.28])
    assert X_MTip.IsNearlyEqualTo(expected, 1e-12)
    assert np.isinf(spindle.position_upper_limits()).all()
    assert plant.GetJointActuatorByName("spindle_joint").effort_limit() == 1.0
    inertia = plant.CalcMassMatrix(context)[spindle.velocity_start(), spindle.velocity_start()]
    assert inertia == pytest.approx(1e-5, rel=0.01)


def test_bit_floats_on_a_slide_along_each_axis() -> None:
    _, plant, _ = load("screwdriver", "mount")
    context = plant.CreateDefaultContext()
    offset = [0.001, -0.0015, 0.004]
    for axis, value in zip("xyz", offset, strict=True):
        joint = plant.GetJointByName(f"float_{axis}_joint")
        assert joint.position_lower_limits()[0] < value < joint.position_upper_limits()[0]
        joint.set_translation(context, value)
    p_MTip = plant.GetFrameByName("bit_tip").CalcPoseInWorld(context).translation()
    np.testing.assert_allclose(p_MTip, np.array([0, 0, 0.28]) + offset, atol=1e-12)


def test_end_of_the_bit_is_bare_and_its_shaft_slender() -> None:
    """A 6 mm shaft 10 mm from a bolt must clear the bit at any height of the last 45 mm."""
    diagram, plant, _ = load("screwdriver", "mount")
    query = _query(diagram, plant)
    for z in (0.238, 0.250, 0.267):
        assert _distance(query, [0, 0, z]) == pytest.approx(-0.002, abs=2e-4), z
    assert _distance(query, [0, 0, 0.275]) == pytest.approx(0.005, abs=1e-6)
    assert _distance(query, [0.010, 0, 0.245]) >= 0.003


@pytest.mark.parametrize(
    ("name", "top"),
    [("table", 0.0), ("jig_base", 0.0), ("force_plate", -0.025), ("riser", -0.06)],
)
def test_static_bodies_stack_up_to_the_jig_frame(name: str, top: float) -> None:
    diagram, plant, _ = load(name, name)
    query = _query(diagram, plant)
    assert _distance(query, [0, 0, top + 0.01]) == pytest.approx(0.01, abs=1e-6)
    assert _distance(query, [0, 0, top - 0.001]) == pytest.approx(-0.001, abs=1e-6)


def _query(diagram: Diagram, plant: MultibodyPlant) -> QueryObject:
    return plant.get_geometry_query_input_port().Eval(
        plant.GetMyContextFromRoot(diagram.CreateDefaultContext())
    )


def _distance(query: QueryObject, p_WQ: list[float]) -> float:
    """Return the signed distance from a point to the nearest collision shape."""
    return min(hit.distance for hit in query.ComputeSignedDistanceToPoint(p_WQ))


def test_nose_grip_leaves_room_for_the_shaft_beside_the_nearest_bolt() -> None:
    """In motor_unit the bolt at 60 deg is 10 mm from the shaft; one of the 30 deg grips clears."""
    diagram, plant, _ = load("hand_e", "mount")
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), [0.00275, 0.00275])
    query = plant.get_geometry_query_input_port().Eval(plant.GetMyContextFromRoot(context))
    bolt = 0.0155 * np.array([np.cos(np.pi / 3), np.sin(np.pi / 3)])
    p_BoltShaft = np.array([0.0, 0.007]) - bolt
    clearances = [
        _clearance_of_shaft(query, p_BoltShaft, closing)
        for closing in np.arange(0, np.pi, np.pi / 6)
    ]
    assert max(clearances) > 0.0005


def _clearance_of_shaft(query: QueryObject, p_BoltShaft: np.ndarray, closing: float) -> float:
    """Return the clearance around a shaft d 6 that ends 17 mm above the seated bolt's origin."""
    c, s = np.cos(closing), np.sin(closing)
    x, y = c * p_BoltShaft[0] + s * p_BoltShaft[1], -s * p_BoltShaft[0] + c * p_BoltShaft[1]
    nose = 0.1975 + 0.0018  # The bolt's origin, along the approach direction from the mount.
    # The approach is against the bolt's z, which mirrors one lateral axis.
    return (
        min(_distance(query, [x, -y, nose - height]) for height in np.linspace(0, 0.017, 9)) - 0.003
    )


@GRIPPERS
def test_planned_neighbours_of_the_hand_are_filtered(gripper: GripperModel) -> None:
    """Fingers meet at their pads when closed: that is a stop, not a contact."""
    diagram, plant, _ = load(gripper.sdf, gripper.mount_frame)
    query = _query(diagram, plant)
    assert not query.ComputePointPairPenetration()
