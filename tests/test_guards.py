"""Guards: which phases have which, what trips them, and what is said then."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from enum import Enum

import numpy as np
import pytest
from pydrake.math import RigidTransform
from teleport import phases_of, sensed_in

from cell import Cell, CellConfig, Simulation, load_product
from cell.machines.driver import DriverReading
from cell.machines.gripper import GripperReading
from cell.simulation.conditions import (
    All,
    Below,
    BitPushedIn,
    Height,
    PushesBack,
    Signal,
    Steady,
    WristForce,
)
from cell.simulation.phase import (
    Follow,
    Jaw,
    Phase,
    PhaseFailed,
    after,
    motion_finished,
    what_is_missing,
)
from experiments.assembly.prepare import RunningCell
from planning.assembly_plan.planner import plan
from planning.motion.timing import JointMotion
from planning.operations.grasping import LOST, HandPhase, check_lifted
from planning.operations.sequence import steps
from planning.operations.soft_hand import SOFT, TOO_MUCH
from planning.operations.tighten_bolts.servos import Clutch

ORDER = ("plate", "bolts", "motor")  # Every operation of an assembly has a step in it.
Seen = list[tuple[str, Phase, tuple[str, ...], float]]


class Kind(Enum):
    """Phases of the tests."""

    GO = "go"


@pytest.fixture(scope="module")
def running() -> RunningCell:
    return RunningCell(load_product("motor_unit"), CellConfig(), 0)


@pytest.fixture(scope="module")
def seen(running: RunningCell) -> Seen:
    """Return every phase of a whole assembly.

    With it come its operation, what is in the hand, and the opening of the jaws during it.
    """
    product, gripper = running.product, running.simulation.cell.gripper.name
    todo, found = steps(product, plan(product, ORDER)), []
    for step in todo:
        for phase, hand in phases_of(running, [step]):
            jaw = phase.commands.get(gripper)
            now = sensed_in(running).grippers[gripper].opening
            opening = jaw.opening if isinstance(jaw, Jaw) else now
            found.append((step.operation.name, phase, hand, opening))
    return found


def test_every_operation_of_an_assembly_is_there(seen: Seen) -> None:
    assert {name for name, *_ in seen} == {
        "pick_place",
        "place_loose_bolts",
        "set_aside",
        "insert_shaft",
        "tighten_bolts",
    }


def held(seen: Seen) -> Iterator[tuple[str, Phase, float]]:
    """Yield each phase through which a part has to stay in the grip, with the jaws' opening."""
    for _, phase, hand, opening in seen:
        if (hand and phase.kind is not HandPhase.RELEASE) or phase.kind is HandPhase.GRIP:
            yield phase.name, phase, opening


def test_grip_is_watched_from_the_grip_to_the_release_in_every_operation(
    seen: Seen, running: RunningCell
) -> None:
    """Jaws that close further than on the part have lost it; an elastic tenth of that is none."""
    gripper, watched = running.simulation.cell.gripper.name, 0
    for name, phase, at_grip in held(seen):
        assert phase.guard is not None, name
        for closer, lost in ((0.1 * LOST, False), (1.1 * LOST, True)):
            grippers = {gripper: GripperReading(at_grip - closer, 0.0)}
            evidence = phase.guard(sensed_in(running, grippers=grippers))
            assert (evidence is not None) == lost, name
            assert not lost or f"lost grasp: jaws at {1e3 * (at_grip - closer):.2f} mm" in str(
                evidence
            )
        watched += 1
    assert watched > 50


def test_force_is_watched_while_the_hand_is_soft(seen: Seen, running: RunningCell) -> None:
    soft = [phase for _, phase, *_ in seen if phase.kind in SOFT]
    assert len(soft) >= 2
    arm, gripper = running.simulation.cell.holder.name, running.simulation.cell.gripper.name
    for phase in soft:
        assert phase.guard is not None
        for force, failed in ((0.99 * TOO_MUCH, False), (1.01 * TOO_MUCH, True)):
            pushed = {arm: np.array([0.0, 0.0, 0.0, 0.6 * force, 0.0, 0.8 * force])}
            wide = {gripper: GripperReading(0.05, 0.0)}
            evidence = phase.guard(sensed_in(running, wrench=pushed, grippers=wide))
            assert evidence == (f"insertion force {force:.1f} N" if failed else None)


def test_every_phase_ends_in_time(seen: Seen) -> None:
    for _, phase, *_ in seen:
        assert 0.0 < phase.timeout < 60.0
        motions = [c for c in phase.commands.values() if isinstance(c, JointMotion)]
        assert all(motion.duration < phase.timeout for motion in motions), phase.name


# What is said.


def test_part_left_behind_is_a_lost_grasp_at_the_lift() -> None:
    """Jaws that slid off a part are as far apart as before."""
    in_hand = RigidTransform([0.1, 0.2, 0.3])
    check_lifted("motor", in_hand, RigidTransform([0.1, 0.205, 0.3]))
    with pytest.raises(PhaseFailed) as failed:
        check_lifted("motor", in_hand, RigidTransform([0.1, 0.2, 0.18]))
    assert failed.value.phase == "motor: lift"
    assert "lost grasp: the part is 120 mm" in failed.value.evidence


def test_what_a_condition_waits_for_is_said(running: RunningCell) -> None:
    cell = running.simulation.cell
    tip, driver = cell.holder.frame("tip"), cell.screwdriver.name
    torque = {driver: DriverReading(push=10.0, torque=0.69, speed=0.0)}
    sensed = sensed_in(running, drivers=torque)
    height = float(Height(tip)(sensed)[0])
    for condition, words in (
        (PushesBack("left", 20.0), "the left arm is pushed up with 0.0 N, not with 20 N"),
        (Signal("fixture fixed"), "no signal 'fixture fixed'"),
        (BitPushedIn(driver, 12.0), "the bit is pushed in with 10.0 N, not with 12 N"),
        (Clutch(driver, 2.0), "the spindle turns with 0.69 N m, not with 2 N m"),
        (Below(Height(tip), height - 0.004), "the tip is 4.00 mm too high"),
        (Steady(WristForce("left"), 0.2, 0.03), ""),
        (All((motion_finished, Signal("bolt_1 in bit"))), "no signal 'bolt_1 in bit'"),
        (after(1.0), ""),
    ):
        assert what_is_missing(condition, sensed) == words


def test_tool_is_pushed_back_by_a_force_that_points_up(running: RunningCell) -> None:
    for force, holds in ((19.9, False), (20.1, True), (-20.1, False)):
        felt = {"left": np.array([0.0, 0.0, 50.0, 50.0, 50.0, force])}
        assert PushesBack("left", 20.0)(sensed_in(running, wrench=felt)) == holds


def test_time_out_says_what_was_missing(motor_unit_cell: Cell) -> None:
    """And it comes in time."""
    simulation = Simulation(motor_unit_cell)
    phase = Phase(Kind.GO, PushesBack("left", 20.0), timeout=0.01, subject="motor")
    with pytest.raises(PhaseFailed) as failed:
        simulation.run_phase(phase)
    assert failed.value.phase == "motor: go"
    assert failed.value.evidence.startswith("end condition not met in 0.01 s: the left arm is")
    assert simulation.time == pytest.approx(0.01, abs=2.5 * simulation.time_step)


def test_vacuum_that_is_not_reached_is_named(motor_unit_cell: Cell) -> None:
    """A pump of 90 kPa with a time constant of 0.25 s is at 49.6 kPa after 0.2 s [D]."""
    start = (lambda running: running.cell.fixture.fix(running.root),)
    phase = Phase(Kind.GO, Signal("fixture fixed"), timeout=0.2, subject="motor", start=start)
    with pytest.raises(PhaseFailed) as failed:
        Simulation(motor_unit_cell).run_phase(phase)
    assert failed.value.phase == "motor: go"
    assert failed.value.evidence == (
        "end condition not met in 0.2 s: no signal 'fixture fixed': "
        "the vacuum is 49.7 kPa, not 85.5 kPa"
    )


@pytest.mark.parametrize("kind", ["motion", "servo"])
def test_controller_that_gives_no_number_is_named(motor_unit_cell: Cell, kind: str) -> None:
    """Before it makes the whole state not finite."""
    simulation, nothing = Simulation(motor_unit_cell), np.full(6, np.nan)
    home = motor_unit_cell.arms["left"].home
    motion = JointMotion(np.array([0.0, 1.0]), np.array([home, nothing]), np.zeros((2, 6)))
    command = motion if kind == "motion" else Follow(lambda sensed: (nothing, np.zeros(6)))
    phase = Phase(Kind.GO, after(0.1), 1.0, subject="motor", commands={"left": command})
    with pytest.raises(PhaseFailed) as failed:
        simulation.run_phase(phase)
    assert failed.value.phase == "motor: go"
    assert failed.value.evidence == "the command for the left arm is not finite"
    assert np.isfinite(simulation.cell.plant.GetPositions(simulation.context)).all()


# Where it happens in a run.


@pytest.mark.slow
def test_grip_that_is_too_weak_fails_at_the_lift() -> None:
    """Not a phase later, where the planner finds the part in the way."""
    from experiments.assembly.run import Run

    product = load_product("idler")
    post = product.parts["post"]
    weak = tuple(replace(grasp, force=0.02) for grasp in post.grasps)
    parts = {**product.parts, "post": replace(post, grasps=weak)}
    product = replace(product, parts=parts)
    run = Run(RunningCell(product, CellConfig(), 0))
    run.run(steps(product, plan(product))[:1])
    assert run.failure is not None
    assert run.failure.phase == "post: lift"
    assert "lost grasp" in run.failure.evidence
