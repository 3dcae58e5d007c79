"""What simulated time costs: classes of phases, start states, layers, and comparisons of ratios."""

from __future__ import annotations

import json
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from pydrake.math import RigidTransform

from cell import CellConfig, load_product
from cell.simulation.phase import (
    Command,
    Follow,
    Impedance,
    Jaw,
    Outcome,
    Phase,
    Sensed,
    Spin,
    after,
    motion_finished,
)
from experiments import speed_benchmark
from experiments.assembly.prepare import RunningCell
from experiments.campaigns.trial import Row
from experiments.regress import command
from experiments.speed.calibration import Kernel
from experiments.speed.layers import LAYERS, TimedMonitor, beginning, measure_phase, probe
from experiments.speed.meter import Meter, changes, ratios, slower
from experiments.speed.report import append_entry, latest_entry
from experiments.speed.whole_run import (
    Outdated,
    PhaseRun,
    make_whole_run,
    read_whole_run,
    resumed,
)
from planning.motion.timing import JointMotion
from planning.operations.operation import Operation, Step
from planning.operations.phase_class import PhaseClass, class_of
from planning.operations.station import Station

TICK = 0.02  # Length of the phases here [s].


class Kind(Enum):
    WAIT = "wait"
    CREEP = "creep"
    GO_ON = "go on"
    GRIP = "grip"


# Classes.


def motion() -> JointMotion:
    return JointMotion(np.array([0.0, TICK]), np.zeros((2, 6)), np.zeros((2, 6)))


def soft() -> Impedance:
    six = np.ones(6)
    return Impedance(cast(Any, None), RigidTransform(), lambda t: RigidTransform(), six, six)


PART, FIXED = frozenset(["bolt"]), frozenset(["bolt", "plate"])
FOLLOW = Follow(lambda sensed: (np.zeros(6), np.zeros(6)))


def felt(sensed: Sensed) -> bool:
    return False


@pytest.mark.parametrize(
    ("commands", "until", "awake", "in_hand", "expected"),
    [
        ({}, after(1.0), frozenset(), (), PhaseClass.DWELL),
        ({}, felt, PART, ("bolt",), PhaseClass.DWELL),
        ({"spindle": Spin(0.0)}, after(1.0), FIXED, (), PhaseClass.DWELL),
        ({"left": motion()}, motion_finished, frozenset(), (), PhaseClass.FREE),
        ({"left": motion(), "grip": Jaw(0.03)}, motion_finished, frozenset(), (), PhaseClass.FREE),
        ({"left": motion()}, motion_finished, PART, ("bolt",), PhaseClass.CARRYING),
        ({"left": motion()}, motion_finished, FIXED, ("bolt",), PhaseClass.CONTACT),
        ({"left": motion()}, felt, PART, ("bolt",), PhaseClass.CONTACT),
        ({"left": soft()}, motion_finished, PART, ("bolt",), PhaseClass.CONTACT),
        ({"right": FOLLOW, "spindle": Spin(3.0)}, felt, FIXED, (), PhaseClass.CONTACT),
        ({"grip": Jaw(0.01, 20.0)}, after(0.1), PART, (), PhaseClass.CONTACT),
        ({"left": motion()}, motion_finished, PART, (), PhaseClass.CONTACT),
    ],
)
def test_class_follows_from_what_moves_and_what_is_awake(
    commands: dict[str, Command], until: Any, awake: frozenset[str], in_hand: Any, expected: Any
) -> None:
    phase = Phase(Kind.WAIT, until, 1.0, commands=commands, awake=awake)
    assert class_of(phase, in_hand) is expected


# Ratios.


def test_ratio_is_time_in_units_of_the_kernel_of_the_same_run() -> None:
    """A machine that is twice as slow takes twice as long for the kernel, too."""
    fast, slow = Meter(), Meter()
    fast.add(PhaseClass.DWELL, 0.6, 0.5)
    fast.add(PhaseClass.DWELL, 0.4, 0.5)
    slow.add(PhaseClass.DWELL, 2.0, 1.0)
    slow.add(PhaseClass.CONTACT, 3.0, 0.5)
    assert ratios([(fast, 0.01)])["dwell"] == pytest.approx(100.0)
    found = ratios([(fast, 0.01), (slow, 0.02)])
    assert found == pytest.approx({"dwell": 100.0, "contact": 300.0})


def test_slower_is_more_than_fifteen_percent_and_only_where_stored() -> None:
    stored = {"free": 100.0, "dwell": 100.0, "contact": 100.0}
    now = {"free": 114.0, "dwell": 116.0, "contact": 50.0, "carrying": 1e3}
    assert slower(stored, now) == ["dwell"]
    assert changes(stored, now) == pytest.approx({"free": 0.14, "dwell": 0.16, "contact": -0.5})


def test_kernel_does_the_same_work_each_time() -> None:
    kernel = Kernel()
    ends = []
    for _ in range(2):
        assert kernel.time() > 0.0
        ends.append(kernel._plant.GetPositionsAndVelocities(kernel._context).copy())
    assert np.array_equal(*ends)
    results = kernel._plant.get_contact_results_output_port().Eval(kernel._context)
    assert results.num_hydroelastic_contacts() == 6  # Each box on what is below it.


@pytest.mark.parametrize(("now", "warned"), [(110.0, False), (130.0, True)])
def test_regress_warns_of_a_slower_class_and_does_not_fail(
    now: float, warned: bool, tmp_path: Path, monkeypatch: Any, capsys: pytest.CaptureFixture
) -> None:
    speeds = iter([{"contact": 100.0}, {"contact": now}])
    monkeypatch.setattr(command, "ratios", lambda _: next(speeds))
    row = Row("k", "hold", "motor_unit", 0, {}, {}, {}, "success", measured={"holding_N": 4.0})
    monkeypatch.setattr(command.Regression, "_run_trials", lambda *_: {"hold/standing": [row]})
    own = tmp_path / "own.json"
    for update in (True, False):
        wanted = command.Regression.of("quick", ["hold/standing"], own, update, config=CellConfig())
        assert wanted.run(tmp_path) == 0
    assert json.loads(own.read_text())["speed"] == {"contact": 100.0}
    assert ("Warning: 'contact' takes 30% more" in capsys.readouterr().out) is warned
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["verdict"] == "success"
    assert len(result["speed"]["warnings"]) == warned


def test_history_has_a_line_per_run_and_the_latest_of_the_product_counts(tmp_path: Path) -> None:
    history = tmp_path / "history.jsonl"
    assert latest_entry(history, "a") is None
    for product, number in (("a", 1), ("a", 2), ("b", 3)):
        append_entry(history, {"product": product, "number": number})
    assert latest_entry(history, "a") == {"product": "a", "number": 2}
    assert len(history.read_text().splitlines()) == 3


# Start states, and running phases again: on steps of four short phases.


@dataclass
class Creep:
    """A servo that remembers how far it has come."""

    q: np.ndarray
    calls: int = 0

    def __call__(self, sensed: Sensed) -> tuple[np.ndarray, np.ndarray]:
        self.calls += 1
        return self.q + 1e-5 * self.calls, np.zeros_like(self.q)


def carry_out(station: Station, step: Step) -> Generator[Phase, Outcome, None]:
    """Wait, creep with a servo, go on with it, and close the jaws on a part that is awake."""
    arm, gripper = station.holder, station.cell.gripper
    yield Phase(Kind.WAIT, after(TICK), 1.0)
    creep = Follow(Creep(arm.positions(station.context)))
    yield Phase(Kind.CREEP, after(TICK), 1.0, commands={arm.name: creep})
    yield Phase(Kind.GO_ON, after(TICK), 1.0, commands={arm.name: creep})
    jaw = {gripper.name: Jaw(0.0, 10.0)}
    awake = frozenset(["motor"])
    outcome = yield Phase(Kind.GRIP, after(TICK), 1.0, "motor", commands=jaw, awake=awake)
    station.held_opening = outcome.sensed.grippers[gripper.name].opening


def short_steps(*_: Any) -> list[Step]:
    operation = Operation("short", carry_out, lambda cell, record, log: {})
    return [Step("first", operation, ()), Step("second", operation, ())]


def twin(config: CellConfig | None = None, seed: int = 0) -> RunningCell:
    return RunningCell(load_product("motor_unit"), config or CellConfig(), seed)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Any, RunningCell]]:
    folder = tmp_path_factory.mktemp("states")
    running = twin()
    watched: list[PhaseRun] = []
    run = make_whole_run(folder, running, short_steps(), watched.append)
    assert watched == list(run.phases)
    yield run, running


def test_whole_run_is_read_back(made: Any) -> None:
    run, running = made
    assert read_whole_run(run.folder, running) == run
    classes = [phase.phase_class.value for phase in run.phases]
    assert classes == 2 * ["dwell", "free", "free", "contact"]
    assert [phase.sim_seconds for phase in run.phases] == pytest.approx(8 * [TICK])
    assert all(phase.cpu_seconds > 0.0 for phase in run.phases)


def test_states_of_another_seed_or_configuration_are_refused(made: Any) -> None:
    run, running = made
    with pytest.raises(Outdated, match="seed 0, not 1"):
        read_whole_run(run.folder, twin(seed=1))
    with pytest.raises(Outdated, match="no start states"):
        read_whole_run(run.folder / "none", running)
    other = twin(CellConfig().with_changes({"placement.press_force": 21.0}))
    with pytest.raises(Outdated, match="another configuration"):
        read_whole_run(run.folder, other)


def test_resumed_phase_ends_where_it_ended_in_the_whole_run(made: Any) -> None:
    """Bit by bit, with a servo that goes on from the phase before, too."""
    run, running = made
    wanted = [run.phases[k] for k in (1, 2)]
    for kept, phase in resumed(run, running, short_steps()[0], wanted):
        simulation = running.simulation
        simulation.run_phase(beginning(phase, TICK))
        end = run.state(kept.number + 1)
        assert np.array_equal(simulation.cell.plant.GetPositions(simulation.context), end["q"])


def test_resumed_refuses_an_operation_with_other_phases(made: Any) -> None:
    run, running = made

    def with_phases(*kinds: Kind) -> Step:
        def other(station: Station, step: Step) -> Iterator[Phase]:
            for kind in kinds:
                yield Phase(kind, after(TICK), 1.0)

        return Step("first", Operation("short", other, lambda cell, record, log: {}), ())

    for step, said in (
        (with_phases(Kind.WAIT, Kind.GRIP), "has 'grip' in place of 'creep'"),
        (with_phases(Kind.WAIT), "ends before its phase 'creep'"),
    ):
        with pytest.raises(Outdated, match=said):
            list(resumed(run, running, step, [run.phases[2]]))


# Layers.


def test_layers_add_up_and_leave_the_phase_as_it_was(made: Any) -> None:
    run, running = made
    simulation, station = running.simulation, running.station
    monitor = TimedMonitor(simulation.cell.monitor)
    simulation.simulator.set_monitor(monitor)
    (only,) = resumed(run, running, short_steps()[1], [run.phases[6]])
    servo = cast(Creep, cast(Follow, only[1].commands[station.holder.name]).target)
    calls = servo.calls
    cost = measure_phase(simulation, monitor, run.state(6), only[1], 0.01, 2, Kernel())
    assert servo.calls == calls > 0
    assert tuple(cost.layers) == LAYERS
    assert cost.total == pytest.approx(sum(cost.layers.values()))
    assert cost.layers["Python"] > 0.0 and cost.layers["solver"] > 0.0 and cost.kernel > 0.0


def test_probe_changes_nothing_and_finds_contact(made: Any) -> None:
    """The motor, awake on its tray, costs geometry that it does not cost asleep."""
    _, running = made
    simulation = running.simulation
    cell, parts = simulation.cell, simulation.cell.parts
    parts.sleep_all_but(simulation.root, ())
    asleep = min(probe(cell, simulation.root)[0] for _ in range(3))
    parts.sleep_all_but(simulation.root, ["motor"])
    simulation.step()
    time, q = simulation.root.get_time(), cell.plant.GetPositions(simulation.context).copy()

    def active() -> list[bool]:
        context, ids = simulation.context, cell.plant.GetConstraintIds()
        return [cell.plant.GetConstraintActiveStatus(context, constraint) for constraint in ids]

    before = active()
    assert min(probe(cell, simulation.root)[0] for _ in range(3)) > asleep
    assert simulation.root.get_time() == time
    assert np.array_equal(cell.plant.GetPositions(simulation.context), q)
    assert active() == before and any(before)


# The script.


def test_script_makes_states_once_and_compares_with_the_run_before(
    tmp_path: Path, monkeypatch: Any, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(speed_benchmark, "planned_steps", short_steps)
    options = ["--out", str(tmp_path), "--window", "0.01", "--repeats", "1"]
    assert speed_benchmark.main(options) == 0
    assert "The whole assembly is run" in capsys.readouterr().out
    assert speed_benchmark.main(options) == 0
    said = capsys.readouterr().out
    assert "The whole assembly is run" not in said and "Change against 20" in said
    result = json.loads((tmp_path / "speed.json").read_text())
    assert set(result["classes"]) == {"free", "dwell", "contact", "all"}
    whole = result["classes"]["all"]["whole_run"]
    assert whole["simulated_seconds"] == pytest.approx(8 * TICK)
    stood_for = [phase["stands_for_simulated_seconds"] for phase in result["phases"]]
    assert stood_for == pytest.approx(4 * [2 * TICK])
    assert (tmp_path / "speed.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / "history.jsonl").read_text().splitlines()) == 2
    # A single phase, which leaves the history as it is; with another configuration, anew.
    assert speed_benchmark.main([*options, "--phase", "grip", "--set", "driver.push_force=19"]) == 0
    assert "another configuration" in capsys.readouterr().out
    assert len((tmp_path / "history.jsonl").read_text().splitlines()) == 2


@pytest.mark.parametrize(
    ("options", "culprit"),
    [
        (["--window", "0"], "--window must be above 0"),
        (["--repeats", "0"], "--repeats must be from 1 to"),
        (["nosuch"], "nosuch"),
        (["--set", "simulation.time_stop=1"], "simulation.time_stop"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(
    options: list[str], culprit: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert speed_benchmark.main([*options, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert culprit in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()
