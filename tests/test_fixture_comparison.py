"""The comparison of fixtures: no trial is lost, and its tables say what the trials say."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow.parquet as parquet
import pytest

from cell import CellConfig
from cell.errors import UnknownName
from experiments.campaigns import campaign, points
from experiments.campaigns.assembly import assemble
from experiments.campaigns.executors import WorkerDied
from experiments.campaigns.run_trial import row_of
from experiments.campaigns.store import trial_file, write_trial
from experiments.campaigns.trial import Outcome, Row, Task, Trial
from experiments.fixture_comparison import RESULT, main
from experiments.fixtures import products
from experiments.fixtures.accuracy import accuracy
from experiments.fixtures.bearing import bearing, quantity_of
from experiments.fixtures.effort import effort
from experiments.fixtures.page import PAGE
from experiments.fixtures.plan import Extent, Line, lines_of
from experiments.fixtures.products import selected, source_of
from experiments.paper.holding import LOADS
from experiments.paper.trial_tasks import FIT, place
from experiments.reporting.statistics import wilson

ONE_CASE = ("--products", "motor_unit", "--case", "plate/P1", "--trials", "2", "--quiet")
LINES, TRIALS = 7, 3 * 2 + 7 * 2  # Effort and bearing of three fixtures, 2 placements of each line.


def lines(**extent: Any) -> list[Line]:
    extent = {"case": "plate/P1", "trials": 2} | extent
    return lines_of({"unit": "motor_unit"}, CellConfig.load(), Extent(**extent))


# ---- What is run


def test_every_line_has_its_own_trials() -> None:
    found = lines()
    keys = [trial.key for line in found for trial in line.trials]
    assert (len(found), len(keys), len(set(keys))) == (LINES, TRIALS, TRIALS)
    assert [(line.fixture, line.larger_m) for line in found] == [
        ("soft_jig", 0.0),
        *[(name, size) for name in ("support_jig", "rigid_jig") for size in (0.0, 1e-4, 3e-4)],
    ]
    for line in found:
        assert all(trial.config.workcell.fixture == line.fixture for trial in line.trials)
        assert [trial.seed for trial in line.accuracy] == [0, 1]
        assert [trial.options["larger_m"] for trial in line.accuracy] == [line.larger_m] * 2
        assert all(t.config.push.grasp_position_sigma == 1e-3 for t in line.accuracy)
        assert len(line.effort) == len(line.bearing) == (line.larger_m == 0.0)


def test_what_was_done_is_used_again_for_more_trials_and_other_seeds() -> None:
    few = {trial.key for line in lines() for trial in line.trials}
    assert few < {trial.key for line in lines(trials=3) for trial in line.trials}
    later = {trial.key for line in lines(seed=1) for trial in line.trials}
    # One placement of each line, and all of what is not random.
    assert len(few & later) == LINES + 2 * 3


def test_pulls_and_assemblies_are_a_choice() -> None:
    assert not any(line.bearing or line.assembly for line in lines(pulls=False))
    *_, soft, posts, nest = lines(assemblies=2)
    for line, name in ((soft, "soft_jig"), (posts, "support_jig"), (nest, "rigid_jig")):
        assert (line.fixture, line.case, len(line.trials)) == (name, "", 2)
        assert {trial.experiment for trial in line.trials} == {"assemble"}
        assert {trial.config.workcell.fixture for trial in line.trials} == {name}


@pytest.mark.parametrize("trial", [effort, accuracy, bearing])
def test_part_that_cannot_be_held_is_a_verdict(
    trial: Callable[..., Outcome], tmp_path: Path
) -> None:
    nest = CellConfig.load(overrides=["workcell.fixture=rigid_jig"])
    outcome = trial(Task("motor_unit", nest, 0, tmp_path), case="motor/P1")
    assert (outcome.success, outcome.phase, dict(outcome.measured)) == (False, FIT, {})
    assert "has no datum faces" in outcome.evidence
    with pytest.raises(UnknownName, match="motor/P9"):
        trial(Task("motor_unit", nest, 0, tmp_path), case="motor/P9")


def test_plan_that_a_fixture_cannot_hold_is_a_verdict_on_the_assembly(tmp_path: Path) -> None:
    nest = CellConfig.load(overrides=["workcell.fixture=rigid_jig"])
    outcome = assemble(Task("motor_unit", nest, 0, tmp_path), order="plate,bolts,motor")
    assert (outcome.success, outcome.phase) == (False, "plan")
    assert "fixes plate, then motor, and a rigid_jig holds one part" in outcome.evidence


# ---- The campaign, with trials that take no time


class AtOnce(Executor):
    """Carries out a task when it is submitted, in this process."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return a future that is done."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Trials:
    """What the campaign runs instead of simulations.

    Attributes:
        ran: Keys, in order.
        stop_after: Number of trials after which Ctrl-C is pressed; None: never.
        kill: Numbers of trials whose process is killed.
    """

    def __init__(self) -> None:
        self.ran: list[str] = []
        self.stop_after: int | None = None
        self.kill: set[int] = set()

    def run(self, trial: Trial, out: Path) -> Row:
        """Write the row of a trial, as `experiments.campaigns.run_trial.run_trial` does."""
        if len(self.ran) == self.stop_after:
            raise KeyboardInterrupt
        self.ran.append(trial.key)
        if len(self.ran) in self.kill:
            raise WorkerDied("its process was ended by SIGKILL")
        row = row_of(trial, "success", outcome_of(trial), 1.0, "", out)
        write_trial(out, row)
        return row


def outcome_of(trial: Trial) -> Outcome:
    """Return an outcome from which it can be seen which trial it is of."""
    kind = trial.experiment.rpartition(":")[2]
    if kind == "effort":
        return Outcome(True, {"posts_to_set": 4.0, "fixing_s": 2.0, "step_cpu_s": 1e-3})
    if kind == "bearing":
        moved = {f"{load.replace(' ', '_')}_moved": 1.0 for load in LOADS}
        return Outcome(True, {quantity_of(load): 3.0 for load in LOADS} | moved)
    error = 1e-3 * (1 + trial.seed) + trial.options.get("larger_m", 0.0)
    measured = {"upright": 1.0, "position_error_m": error, "orientation_error_rad": 0.1}
    return Outcome(True, measured if kind == "accuracy" else {})


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Trials:
    trials = Trials()

    @contextmanager
    def pool_at(address: str, workers: int) -> Iterator[Executor]:
        yield AtOnce()

    monkeypatch.setattr(campaign, "pool_at", pool_at)
    monkeypatch.setattr(campaign, "run_trial", trials.run)
    return trials


def result_in(out: Path) -> dict[str, Any]:
    return json.loads((out / RESULT).read_text())


def test_interrupted_comparison_goes_on_and_no_trial_is_lost_or_run_twice(
    tmp_path: Path, fake: Trials
) -> None:
    arguments = [*ONE_CASE, "--out", str(tmp_path)]
    fake.stop_after = 9
    with pytest.raises(KeyboardInterrupt):
        main(arguments)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["verdict"], summary["ended"]) == ("interrupted", 9)
    fake.stop_after = None
    assert main(arguments) == 0
    assert len(fake.ran) == len(set(fake.ran)) == TRIALS
    rows = result_in(tmp_path)["rows"]
    assert [row["trials"] for row in rows] == [2] * LINES
    for row in rows:
        assert row["position_errors_m"] == [1e-3 + row["larger_m"], 2e-3 + row["larger_m"]]
        assert len(row["bears"]) == (len(LOADS) if row["larger_m"] == 0.0 else 0)
    before = result_in(tmp_path)
    assert main(arguments) == 0
    assert len(fake.ran) == TRIALS
    assert result_in(tmp_path) == before


def test_trial_whose_file_is_gone_or_damaged_is_run_again(tmp_path: Path, fake: Trials) -> None:
    arguments = [*ONE_CASE, "--out", str(tmp_path)]
    main(arguments)
    before = result_in(tmp_path)
    gone, cut, *_ = lines()[4].accuracy
    trial_file(tmp_path, gone.key).unlink()
    file = trial_file(tmp_path, cut.key)
    file.write_text(file.read_text()[:100])
    fake.ran.clear()
    assert main(arguments) == 0
    assert sorted(fake.ran) == sorted([gone.key, cut.key])
    assert result_in(tmp_path) == before


def test_killed_trial_is_a_row_without_a_verdict_until_it_is_run_again(
    tmp_path: Path, fake: Trials, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [text for text in ONE_CASE if text != "--quiet"] + ["--out", str(tmp_path)]
    fake.kill = {2}  # The first placement on the soft jig, after the effort.
    assert main(arguments) == 3
    told = capsys.readouterr().out
    assert "1 trials came to no verdict" in told and "ended by SIGKILL" in told
    soft, *others = result_in(tmp_path)["rows"]
    assert (soft["trials"], soft["no_verdict"], soft["successes"]) == (1, 1, 1)
    assert soft["interval"] == pytest.approx(wilson(1, 1))
    assert [row["no_verdict"] for row in others] == [0] * (LINES - 1)
    assert main(arguments) == 0
    assert len(fake.ran) == TRIALS + 1
    assert result_in(tmp_path)["rows"][0]["trials"] == 2


def test_other_code_runs_everything_again(
    tmp_path: Path, fake: Trials, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = [*ONE_CASE, "--out", str(tmp_path)]
    main(arguments)
    monkeypatch.setattr(points, "code_digest", lambda script: "another")
    assert main(arguments) == 0
    assert len(set(fake.ran)) == 2 * TRIALS


def test_files_of_a_comparison(
    tmp_path: Path, fake: Trials, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [*ONE_CASE[:-1], "--assemblies", "2", "--out", str(tmp_path)]
    assert main(arguments) == 0
    for text in (capsys.readouterr().out, (tmp_path / PAGE).read_text()):
        for heading in ("Table I", "Placements", "What an exactly placed part bears", "assemblies"):
            assert heading in text
        assert "2 of 2 (34 to 100 %)" in text
    assert (tmp_path / "summary.json").exists() and (tmp_path / "report.html").exists()
    kinds = parquet.read_table(tmp_path / "trials.parquet").column("kind").to_pylist()
    counts = {kind: kinds.count(kind) for kind in kinds}
    assert counts == {"effort": 3, "accuracy": 14, "bearing": 3, "assembly": 6}
    assert "Supports need to be placed in postures" in (tmp_path / PAGE).read_text()


# ---- Products


def test_label_selects_the_products_that_have_it_and_drafts_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(products, "run_init", None)
    names = ["motor_unit", "idler", "drawn:0", "idler"]
    assert selected(names, None) == ["motor_unit", "idler", "drawn:0"]
    assert selected(names, "post") == ["idler"]
    assert selected(names, "block/+z") == ["drawn:0"]


def test_drawn_product_is_drafted_once_in_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drafts = []

    def draft(wanted: Any, out: Path, config: CellConfig, *, quiet: bool) -> int:
        drafts.append(sorted(file.stem for file in wanted.source.iterdir()))
        out.mkdir()
        if len(drafts) == 1:
            raise KeyboardInterrupt
        (out / "product.yaml").touch()
        return 0

    monkeypatch.setattr(products, "run_init", draft)
    with pytest.raises(KeyboardInterrupt):
        source_of("drawn:0", tmp_path, CellConfig())
    first = source_of("drawn:0", tmp_path, CellConfig())
    assert first == source_of("drawn:0", tmp_path, CellConfig())
    assert source_of("idler", tmp_path, CellConfig()) == "idler"
    screws = [f"screw_{k}" for k in range(1, 5)]
    assert drafts == [["block", "plate_1", *screws]] * 2


@pytest.mark.parametrize(
    ("options", "culprit"),
    [
        ("--trials 0", "--trials must be from 1"),
        ("--assemblies -1", "--assemblies must be from 0"),
        ("--workers 0", "--workers must be from 1"),
        ("--case motor/P9", "'motor/P9'"),
        ("--fixtures soft_jig vice", "No fixture 'vice'"),
        ("--fixtures", "--fixtures: name at least one"),
        ("--products", "--products: name at least one"),
        ("--products motor", "'motor'"),
        ("--products drawn:x", "write it like drawn:0"),
        ("--seed -1", "--seed must be >= 0"),
    ],
)
def test_bad_input_is_named_in_one_line_before_anything_is_written(
    options: str, culprit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*options.split(), "--out", str(tmp_path / "new")]) == 2
    error = capsys.readouterr().err
    assert culprit in error and error.count("\n") == 1
    assert not (tmp_path / "new").exists()


# ---- Real trials


@pytest.mark.slow
def test_trials_of_one_posture_on_three_fixtures(tmp_path: Path) -> None:
    soft, posts, nest = (
        Task(
            "motor_unit",
            CellConfig.load(overrides=[f"workcell.fixture={name}"]),
            0,
            tmp_path,
        )
        for name in ("soft_jig", "support_jig", "rigid_jig")
    )
    needs = [effort(task, case="plate/P1") for task in (soft, posts, nest)]
    assert all(outcome.success for outcome in needs)
    assert [outcome.measured.get("air_cycles", 0.0) for outcome in needs] == [1.0, 0.0, 0.0]
    assert needs[1].measured["supports_to_set"] == 3.0
    assert needs[2].measured["parts_to_make"] == 1.0
    loads = [bearing(task, case="plate/P1").measured for task in (soft, posts, nest)]
    assert loads[0]["force_+z_N"] > 3 * loads[2]["force_+z_N"]
    for rigid in loads[1:]:
        assert 0.67 < rigid["force_+z_N"] < 2 * 0.67  # The weight [N], and friction of the walls.
        assert rigid["force_+y_N"] > loads[0]["force_+y_N"] / 3


@pytest.mark.slow
def test_seeds_draw_the_disturbances_of_the_trials_of_place(tmp_path: Path) -> None:
    overrides = ["workcell.fixture=support_jig", "push.jig_position_sigma=0"]
    config = CellConfig.load(overrides=overrides)
    placed = place(Task("motor_unit", config, 0, tmp_path), case="plate/P1", number=1)
    found = accuracy(Task("motor_unit", config, 1, tmp_path), case="plate/P1")
    assert found.success == placed.success
    assert {name: found.measured[name] for name in placed.measured} == dict(placed.measured)
