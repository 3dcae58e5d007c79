"""One cell at two time steps: the state is handed over, and the course goes on."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from pathlib import Path

import numpy as np
import pytest
from stories import JIG_STORY, QUICK, play_ours, small_product

from cell import CellConfig, Simulation, build_cell
from cell.fixtures.soft_jig import JigState, SoftJig
from cell.products.loading import load_product
from cell.simulation.phase import Phase, Running, SolverFailed, after
from cell.simulation.state import hand_over
from experiments.assembly.prepare import RunningCell
from experiments.assembly.replay import FRAME_PERIOD, Mirror, Replay
from experiments.assembly.run import Run
from planning.operations.insert_shaft import INSERT_SHAFT
from planning.operations.operation import Operation, Step
from planning.operations.pick_place import PICK_PLACE
from planning.operations.place_bolts import PLACE_BOLTS
from planning.operations.set_aside import SET_ASIDE
from planning.operations.station import Station
from planning.operations.tighten_bolts import TIGHTEN_BOLTS

LINKED = CellConfig()
FULL = LINKED.with_changes({"simulation.contact": "full"})
PRODUCT = load_product("motor_unit")


@pytest.fixture(scope="module")
def running() -> RunningCell:
    return RunningCell(PRODUCT, LINKED, seed=0)


def test_operations_that_allow_it_are_stepped_coarsely(running: RunningCell) -> None:
    fine = running.config.simulation.time_step
    for operation, factor in (
        (PICK_PLACE, 1),
        (INSERT_SHAFT, 2),
        (PLACE_BOLTS, 2),
        (SET_ASIDE, 2),
        (TIGHTEN_BOLTS, 1),
    ):
        running.switch(operation)
        assert running.simulation.time_step == factor * fine
        assert running.station.cell is running.simulation.cell


def test_one_planning_copy_serves_every_step_size(running: RunningCell) -> None:
    running.switch(PICK_PLACE)
    fine = running.station
    running.switch(PLACE_BOLTS)
    assert running.station is not fine
    assert running.station.model is fine.model


def test_full_contact_is_never_stepped_coarsely() -> None:
    running = RunningCell(PRODUCT, FULL, seed=0)
    before = running.simulation
    running.go_on(PLACE_BOLTS)
    assert running.simulation is before


def test_course_and_knowledge_go_on(running: RunningCell) -> None:
    """From a step at which no coarse one can begin, and back."""
    running.go_on()
    fine, station = running.simulation, running.station
    for _ in range(3):
        fine.step()
    fine.log.append(time=fine.time)
    station.look("motor")
    station.fixed, station.held_opening = ("motor",), 0.02
    running.go_on(PLACE_BOLTS)
    coarse = running.simulation
    assert coarse is not fine
    assert (fine.steps, coarse.steps, coarse.time) == (4, 2, fine.time)
    for of in (fine.cell.plant.GetPositions, fine.cell.plant.GetVelocities):
        theirs = getattr(coarse.cell.plant, of.__name__)
        assert np.array_equal(of(fine.context), theirs(coarse.context))
    assert coarse.log is fine.log
    assert running.station.fixed == ("motor",) and running.station.held_opening == 0.02
    assert running.station.pose_of("motor").IsExactlyEqualTo(station.pose_of("motor"))
    coarse.step()
    running.go_on()
    assert running.simulation is fine and fine.time == coarse.time


def test_frozen_bed_goes_on_holding() -> None:
    """Its link is given back, for its springs are made for a step, and is made anew."""
    config, product = QUICK, small_product("motor")
    source = play_ours(build_cell(config, product), JIG_STORY, 440)
    coarse = config.with_changes({"simulation.time_step": config.simulation.coarse_time_step})
    target = Simulation(build_cell(coarse, product))
    links = source.cell.links.memory(source.root)
    assert links.installed
    (linked,) = links.linked.values()
    hand_over(source, target)
    assert not target.cell.links.memory(target.root).installed
    assert isinstance(target.cell.fixture, SoftJig)
    assert target.cell.fixture.memory(target.root).state is JigState.JAMMED
    motor = target.cell.parts["motor"]
    before = motor.X_WP(target.context).translation()
    for _ in range(50):
        target.step()
    assert np.linalg.norm(motor.X_WP(target.context).translation() - before) < 2e-5
    memory = target.cell.links.memory(target.root)
    assert memory.installed
    assert memory.time == pytest.approx(target.time)
    (since,) = memory.linked.values()
    assert linked < since <= target.time


def test_what_is_drawn_follows_what_runs(tmp_path: Path) -> None:
    replay = Replay(view=False, file=tmp_path / "run.html")
    shown = RunningCell(PRODUCT, LINKED, seed=0, replay=replay)
    drawn = shown.simulation
    shown.go_on(PLACE_BOLTS)
    runs = shown.simulation
    runs.cell.plant.SetPositions(runs.context, runs.cell.plant.GetPositions(runs.context) + 1e-3)
    while runs.time < 1.5 * FRAME_PERIOD:
        runs.step()
    assert drawn.root.get_time() == pytest.approx(FRAME_PERIOD, abs=runs.time_step)
    mirror = Mirror(runs, drawn)
    mirror(runs.root)
    shown_q = drawn.cell.plant.GetPositions(drawn.context)
    assert np.array_equal(shown_q, runs.cell.plant.GetPositions(runs.context))


class MadeUp(Enum):
    """Phases of the test."""

    WAIT = "wait"


def test_operation_whose_coarse_steps_the_solver_rejects_is_repeated_with_fine_ones() -> None:
    tried = []

    def reject(simulation: Running) -> None:
        coarse = simulation.cell.config.simulation.time_step > 1e-3
        if coarse and simulation.time > 0.025:
            raise SolverFailed("wait", "solver failure: made up")

    def carry_out(station: Station, step: Step) -> Iterator[Phase]:
        tried.append(station.fixed)
        station.fixed = ("motor",)
        for _ in range(2):
            yield Phase(MadeUp.WAIT, after(0.02), 1.0, every_step=reject, fine_log=True)

    operation = Operation("made_up", carry_out, lambda *_: {}, coarse=True)
    run = Run(RunningCell(PRODUCT, LINKED, seed=0))
    run.run([Step("made up", operation, ("motor",))])
    assert tried == [(), ()]
    (result,) = run.steps
    assert (result.verdict, result.repeated, run.failure) == ("success", True, None)
    log = run.simulation.log.arrays()
    assert log["time"] == pytest.approx(np.arange(1, 41) * 1e-3)
    assert log["phase_start"].tolist() == [0.0, 0.02]
    assert run.simulation.time_step == 1e-3
