"""The scripts of single operations: their command line and how far they run."""

import json
from pathlib import Path
from types import ModuleType

import pytest

from experiments import bolt_tightening, operation, pick_place, shaft_insertion
from experiments.assembly import assemble
from experiments.assembly.job import Job
from planning.operations.registry import OPERATIONS

SCRIPTS = {
    "pick_place": (pick_place, "pick_place"),
    "shaft_insertion": (shaft_insertion, "insert_shaft"),
    "bolt_tightening": (bolt_tightening, "tighten_bolts"),
}


@pytest.mark.parametrize("name", SCRIPTS)
def test_script_runs_up_to_its_operation(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs: list[Job] = []
    monkeypatch.setattr(assemble, "run_job", lambda job: jobs.append(job) or 0)
    script, last = SCRIPTS[name]
    options = ["--seed", "4", "--start", "x.npz", "--quiet", "--out", str(tmp_path / "out")]
    assert script.main([*options, "--set", "placement.press_force=15"]) == 0
    (job,) = jobs
    assert (job.command, job.seed, job.start) == (name, 4, Path("x.npz"))
    assert job.last is OPERATIONS[last]
    assert job.config.placement.press_force == 15.0
    assert job.product.name == "motor_unit"


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_has_a_script(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs: list[Job] = []
    monkeypatch.setattr(assemble, "run_job", lambda job: jobs.append(job) or 0)
    assert operation.main([name, "idler", "--quiet", "--out", str(tmp_path / "out")]) == 0
    (job,) = jobs
    assert (job.command, job.last, job.product.name) == (name, OPERATIONS[name], "idler")


def test_unknown_operation_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert operation.main(["insert_shift", "--out", str(tmp_path / "out")]) == 2
    assert "Did you mean 'insert_shaft'?" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("script", [script for script, _ in SCRIPTS.values()])
def test_infeasible_order_is_a_failure(script: ModuleType, tmp_path: Path) -> None:
    options = ["--order", "motor,bolts,plate", "--quiet", "--out", str(tmp_path)]
    assert script.main(options) == 1
    assert json.loads((tmp_path / "result.json").read_text())["verdict"] == "failure"


@pytest.mark.parametrize("content", [None, "no archive"])
def test_start_that_cannot_be_read_is_bad_input(
    content: str | None, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    start = tmp_path / "state.npz"
    if content is not None:
        start.write_text(content)
    assert pick_place.main(["--start", str(start), "--out", str(tmp_path / "out")]) == 2
    assert str(start) in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_operation_that_the_plan_lacks_is_bad_input(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """Rather than a run of the whole assembly."""
    assert operation.main(["set_aside", "--quiet", "--out", str(tmp_path / "out")]) == 2
    assert "no step with 'set_aside'. Its operations: pick_place," in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
