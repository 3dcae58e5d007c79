"""Motion planning: paths avoid what is in the way, motions keep the limits, seeds decide all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planning_cell import P_WJ, TOOL_DOWN, planning_cell
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.tree import SpatialInertia

from cell.errors import RunFailure, UnknownName
from cell.machines.arms import ARM_MODELS, ArmModel
from planning.motion import timing
from planning.motion.collision_model import CollisionModel, Surroundings
from planning.motion.joint_path import JointPath
from planning.motion.paths import NoPath, plan_line, plan_path
from planning.motion.timing import JointMotion, NoTiming, Pace, SpeedLimit, time_path
from planning.motion.together import delayed_beside, keep_apart

SPEED, ACCELERATION, RAMP = 0.3, 4.0, 0.04
PACE = Pace(SPEED, ACCELERATION, wrist_force=100.0, ramp_time=RAMP)


@pytest.fixture(scope="module")
def shared() -> CollisionModel:
    return planning_cell()


@pytest.fixture
def model(shared: CollisionModel) -> CollisionModel:
    shared.arrange(Surroundings())
    return shared


def reach(
    model: CollisionModel, name: str, frame: str, p_WT: list[float], near: np.ndarray | None = None
) -> np.ndarray:
    arm = model.arms[name]
    X_WT = RigidTransform(TOOL_DOWN, p_WT)
    near = arm.home if near is None else near
    ways = arm.configurations(model.context, arm.frame(frame), X_WT, near)
    return next(q for q in ways if model.is_free(name, q))


def timed(model: CollisionModel, path: JointPath, **changes: float) -> JointMotion:
    return time_path(model.arms["left"], model.context, path, replace(PACE, **changes))


def wall(model: CollisionModel) -> tuple[Surroundings, np.ndarray, np.ndarray]:
    """The other arm reaches over the jig, between start and goal of this one."""
    q_right = reach(model, "right", "mount", [0.0, 0.15, 0.55])
    surroundings = Surroundings(arms={"right": q_right})
    model.arrange(surroundings)
    q_start = reach(model, "left", "tip", [0.0, 0.40, 0.35])
    q_goal = reach(model, "left", "tip", [0.0, -0.15, 0.35], near=q_start)
    return surroundings, q_start, q_goal


def test_home_is_free_and_inside_the_table_is_not(model: CollisionModel) -> None:
    for name, arm in model.arms.items():
        assert model.is_free(name, arm.home)
        assert model.collisions(name, arm.home) == ()
    into_table = np.deg2rad([0, 20, 0, 0, 0, 0])
    assert not model.is_free("left", into_table)
    assert any("table" in pair for pair in model.collisions("left", into_table))


def test_loose_part_is_in_the_way_where_it_stands_and_nowhere_else(model: CollisionModel) -> None:
    q = reach(model, "left", "tip", [0.0, 0.15, 0.35])
    for z, free in ((0.32, False), (1.5, True)):
        model.arrange(Surroundings(X_WP={"motor_plate": RigidTransform([0.0, 0.15, z])}))
        assert model.is_free("left", q) == free
    assert model.part_names == ("motor", "motor_plate")


def test_held_part_moves_with_the_hand_and_is_checked(model: CollisionModel) -> None:
    """A motor that hangs 54 mm below the jaws meets the jig base before the empty hand does."""
    low = reach(model, "left", "tip", [P_WJ[0], P_WJ[1], P_WJ[2] + 0.04])
    high = reach(model, "left", "tip", [P_WJ[0], P_WJ[1], P_WJ[2] + 0.10])
    hanging = RigidTransform(RollPitchYaw(np.pi, 0, 0), [0.0, 0.0, 0.0])
    model.arrange(Surroundings(X_HandP={"motor": hanging}, tools={"left_tool": [0.02, 0.02]}))
    assert model.is_free("left", high)
    assert not model.is_free("left", low)
    assert any(pair.startswith("held - jig_base") for pair in model.collisions("left", low))


def test_held_part_may_touch_its_own_gripper_but_not_the_other_arm(model: CollisionModel) -> None:
    held = {"motor": RigidTransform()}
    q_left = reach(model, "left", "tip", [0.0, 0.15, 0.40])
    q_right = reach(model, "right", "mount", [0.0, 0.15, 0.55])
    model.arrange(Surroundings(X_HandP=held))
    assert model.is_free("left", q_left)
    model.arrange(Surroundings(X_HandP=held, arms={"right": q_right}))
    assert any("right_tool" in pair and "held" in pair for pair in model.collisions("left", q_left))


def test_allowed_pairs_are_not_checked(model: CollisionModel) -> None:
    at_plate = {"motor_plate": RigidTransform([0.0, 0.15, 0.35])}
    q = reach(model, "left", "tip", [0.0, 0.15, 0.35])
    model.arrange(Surroundings(X_WP=at_plate, may_touch=[("left_tool", "motor_plate")]))
    assert model.is_free("left", q)
    model.arrange(Surroundings(X_WP=at_plate, may_touch=[("*", "motor_plate")]))
    assert model.is_free("left", q)
    with pytest.raises(UnknownName, match="Did you mean 'motor_plate'"):
        model.arrange(Surroundings(may_touch=[("left_tool", "motor_plat")]))


def test_obstacle_clearance_can_be_narrowed(model: CollisionModel) -> None:
    q = reach(model, "left", "tip", [0.0, 0.15, P_WJ[2] + 0.04])
    for clearance, free in ((0.05, False), (0.0, True)):
        model.arrange(Surroundings(obstacle_clearance=clearance))
        assert model.is_free("left", q) == free


def test_unknown_part_is_named(model: CollisionModel) -> None:
    with pytest.raises(UnknownName, match="motor_plate"):
        model.arrange(Surroundings(X_WP={"gear": RigidTransform()}))


def test_free_way_is_straight(model: CollisionModel) -> None:
    q_start = model.arms["left"].home
    q_goal = reach(model, "left", "tip", [0.0, 0.15, 0.35])
    path = plan_path(model, "left", q_start, q_goal, seed=0, max_iterations=10)
    np.testing.assert_array_equal(path.waypoints, [q_start, q_goal])


def test_path_leads_around_the_other_arm(model: CollisionModel) -> None:
    _, q_start, q_goal = wall(model)
    assert not model.is_edge_free("left", q_start, q_goal)
    path = plan_path(model, "left", q_start, q_goal, seed=0, max_iterations=5000)
    np.testing.assert_allclose(path.waypoints[[0, -1]], [q_start, q_goal], atol=1e-12)
    # Denser than the planner itself looks.
    assert all(model.is_free("left", q) for q in path.samples(0.01))


def test_same_seed_gives_the_same_path_and_another_seed_another(model: CollisionModel) -> None:
    _, q_start, q_goal = wall(model)
    paths = [
        plan_path(model, "left", q_start, q_goal, seed=seed, max_iterations=5000)
        for seed in (3, 4, 3)
    ]
    np.testing.assert_array_equal(paths[0].waypoints, paths[2].waypoints)
    assert not np.array_equal(paths[0].waypoints, paths[1].waypoints)


def test_blocked_goal_names_what_collides(model: CollisionModel) -> None:
    home, goal = model.arms["left"].home, np.deg2rad([0, 20, 0, 0, 0, 0])
    with pytest.raises(NoPath, match="the goal collides .*table") as caught:
        plan_path(model, "left", home, goal, seed=0, max_iterations=100)
    assert caught.value.evidence


def test_search_stops_after_its_iterations(model: CollisionModel) -> None:
    _, q_start, q_goal = wall(model)
    with pytest.raises(NoPath, match="none in 2 iterations"):
        plan_path(model, "left", q_start, q_goal, seed=0, max_iterations=2)


def test_line_is_straight_and_ends_at_the_goal(model: CollisionModel) -> None:
    arm, tip = model.arms["left"], model.arms["left"].frame("tip")
    q_start = reach(model, "left", "tip", [0.0, 0.15, 0.32])
    X_WGoal = RigidTransform(RollPitchYaw(np.pi, 0.0, 0.5), [0.05, 0.15, 0.24])
    path = plan_line(arm, model.context, tip, q_start, X_WGoal)
    end = arm.tool_pose(model.context, tip, path.waypoints[-1])
    assert end.IsNearlyEqualTo(X_WGoal, 1e-6)
    direction = np.array([0.05, 0.0, -0.08]) / np.linalg.norm([0.05, 0.0, -0.08])
    for q in timed(model, path).q[::10]:
        offset = arm.tool_pose(model.context, tip, q).translation() - [0.0, 0.15, 0.32]
        aside = offset - direction * (offset @ direction)
        assert np.linalg.norm(aside) < 5e-5


def test_line_through_a_collision_or_out_of_reach_is_refused(model: CollisionModel) -> None:
    arm, tip = model.arms["left"], model.arms["left"].frame("tip")
    q_start = reach(model, "left", "tip", [0.0, 0.15, 0.32])
    with pytest.raises(NoPath, match="collision at .* % of the straight line of 'tip'"):
        plan_line(
            arm,
            model.context,
            tip,
            q_start,
            RigidTransform(TOOL_DOWN, [0.0, 0.15, 0.15]),
            is_free=lambda q: model.is_free("left", q),
        )
    with pytest.raises(Exception, match="out of reach at"):
        plan_line(arm, model.context, tip, q_start, RigidTransform(TOOL_DOWN, [0.9, 0.15, 0.3]))


def test_rounded_corner_stays_near_and_is_smooth() -> None:
    waypoints = np.zeros((3, 6))
    waypoints[1, 0], waypoints[2, :2] = 1.0, 1.0
    path = JointPath.through(waypoints, radius=0.2)
    curve = path.curve()
    assert curve.end_time() == pytest.approx(path.length)
    np.testing.assert_allclose(curve.value(curve.end_time())[:, 0], waypoints[2], atol=1e-12)
    for s in curve.get_segment_times()[1:-1]:
        before, after = curve.EvalDerivative(s - 1e-9), curve.EvalDerivative(s + 1e-9)
        np.testing.assert_allclose(before, after, atol=1e-6)
    nearest = np.linalg.norm(path.samples(0.001) - waypoints[1], axis=1).min()
    assert 0 < nearest <= 0.1


def test_motion_keeps_speed_and_acceleration_limits_and_rests_at_both_ends(
    model: CollisionModel,
) -> None:
    _, q_start, q_goal = wall(model)
    path = plan_path(model, "left", q_start, q_goal, seed=0, max_iterations=5000)
    motion = timed(model, path)
    assert (np.abs(motion.v) <= SPEED * np.pi * 1.01).all()
    acceleration = np.diff(motion.v, axis=0) / np.diff(motion.time)[:, None]
    assert (np.abs(acceleration) <= ACCELERATION * 1.03).all()
    # Limits are what holds it back: some joint is at its limit but for the ramps.
    busy = np.maximum(
        np.abs(motion.v[1:]).max(axis=1) / (SPEED * np.pi),
        np.abs(acceleration).max(axis=1) / ACCELERATION,
    )
    assert (busy > 0.97).mean() > 0.9
    np.testing.assert_array_equal(motion.v[[0, -1]], 0.0)
    np.testing.assert_allclose(motion.q[[0, -1]], [q_start, q_goal], atol=1e-9)


def test_motion_between_samples_is_continuous(model: CollisionModel) -> None:
    q_goal = reach(model, "left", "tip", [0.0, 0.15, 0.35])
    path = JointPath.through(np.array([model.arms["left"].home, q_goal]), 0.1)
    motion = timed(model, path)
    times = np.linspace(-0.1, motion.duration + 0.1, 2000)
    q, v = (np.array(values) for values in zip(*(motion.at(t) for t in times), strict=True))
    slope = np.gradient(q, times, axis=0)
    assert np.abs(slope - v).max() < 0.02
    np.testing.assert_array_equal(motion.at(motion.duration + 1)[0], motion.q[-1])
    np.testing.assert_array_equal(motion.at(-1.0)[0], motion.q[0])


def test_acceleration_rises_and_falls_over_the_ramp_time(model: CollisionModel) -> None:
    """What comes to rest without a jerk does not swing, and a wrist can be tared at once."""
    q_goal = reach(model, "left", "tip", [0.0, 0.15, 0.35])
    path = JointPath.through(np.array([model.arms["left"].home, q_goal]), 0.1)
    motion = timed(model, path)
    acceleration = np.gradient(motion.v, motion.time, axis=0)
    jerk = np.diff(acceleration, axis=0) / np.diff(motion.time)[:, None]
    assert np.abs(jerk).max() < 2.1 * ACCELERATION / RAMP  # From one limit to the other.
    assert np.abs(acceleration[[0, -1]]).max() < 0.2 * ACCELERATION
    shorter = timed(model, path, ramp_time=RAMP / 4)
    assert motion.duration - shorter.duration == pytest.approx(0.75 * RAMP, abs=1e-6)


def test_wrist_force_limits_how_hard_the_tool_is_thrown_about(model: CollisionModel) -> None:
    arm = model.arms["left"]
    q_goal = reach(model, "left", "tip", [0.0, 0.15, 0.35])
    path = JointPath.through(np.array([arm.home, q_goal]), 0.1)
    bodies = model.plant.GetBodyIndices(arm.tool_instance)
    mass = sum(model.plant.get_body(i).default_mass() for i in bodies)

    def hardest(limit: float) -> float:
        motion = timed(model, path, velocity_scale=1.0, acceleration_limit=50.0, wrist_force=limit)
        context = model.plant.CreateDefaultContext()
        places = []
        for q in motion.q:
            model.plant.SetPositions(context, arm.instance, q)
            places.append(model.plant.CalcCenterOfMassPositionInWorld(context, [arm.tool_instance]))
        h = motion.time[1]
        return float(mass * np.abs(np.diff(places, 2, axis=0)).max() / h**2)

    assert hardest(1e4) > 6.0
    assert 2.5 < hardest(3.0) < 3.3


def test_speed_limit_of_the_tool_holds_on_a_line_and_is_used(model: CollisionModel) -> None:
    arm, tip = model.arms["left"], model.arms["left"].frame("tip")
    q_start = reach(model, "left", "tip", [0.0, 0.15, 0.42])
    path = plan_line(arm, model.context, tip, q_start, RigidTransform(TOOL_DOWN, [0.0, 0.15, 0.30]))
    motion = time_path(arm, model.context, path, PACE, tool_limit=SpeedLimit(tip, 0.1))
    places = [arm.tool_pose(model.context, tip, q).translation() for q in motion.q]
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(motion.time)
    assert speed.max() < 0.102
    assert (speed > 0.098).mean() > 0.6


def test_torque_limits_slow_a_loaded_arm_and_refuse_what_it_cannot_carry(
    model: CollisionModel,
) -> None:
    """UR5e wrists carry 28 N m: a lump 0.2 m beside the flange costs 2 N m a kilogram."""
    q_goal = reach(model, "left", "tip", [0.0, 0.15, 0.35])
    path = JointPath.through(np.array([model.arms["left"].home, q_goal]), 0.1)
    arm = model.arms["left"]

    def run(mass: float) -> JointMotion:
        lump = SpatialInertia.SolidSphereWithMass(mass, 0.05).Shift([-0.2, 0.0, 0.0])
        return time_path(
            arm,
            model.context,
            path,
            Pace(1.0, 300.0, wrist_force=1e4, ramp_time=1e-3),
            payload=lump,
        )

    assert run(5.0).duration > 1.05 * run(0.1).duration
    with pytest.raises(NoTiming, match="left arm"):
        run(30.0)


def test_shapes_left_out_of_the_arm_change_no_motion(
    model: CollisionModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the time to read its model."""
    home = model.arms["left"].home
    path = JointPath(np.array([home, home + 0.4]), np.zeros(2))
    text, _ = timing._without_shapes(model.arms["left"].model.sdf) or ("", "")
    assert "<inertia>" in text and "<geometry>" not in text
    quick = timed(model, path)
    monkeypatch.setattr(timing, "_without_shapes", lambda model: None)
    whole = timed(model, path)
    assert np.array_equal(quick.q, whole.q) and np.array_equal(quick.time, whole.time)


def test_standing_still_takes_no_time(model: CollisionModel) -> None:
    home = model.arms["left"].home
    path = plan_path(model, "left", home, home, seed=0, max_iterations=10)
    motion = timed(model, path)
    assert motion.duration == 0.0
    np.testing.assert_array_equal(motion.at(0.0)[0], home)


@pytest.mark.parametrize("kind", ARM_MODELS.values(), ids=lambda arm: arm.name)
@pytest.mark.parametrize("gripper", ["hand_e", "gripper_85"])
def test_every_arm_with_every_gripper_plans_and_times_its_way(kind: ArmModel, gripper: str) -> None:
    """Sideways around, then straight down, from where it waits."""
    model = planning_cell(kind, gripper)
    arm = model.arms["left"]
    tip = arm.frame("tip")
    assert model.is_free("left", arm.home), model.collisions("left", arm.home)
    X_WHome = arm.tool_pose(model.context, tip, arm.home)
    X_WOver = RigidTransform(X_WHome.rotation(), X_WHome.translation() + [0.0, 0.15, 0.0])
    ways = arm.configurations(model.context, tip, X_WOver, arm.home)
    q_over = next(q for q in ways if arm.model.is_regular(q) and model.is_free("left", q))
    assert np.abs(q_over - arm.home).max() < 1.0
    path = plan_path(model, "left", arm.home, q_over, seed=0, max_iterations=1000)
    down = RigidTransform(X_WHome.rotation(), X_WOver.translation() - [0.0, 0.0, 0.05])
    line = plan_line(arm, model.context, tip, q_over, down)
    assert arm.tool_pose(model.context, tip, line.waypoints[-1]).IsNearlyEqualTo(down, 1e-6)
    speed = SPEED * np.array([link.speed for link in kind.links])
    for motion in (timed(model, path), timed(model, line)):
        assert motion.q.shape[1] == kind.dof
        assert (np.abs(motion.v) <= speed * 1.01).all()


def crossing(model: CollisionModel) -> dict[str, JointMotion]:
    """The left hand waits, then leaves the place over the jig to which the right one comes."""
    left, right = model.arms["left"], model.arms["right"]
    over = {
        "left": reach(model, "left", "tip", [0.0, 0.15, 0.40]),
        "right": reach(model, "right", "mount", [0.0, 0.15, 0.55]),
    }
    ways = {"left": [over["left"], left.home], "right": [right.home, over["right"]]}
    motions = {
        name: time_path(
            model.arms[name], model.context, JointPath.through(np.array(way), 0.1), PACE
        )
        for name, way in ways.items()
    }
    return motions | {"left": motions["left"].delayed(4.0)}


def test_arm_waits_until_the_way_is_clear_and_no_longer(model: CollisionModel) -> None:
    motions = crossing(model)
    assert not keep_apart(model, motions), "both at once"
    late = delayed_beside(model, "right", motions["right"], {"left": motions["left"]})
    wait = late.duration - motions["right"].duration
    assert 0.0 < wait < motions["left"].duration, "some of the time they move together"
    assert keep_apart(model, {"left": motions["left"], "right": late})
    sooner = motions["right"].delayed(wait - 0.05)
    assert not keep_apart(model, {"left": motions["left"], "right": sooner})
    np.testing.assert_array_equal(late.at(wait / 2)[0], motions["right"].q[0])
    for t in (0.1, 0.5):
        np.testing.assert_allclose(late.at(wait + t), motions["right"].at(t), atol=1e-9)


def test_arms_that_never_meet_start_together(model: CollisionModel) -> None:
    motions = crossing(model)
    home = model.arms["left"].home
    away = JointMotion(np.array([0.0, 1.0]), np.array([home, home]), np.zeros((2, 6)))
    assert delayed_beside(model, "right", motions["right"], {"left": away}) is motions["right"]


def test_arm_that_ends_where_another_one_stands_finds_no_moment(model: CollisionModel) -> None:
    motions = crossing(model)
    stays = JointMotion(np.array([0.0, 1.0]), motions["left"].q[[0, 0]], np.zeros((2, 6)))
    with pytest.raises(NoPath, match="meets the left arm"):
        delayed_beside(model, "right", motions["right"], {"left": stays})


def test_failures_are_failures_of_the_run(model: CollisionModel) -> None:
    arm = model.arms["left"]
    with pytest.raises(RunFailure):
        plan_line(arm, model.context, arm.frame("tip"), arm.home, RigidTransform([0, 0, 9.0]))
