"""The assembly run: what it writes, how it fails, that it repeats, that it can be interrupted."""

import json
from collections.abc import Generator, Iterator
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from cell.configuration.config import CellConfig
from cell.errors import BadOrder, InputError
from cell.products.loading import load_product
from cell.products.product import Product
from cell.simulation.phase import Outcome, Phase, after
from cell.simulation.simulation import Simulation
from cell.simulation.state import State, read_state, restore_state, save_state
from cell.workpieces.parts import LoosePart
from experiments import shaft_insertion
from experiments.assembly.assemble import run_job
from experiments.assembly.job import Job
from experiments.assembly.prepare import Disturbance, RunningCell
from experiments.assembly.resume import go_on, resumable_state
from experiments.assembly.run import Run, StepResult
from planning.assembly_plan.planner import plan
from planning.operations import mating as mating_phases
from planning.operations.grasping import let_go
from planning.operations.insert_shaft import INSERT_SHAFT
from planning.operations.mating import goal_pose
from planning.operations.operation import Step, StepRecord
from planning.operations.pick_place import PICK_PLACE
from planning.operations.pick_place.phases import PlacePhase
from planning.operations.sequence import steps
from planning.operations.set_aside import SET_ASIDE
from planning.operations.snapshot import take_snapshot
from planning.operations.soft_hand import Mating
from planning.operations.station import Placement, Station
from planning.operations.tighten_bolts import TIGHTEN_BOLTS

PRODUCT = load_product("motor_unit")
CONFIG = CellConfig()
LOOSE = replace(PRODUCT, joints=tuple(PRODUCT.screws.values()))  # Without its fit.
PLACE = Step("place motor", PICK_PLACE, ("motor",))


class MadeUp(Enum):
    """Phases made up for a test."""

    LOOK = "look"
    WAIT = "wait"
    REST = "rest"


def job(out: Path, **changes: Any) -> Job:
    """Return a quiet assembly run."""
    return replace(Job(PRODUCT, None, CONFIG, 0, out, quiet=True), **changes)


def result_in(out: Path) -> dict[str, Any]:
    return json.loads((out / "result.json").read_text())


@pytest.mark.parametrize(
    ("product", "order", "evidence"),
    [
        (PRODUCT, ("motor", "bolts", "plate"), "blocked in all six directions"),
        (LOOSE, ("motor", "plate", "bolts"), "no joint between them"),
    ],
)
def test_order_that_cannot_be_carried_out_is_a_failure(
    product: Product,
    order: tuple[str, ...],
    evidence: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture,
) -> None:
    changes = dict(product=product, order=order, quiet=False)
    assert run_job(job(tmp_path, **changes)) == 1
    assert evidence in capsys.readouterr().out
    result = result_in(tmp_path)
    assert result["verdict"] == "failure"
    assert evidence in result["failure"]["evidence"]


def test_malformed_order_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(BadOrder):
        run_job(job(tmp_path, order=("motor",)))
    assert not list(tmp_path.iterdir())


def test_product_without_models_is_an_error(tmp_path: Path) -> None:
    bare = {name: replace(part, model=None) for name, part in PRODUCT.parts.items()}
    with pytest.raises(InputError, match="can be planned, but not assembled"):
        run_job(job(tmp_path, product=replace(PRODUCT, parts=bare)))
    assert not list(tmp_path.iterdir())


def test_part_out_of_reach_is_a_failure_with_evidence(tmp_path: Path) -> None:
    """Not bad input: the run says where it stopped, and leaves the state to look into."""
    far = replace(CONFIG.workcell, p_WT=(-0.28, 1.6, 0.03))
    (tmp_path / "report.html").write_text("of an earlier run")
    assert run_job(job(tmp_path, config=replace(CONFIG, workcell=far))) == 1
    result = result_in(tmp_path)
    assert result["failure"]["phase"] == "place motor: plan the next motion"
    assert "motor" in result["failure"]["evidence"]
    assert [step["verdict"] for step in result["steps"]] == ["failure"]
    assert "steps" in read_state(tmp_path / "failed_state.npz")
    assert "earlier run" not in (tmp_path / "report.html").read_text()


def test_disturbance_is_drawn_from_the_seed() -> None:
    """The tray moves with its parts; the planner's configuration stays as it is."""
    one, two = (Disturbance.draw(CONFIG, seed) for seed in (1, 2))
    assert one == Disturbance.draw(CONFIG, 1) != two
    draws = [Disturbance.draw(CONFIG, seed) for seed in range(400)]
    assert np.std([d.x for d in draws]) == pytest.approx(5e-4, rel=0.1)
    assert np.std([d.yaw_deg for d in draws]) == pytest.approx(1.0, rel=0.1)
    disturbed = one.applied_to(CONFIG)
    assert disturbed.workcell.p_WT[0] == CONFIG.workcell.p_WT[0] + one.x
    assert disturbed.workcell.tray_yaw_deg == CONFIG.workcell.tray_yaw_deg + one.yaw_deg
    assert replace(disturbed, workcell=CONFIG.workcell) == CONFIG


# With a cell.


@pytest.fixture
def run() -> Run:
    return Run(RunningCell(PRODUCT, CONFIG, seed=0))


def test_planner_does_not_know_the_disturbance(run: Run) -> None:
    """Parts rest where the tray really is; the planner keeps the tray's nominal pose."""
    X_WT = Disturbance.draw(CONFIG, 0).applied_to(CONFIG).workcell.X_WT
    part = PRODUCT.parts["motor"]
    assert part.X_TrayP is not None
    run.station.look()
    assert run.station.pose_of("motor").IsNearlyEqualTo(X_WT @ part.X_TrayP, 1e-5)
    assert run.station.config == CONFIG
    assert run.running.disturbance == Disturbance.draw(CONFIG, 0)


def test_phase_that_fails_stops_the_run(run: Run) -> None:
    """The saved state is the one at the start of the phase that failed."""

    def two_phases(station: Station, step: Step) -> Iterator[Phase]:
        yield Phase(MadeUp.LOOK, after(0.005), 1.0, subject="motor")
        yield Phase(MadeUp.WAIT, lambda sensed: False, timeout=0.01, subject="motor")

    failing = replace(PLACE, operation=replace(PICK_PLACE, carry_out=two_phases))
    run.run([failing, failing])
    assert run.failure is not None
    assert (run.verdict, len(run.steps)) == ("failure", 1)
    assert (run.failure.phase, run.failure.evidence) == (
        "motor: wait", "end condition not met in 0.01 s",
    )  # fmt: skip
    assert run.failure.state["steps"] == 5


def test_saved_state_of_another_order_is_refused(run: Run) -> None:
    todo = steps(PRODUCT, plan(PRODUCT))
    with pytest.raises(InputError, match="after insert plate; the plan begins with place motor"):
        go_on(run, todo, {"operations_done": np.array(["insert plate"])})


def test_run_that_goes_on_remembers_what_the_planner_knew(run: Run) -> None:
    """After the plate was set aside and the motor placed, in another process."""
    todo = steps(PRODUCT, plan(PRODUCT, ("plate", "bolts", "motor")))
    station = run.station
    station.look()
    run.steps = [
        StepResult(step.name, step.operation.name, "success", 1.0, 2.0, {"depth_m": 0.1}, ())
        for step in todo[:4]
    ]
    station.fixed, station.driven = ("motor",), ("bolt_1",)
    station.origins["plate"] = origin = station.pose_of("plate")
    station.placements["motor"] = Placement(0.3, origin, np.arange(6.0))
    again = Run(RunningCell(PRODUCT, CONFIG, seed=0))
    left = go_on(again, todo, resumable_state(run))
    assert again.steps == run.steps
    assert [step.operation.name for step in left] == ["insert_shaft", "tighten_bolts"]
    assert (again.station.fixed, again.station.driven) == (("motor",), ("bolt_1",))
    assert again.station.held is None
    assert again.station.origins["plate"].IsExactlyEqualTo(origin)
    assert again.station.placements["motor"].yaw == 0.3
    assert again.station.pose_of("bolt_6").IsExactlyEqualTo(station.pose_of("bolt_6"))


def test_motion_on_the_jig_counts_from_the_latest_placement(run: Run) -> None:
    """What was on the jig before has been taken off; a run may also begin with a part on it."""
    now = take_snapshot(run.simulation)
    ends = [replace(now, time=float(k)) for k in range(4)]
    operations = (PICK_PLACE, SET_ASIDE, PICK_PLACE, INSERT_SHAFT)
    run.records = [
        StepRecord(Step(operation.name, operation, ("plate",)), now, end=end)
        for operation, end in zip(operations, ends, strict=True)
    ]
    run.station.fixed = ("motor",)
    tighten = Step("tighten bolts", TIGHTEN_BOLTS, ("bolt_1",))
    assert run._record(tighten).placed is ends[2]
    run.records = run.records[3:]
    assert run._record(tighten).placed is now
    assert run._record(tighten).base == "motor"


def test_riders_are_planned_and_weighed_with_what_carries_them(run: Run) -> None:
    """On the hand, not in the way of it; nothing is left in it when it has let go."""
    station, riders = run.station, ("bolt_1", "bolt_2")
    station.look()
    station.carry("plate", riders)
    around = station.surroundings()
    assert set(around.X_HandP) == {"plate", *riders}
    assert not set(around.X_HandP) & set(around.X_WP)
    carried = station._payload()
    assert carried is not None
    assert carried.get_mass() == pytest.approx(
        sum(PRODUCT.parts[name].mass for name in station.in_hand)
    )
    grasp = PRODUCT.parts["plate"].grasps[0]
    pending = let_go(station, "plate", grasp, 0.02, frozenset())
    next(pending)
    next(pending)
    assert station.in_hand == ()


def some_phases(run: Run, count: int) -> Generator[Phase, Outcome, None]:
    """Yield the first phases of placing the motor."""
    pending = PLACE.phases(run.station)
    outcome: Outcome | None = None
    for _ in range(count):
        outcome = yield next(pending) if outcome is None else pending.send(outcome)


def test_same_seed_is_bit_identical(run: Run) -> None:
    """Planning with sampling included: look, approach, descend."""
    again = Run(RunningCell(PRODUCT, CONFIG, seed=0))
    for one in (run, again):
        one.simulation.run(some_phases(one, 3))
    log, other = run.simulation.log.arrays(), again.simulation.log.arrays()
    assert log.keys() == other.keys()
    assert all(np.array_equal(log[name], other[name]) for name in log)


# With a part on the jig.


@pytest.fixture(scope="module")
def placed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run that has placed the motor."""
    out = tmp_path_factory.mktemp("placed")
    assert run_job(job(out, command="pick_place", last=PICK_PLACE)) == 0
    return out


def test_motor_is_placed_as_planned(placed: Path) -> None:
    result = result_in(placed)
    (step,) = result["steps"]
    assert (result["verdict"], step["verdict"], step["failed_checks"]) == ("success", "success", [])
    assert result["command"] == "pick_place"
    measured = step["measured"]
    assert 19.0 < measured["press_force_peak_N"] < 22.0  # The force that ends the pressing is 20.
    assert 2e-3 < measured["depth_m"] < 18e-3  # To the terminals' tips, 6.3 mm below the can.
    assert measured["jam_kick_m"] < 1e-3
    assert measured["force_plate_peak_normal_N"] > 19.0


def test_placement_leaves_log_and_report(placed: Path) -> None:
    with np.load(placed / "log.npz") as log:
        rows = len(log["time"])
        assert all(len(log[name]) == rows for name in log.files if not name.startswith("phase_"))
        assert not [name for name in log.files if "cpu" in name or "wall" in name]
        assert f"motor: {PlacePhase.PRESS.value}" in log["phase_name"]
    page = (placed / "report.html").read_text()
    assert "place motor" in page
    assert "position error" in page
    assert "later grasps are planned around the place" in page, "the reason of its limit"


def test_interrupted_run_continues_bit_identically(placed: Path) -> None:
    """With the motor awake on the frozen bed, and a save in the middle."""
    awake = frozenset(["motor"])
    hold = Phase(MadeUp.REST, after(0.05), 1.0, subject="motor", awake=awake, fine_log=True)

    def rest(simulation: Simulation) -> State:
        simulation.run_phase(hold)
        return save_state(simulation)

    simulations = [RunningCell(PRODUCT, CONFIG, seed=0).simulation for _ in range(2)]
    restore_state(simulations[0], read_state(placed / "state.npz"))
    middle = rest(simulations[0])
    restore_state(simulations[1], middle)
    one, two = (rest(simulation) for simulation in simulations)
    assert one["steps"] == two["steps"]
    assert all(np.array_equal(one[name], two[name]) for name in one)


def kinetic_energy(part: LoosePart, context: Context) -> float:
    """Return V^T M V / 2 of a part [J]."""
    R_WP = part.X_WP(context).rotation()
    inertia = part.body.CalcSpatialInertiaInBodyFrame(context).ReExpress(R_WP)
    V_WP = part.velocity(context)
    return float(V_WP @ inertia.CopyToFullMatrix6() @ V_WP) / 2


def energies_at_rest(state: Path) -> list[float]:
    """Return the parts' kinetic energy [J] every 0.5 s for 5 s, after 0.5 s to come to rest.

    Every part is awake, in the tray and on the jig.
    """
    simulation = RunningCell(PRODUCT, CONFIG, seed=0).simulation
    restore_state(simulation, read_state(state))
    parts = list(simulation.cell.parts)
    awake = frozenset(part.part.name for part in parts)
    simulation.run_phase(Phase(MadeUp.WAIT, after(0.5), 1.0, awake=awake))
    energies = []
    for _ in range(10):
        simulation.run_phase(Phase(MadeUp.REST, after(0.5), 1.0, awake=awake))
        energies.append(sum(kinetic_energy(part, simulation.context) for part in parts))
    return energies


def assert_at_rest(energies: list[float]) -> None:
    """A nanojoule is 0.1 mm/s of the motor: the creep of contact regularisation is far below."""
    assert max(energies) < 1e-9
    assert max(energies[5:]) <= max(energies[:5]) + 1e-10


@pytest.mark.slow
def test_kinetic_energy_does_not_grow_once_a_part_is_placed(placed: Path) -> None:
    assert_at_rest(energies_at_rest(placed / "state.npz"))


@pytest.mark.slow
def test_whole_assembly_succeeds_and_rests(tmp_path: Path) -> None:
    assert run_job(job(tmp_path)) == 0
    result = result_in(tmp_path)
    kinds = [step["operation"] for step in result["steps"]]
    assert kinds == ["pick_place", "insert_shaft", "place_bolts", "tighten_bolts"]
    assert not [check for step in result["steps"] for check in step["failed_checks"]]
    assert_at_rest(energies_at_rest(tmp_path / "state.npz"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("product", "order"),
    [("motor_unit", ("plate", "bolts", "motor")), ("idler", None)],
)
def test_other_orders_and_products_succeed_by_the_same_code(
    product: str, order: tuple[str, ...] | None, tmp_path: Path
) -> None:
    assert run_job(job(tmp_path, product=load_product(product), order=order)) == 0
    steps = result_in(tmp_path)["steps"]
    assert not [check for step in steps for check in step["failed_checks"]]
    if order is not None:
        assert "set_aside" in [step["operation"] for step in steps]


@pytest.mark.slow
def test_search_finds_a_shaft_that_is_not_where_the_sensor_says(
    placed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """3 mm are beyond what the edge breaks catch (1 mm) and the soft hand yields (about 1 mm)."""

    def misplaced(station: Station, mating: Mating) -> RigidTransform:
        return RigidTransform([3e-3, 0.0, 0.0]) @ goal_pose(station, mating)

    monkeypatch.setattr(mating_phases, "goal_pose", misplaced)
    arguments = ["--start", str(placed / "state.npz"), "--quiet", "--out", str(tmp_path)]
    assert shaft_insertion.main(arguments) == 0
    measured = result_in(tmp_path)["steps"][-1]["measured"]
    assert measured["searched"] == 1.0
