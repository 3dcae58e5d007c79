"""The arm's hand in the paper's experiments: reach, what it disturbs, and one short placement."""

import functools

import numpy as np
import pytest
from pydrake.math import RigidTransform

from cell import CellConfig, load_product
from cell.simulation.phase import PhaseFailed
from experiments.paper.cases import Case, judged
from experiments.paper.postures import POSTURES, PUSHES
from experiments.paper.push_rule import leading, push_line
from experiments.paper.rig.rig import SLIDE_DRIVE, TURN_DRIVE
from experiments.paper.robot_hand import RobotBench, RobotHand
from experiments.paper.trial import TrialDisturbance, run_trial
from experiments.paper.trial_metrics import tilt_between
from planning.motion.timing import JointMotion
from planning.operations.grasping import reachable_grasps
from planning.operations.placement import YAWS, pose_on_jig
from planning.operations.push.phases import PushLine, can_push, push
from planning.operations.stroke import Stroke

STILL = TrialDisturbance(RigidTransform(), np.zeros(2), seed=0)


@functools.cache
def bench(posture: str, pushed: str | None = None) -> RobotBench:
    chosen = None if pushed is None else PUSHES[pushed]
    return RobotBench.build(CellConfig(), load_product("motor_unit"), POSTURES[posture], chosen)


def hand(posture: str, pushed: str | None = None) -> RobotHand:
    return bench(posture, pushed).begin(STILL)


@pytest.mark.parametrize("posture", POSTURES)
def test_part_lies_still_in_the_tray_within_the_arms_reach(posture: str) -> None:
    """As the posture has it turned: on the tray, not in it, and there is a way to grasp it."""
    robot = hand(posture)
    before = robot.observer.X_WP
    cell = robot.simulation.cell
    cell.parts.wake(robot.observer.root, POSTURES[posture].part)
    for _ in range(150):
        robot.simulation.step()
    after = robot.observer.X_WP
    assert np.linalg.norm(after.translation() - before.translation()) < 1.5e-3
    assert before.IsNearlyEqualTo(after, 0.03)
    assert robot.observer.speed < 2e-3
    station, grasp = robot.station, POSTURES[posture].grasp
    station.look()
    name = POSTURES[posture].part
    assert any(True for _ in reachable_grasps(station, name, after, [grasp]))


@pytest.mark.parametrize("label", PUSHES)
def test_every_push_is_within_reach_whatever_the_yaw(label: str) -> None:
    chosen = PUSHES[label]
    robot, posture = hand(chosen.posture.label, label), chosen.posture
    height = CellConfig().jig.bag.cap_height - 0.007
    for yaw in YAWS[::6]:
        X_WP = pose_on_jig(robot.station, posture.part, posture.up, yaw, height)
        assert robot.leaves_room(X_WP)


def test_a_push_out_of_reach_is_refused_with_a_reason() -> None:
    robot = hand("motor/P2", "motor/P2/a")
    X_WT = RigidTransform(leading(np.array([0.0, 1.0, 0.0])), [0.0, 1.2, 0.3])
    line = PushLine(X_WT, np.array([0.0, 1.0, 0.0]), Stroke(0.07, 0.25, 2.5))
    assert not can_push(robot.station, "motor", line)
    with pytest.raises(PhaseFailed, match="no joint configuration carries"):
        robot.approach(line)


def test_hand_follows_the_line_at_the_speed_of_the_stroke_and_stops_dead() -> None:
    robot = hand("motor/P2", "motor/P2/a")
    seen, arm = robot.observer, bench("motor/P2", "motor/P2/a").cell.holder
    X_WP = pose_on_jig(robot.station, "motor", "+z", 0.0, 0.04)
    line = push_line(seen.stage, seen.root, PUSHES["motor/P2/a"], seen.X_WJ, X_WP)
    frame = arm.frame("tip")
    near = [("left_tool", "jig_base")]
    q = robot.station.configuration(arm, frame, line.X_WT, arm.home, near)
    seen.stage.plant.SetPositions(seen.context, arm.instance, q)
    (phase,) = push(robot.station, "motor", line)
    motion = phase.commands[arm.name]
    assert isinstance(motion, JointMotion)
    assert motion.duration == pytest.approx(line.stroke.duration)
    for t in (0.05, 0.2, line.stroke.duration):
        q, v = motion.at(t)
        distance, speed = line.stroke.at(t)
        X_WT = arm.tool_pose(seen.context, frame, q)
        assert X_WT.IsNearlyEqualTo(line.at(distance), 1e-5)
        later = arm.tool_pose(seen.context, frame, q + 1e-4 * v)
        moved = (later.translation() - X_WT.translation()) / 1e-4
        assert moved == pytest.approx(speed * line.direction, abs=1e-3)


def test_carriage_of_the_rig_is_as_stiff_as_the_arm() -> None:
    """What makes the two hands agree: how far each gives way under a force at the jig."""
    robot, chosen = hand("motor/P2", "motor/P2/a"), PUSHES["motor/P2/a"]
    seen, arm = robot.observer, bench("motor/P2", "motor/P2/a").cell.holder
    X_WP = pose_on_jig(robot.station, "motor", "+z", np.pi, 0.04)
    line = push_line(seen.stage, seen.root, chosen, seen.X_WJ, X_WP)
    near = [("left_tool", "jig_base")]
    q = robot.station.configuration(arm, arm.frame("tip"), line.X_WT, arm.home, near)
    seen.stage.plant.SetPositions(seen.context, arm.instance, q)
    jacobian = arm.jacobian(seen.context, arm.frame("tip"), np.zeros(3))
    compliance = np.diag(jacobian / np.array(arm.model.stiffness) @ jacobian.T)
    assert 1 / compliance[:3] == pytest.approx(TURN_DRIVE[0], rel=0.35)
    assert 1 / compliance[3:] == pytest.approx(SLIDE_DRIVE[0], rel=0.2)


def test_disturbances_are_those_of_the_rig() -> None:
    """The jig stands where the draw says; the planner believes neither jig nor part displaced."""
    config = CellConfig()
    draw = TrialDisturbance.draw(config, np.random.default_rng(3))
    robot = bench("motor/P2").begin(draw)
    p_WJ = robot.observer.X_WJ.translation() - np.array(config.workcell.p_WJ)
    assert p_WJ == pytest.approx([*draw.jig_offset, 0.0], abs=1e-9)
    robot.station.look()
    believed = robot.station.pose_of("motor")
    assert (believed @ draw.X_PDrawn).IsNearlyEqualTo(robot.observer.X_WP, 1e-9)


def test_robot_stands_the_motor_on_the_jig() -> None:
    """Picked, pressed with the force of the rule, frozen, let go: upright and at rest."""
    trial = run_trial(hand("motor/P2"), None)
    result = judged(Case(POSTURES["motor/P2"]), trial)
    assert result.success
    assert 0.010 < result.measured["depth_m"] < 0.022
    # The press ends at 20 N under the hand; the force plate's reading is averaged over 10 ms.
    assert 18 < result.measured["place_normal_peak_N"] < 24
    assert tilt_between(trial.planned, trial.held) < np.deg2rad(1.0)
    phases = list(trial.log["phase_name"])
    assert {"pick: lift", "press", "stop", "jam", "settle"} <= set(phases)
    assert not any(phase.startswith("pick") for phase in phases[phases.index("press") :])
    assert trial.log["time"][0] > trial.log["phase_start"][6]  # Nothing is recorded of the fetch.
