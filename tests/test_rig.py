"""The hand on the carriage of the rig: kinematics, paths, and one short trial on a flat plate."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.math import SpatialVelocity

from cell import CellConfig, load_product
from cell.errors import BadPart, UnknownName
from cell.fixtures.soft_jig import SurfaceSamples
from cell.simulation.phase import PhaseFailed
from experiments.paper.cases import Case, case_seed, judged
from experiments.paper.postures import AXES, POSTURES, PUSHES, chosen
from experiments.paper.push_rule import bed_height, push_line
from experiments.paper.rest import Rest
from experiments.paper.rig.rig import HandPose, build_push_rig
from experiments.paper.rig.rig_simulation import RigSimulation, smooth_path, stroke_path
from experiments.paper.rig.stage import Observer
from experiments.paper.rig_hand import RigBench, tip_pose
from experiments.paper.trial import TrialDisturbance, check_fits, planned_pose, run_trial
from experiments.paper.trial_metrics import tilt_between
from experiments.reporting.statistics import wilson


@pytest.fixture(scope="module")
def motor_rig():
    config = CellConfig().with_changes({"workcell.fixture": "flat_plate"})
    return build_push_rig(config, load_product("motor_unit"), "motor")


@functools.cache
def surface(part: str) -> np.ndarray:
    return SurfaceSamples.of(part, load_product("motor_unit").parts[part].mesh, 0.002).points


@pytest.mark.parametrize("turn", [-2.0, 0.3])
@pytest.mark.parametrize("tilt", [0.0, 0.7, np.pi / 2])
def test_hand_pose_is_recovered_from_its_frame(turn: float, tilt: float) -> None:
    pose = HandPose(np.array([0.1, 0.2, 0.3]), turn, tilt)
    again = HandPose.of(pose.X_WT)
    assert (again.turn, again.tilt) == pytest.approx((turn, tilt))


def test_joints_of_the_carriage_give_the_hand_pose(motor_rig) -> None:
    pose = HandPose(np.array([0.05, 0.1, 0.35]), 0.8, 0.6)
    context = motor_rig.plant.CreateDefaultContext()
    motor_rig.plant.SetPositions(context, motor_rig.carriage, motor_rig.joints(pose))
    tip = motor_rig.plant.GetFrameByName("tip", motor_rig.gripper.instance)
    assert tip.CalcPoseInWorld(context).IsNearlyEqualTo(pose.X_WT, 1e-9)


@pytest.mark.parametrize("posture", POSTURES.values(), ids=lambda posture: posture.label)
def test_carriage_can_take_every_grasp(motor_rig, posture) -> None:
    """The closing direction is horizontal, and the axis of the table points up in the world."""
    part = load_product("motor_unit").parts[posture.part]
    X_WP = planned_pose(part, posture, RigidTransform(), 0.05)
    pose = tip_pose(motor_rig, X_WP, posture.grasp)
    jaw = X_WP @ posture.grasp.X_PJaw
    assert pose.R_WT.matrix() == pytest.approx(jaw.rotation().matrix(), abs=1e-9)
    assert 0 <= pose.tilt <= np.pi / 2 + 1e-9
    assert (X_WP.rotation() @ AXES[posture.up])[2] == pytest.approx(1.0)
    points = part.mesh.vertices @ X_WP.rotation().matrix().T + X_WP.translation()
    assert points[:, 2].min() == pytest.approx(0.05)


@pytest.mark.parametrize("push", PUSHES.values(), ids=lambda push: push.label)
def test_push_is_horizontal_and_meets_the_face_from_outside(push) -> None:
    """The points of the pushed face are on the surface of the part, on the side of the hand."""
    up, along = AXES[push.posture.up], AXES[push.along]
    assert up @ along == 0
    points = surface(push.posture.part)
    across = np.cross(up, along)
    foot, top = 1e-3 * np.array(push.foot), 1e-3 * np.array(push.top)
    assert (top - foot) @ up > 0.004
    for point in (foot, top):
        # Along the push the point is on the part, and little of the part lies before it.
        seen = np.hypot((points - point) @ up, (points - point) @ across) < 2e-3
        assert seen.any()
        near = abs((points - point) @ across) < 2e-3
        before = (points - point)[near] @ along < -2e-3
        assert not before.any() or push.label in ("motor/P1/a", "plate/P2/a")


def test_paths_reach_their_end_and_the_stroke_stops_abruptly() -> None:
    q0, q1 = np.zeros(5), np.array([0.07, 0, 0, 0, 0])
    smooth, stroke = smooth_path(q0, q1, 0.3), stroke_path(q0, q1, 0.25, 2.5)
    for path in (smooth, stroke):
        q, v = path.at(path.duration)
        assert q == pytest.approx(q1)
        assert v == pytest.approx(np.zeros(5), abs=1e-12)
    assert stroke.at(stroke.duration - 1e-6)[1][0] == pytest.approx(0.25)
    # 0.25 m/s after 0.1 s and 12.5 mm, then 57.5 mm at that speed [D].
    assert stroke.duration == pytest.approx(0.1 + 0.0575 / 0.25)


def test_motor_falls_over_on_a_rigid_plate(motor_rig) -> None:
    """The paper's reason for a soft jig: the terminals are not a stable base."""
    posture = POSTURES["motor/P2"]
    disturbance = TrialDisturbance.draw(motor_rig.config, np.random.default_rng(0))
    trial = run_trial(RigBench(motor_rig, posture).begin(disturbance), None)
    result = judged(Case(posture), trial)
    assert not result.success
    # The press acts on the force plate under the jig: the limit of the hand is 20 N.
    assert 15 < result.measured["place_normal_peak_N"] < 40


@pytest.mark.parametrize(
    ("speeds", "rests"),
    [
        (np.full(100, 5e-5), True),
        (np.full(99, 5e-5), False),
        (np.full(100, 2e-4), False),
        (1e-6 * np.exp(np.arange(100) / 70), False),
    ],
    ids=["still", "not for long", "moving", "about to fall over"],
)
@pytest.mark.parametrize("body", ["part", "jig_base"])
def test_rest_is_to_be_slow_for_a_while_without_getting_faster(
    motor_rig, body: str, speeds: np.ndarray, rests: bool
) -> None:
    observer = Observer(motor_rig, motor_rig.diagram.CreateDefaultContext())
    rest, moving, found = Rest(observer), getattr(motor_rig, body).body, False
    for speed in speeds:
        velocity = SpatialVelocity(np.zeros(3), np.array([0.0, speed, 0.0]))
        motor_rig.plant.SetFreeBodySpatialVelocity(observer.context, moving, velocity)
        found = rest.reached()
    assert found == rests


def palm_touches(rig, root) -> set[str]:
    """Return the models that touch the lowered part of the palm."""
    query = rig.scene_graph.get_query_output_port().Eval(rig.scene_graph.GetMyContextFromRoot(root))
    found = set()
    for pair in query.ComputePointPairPenetration():
        ids = {pair.id_A, pair.id_B}
        if rig.palm.geometry in ids:
            (other,) = ids - {rig.palm.geometry}
            frame = query.inspector().GetFrameId(other)
            body = rig.plant.GetBodyFromFrameId(frame)
            found.add(rig.plant.GetModelInstanceName(body.model_instance()))
    return found


def test_contact_that_a_push_tests_is_not_linked(motor_rig) -> None:
    """A link would carry the impact of the hand, and let go."""
    X_WJ, posture = motor_rig.config.workcell.X_WJ, PUSHES["motor/P2/a"].posture
    X_WP = planned_pose(motor_rig.part.part, posture, X_WJ, 0.1)
    pose = tip_pose(motor_rig, X_WP, posture.grasp)
    simulation, links = RigSimulation(motor_rig, X_WJ, X_WP, pose), motor_rig.links
    simulation.fix()
    bodies = (motor_rig.fixture.base, motor_rig.part.body)
    pair = tuple(sorted(int(body.index()) for body in bodies))
    root, before = simulation.root, links.memory(simulation.root).intent
    assert links.policy.until(root, pair, before) is not None
    simulation.wake()
    assert links.policy.until(root, pair, links.memory(root).intent) is None


def test_push_starts_at_the_height_of_the_rule(motor_rig) -> None:
    config, push = motor_rig.config, PUSHES["motor/P2/a"]
    part, X_WJ = motor_rig.part.part, config.workcell.X_WJ
    apex = config.jig.bag.cap_height
    X_WP = planned_pose(part, push.posture, X_WJ, apex)
    pose = tip_pose(motor_rig, X_WP, push.posture.grasp)
    seen = RigSimulation(motor_rig, X_WJ, X_WP, pose).observer
    line = push_line(seen.stage, seen.root, push, seen.X_WJ, seen.X_WP)
    bed = bed_height(seen.stage, seen.root, X_WJ, X_WP.translation()[:2])
    fingers = line.X_WT.translation()[2] - 0.024  # The noses end 24 mm below the tip frame.
    assert fingers == pytest.approx(bed + 0.002, abs=1e-4)
    assert line.direction == pytest.approx(X_WP.rotation() @ [1.0, 0.0, 0.0])
    # The palm leads, 37.5 mm before the tip frame; the gearbox has a radius of 18.4 mm.
    ahead = (line.X_WT.translation() - X_WP.translation()) @ line.direction
    assert ahead == pytest.approx(-0.0184 - 0.0375 - config.push.start_gap, abs=3e-4)
    # A palm above the motor passes: the fingers lead, 9 mm before the tip frame.
    high = replace(config, push=replace(config.push, palm_height=0.15))
    rig = build_push_rig(high, load_product("motor_unit"), "motor")
    line = push_line(rig, rig.diagram.CreateDefaultContext(), push, X_WJ, X_WP)
    ahead = (line.X_WT.translation() - X_WP.translation()) @ line.direction
    assert ahead == pytest.approx(-0.0184 - 0.009 - config.push.start_gap, abs=3e-4)


def test_palm_comes_down_for_the_push_only(motor_rig) -> None:
    """It is low over the fingertips, and touches neither its own fingers nor, before, anything."""
    rig, config = motor_rig, motor_rig.config
    root = rig.diagram.CreateDefaultContext()
    X_WJ = config.workcell.X_WJ
    X_WP = planned_pose(rig.part.part, PUSHES["motor/P2/a"].posture, X_WJ, 0.1)
    down = HandPose(X_WJ.translation() + [0.0, 0.0, 0.14], 0.0)  # The palm in the motor.
    rig.set_up(root, X_WJ, X_WP, rig.joints(down))
    touching = [palm_touches(rig, root)]
    rig.palm.come_down(root)
    touching.append(palm_touches(rig, root))
    assert touching == [set(), {"motor"}]


def test_push_that_cannot_be_started_is_a_verdict(motor_rig) -> None:
    """A hand above the part would miss it; a part that fell presents another face."""
    push, X_WJ = PUSHES["motor/P2/a"], motor_rig.config.workcell.X_WJ
    X_WP = planned_pose(motor_rig.part.part, push.posture, X_WJ, 0.0459)
    pose = tip_pose(motor_rig, X_WP, push.posture.grasp)
    seen = RigSimulation(motor_rig, X_WJ, X_WP, pose).observer
    stage, root = seen.stage, seen.root
    config = replace(stage.config, push=replace(stage.config.push, fingertip_height=0.2))
    with pytest.raises(PhaseFailed, match="miss the part"):
        push_line(replace(stage, config=config), root, push, X_WJ, X_WP)
    fallen = RotationMatrix.MakeYRotation(np.pi / 2) @ X_WP.rotation()
    with pytest.raises(PhaseFailed, match="lies on the face"):
        push_line(stage, root, push, X_WJ, RigidTransform(fallen, X_WP.translation()))


def test_tilt_is_independent_of_yaw() -> None:
    upright = RigidTransform(RollPitchYaw(0.3, -0.2, 0.5), [0, 0, 0])
    turned = RigidTransform(RotationMatrix.MakeZRotation(1.0), np.zeros(3)) @ upright
    leaning = RigidTransform(RotationMatrix.MakeXRotation(0.25), np.zeros(3)) @ upright
    assert tilt_between(upright, turned) == pytest.approx(0.0, abs=1e-6)
    assert tilt_between(upright, leaning) == pytest.approx(0.25)


def test_labels_select_cases() -> None:
    assert len(chosen("case", PUSHES, None)) == 9
    assert len(chosen("case", PUSHES, "motor")) == 3
    assert [push.label for push in chosen("case", PUSHES, "plate/P2/a")] == ["plate/P2/a"]
    with pytest.raises(UnknownName, match="motor/P1/a"):
        chosen("case", PUSHES, "motor/P9")


def test_errors_of_a_trial_are_independent_of_other_trials() -> None:
    first, again = (case_seed(1, "motor/P2", 3).normal(size=4) for _ in range(2))
    other = case_seed(1, "motor/P2", 4).normal(size=4)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_wilson_interval_of_five_out_of_five() -> None:
    low, high = wilson(5, 5)
    assert (low, high) == pytest.approx((0.5655, 1.0), abs=1e-3)


def test_part_wider_than_the_bag_is_refused() -> None:
    config = CellConfig.load("default", ["jig.bag.cap_height=0.005"])
    with pytest.raises(BadPart, match="70 mm wide"):
        check_fits(config, load_product("motor_unit"), POSTURES["plate/P1"])
