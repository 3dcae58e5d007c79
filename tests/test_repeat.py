"""Repeated assembly: bad input is found before any run, and every run is counted."""

import json
from pathlib import Path

import pytest

from experiments import repeat
from experiments.campaigns.trial import Row
from planning.operations.limits import Limit


def test_every_seed_is_run_and_its_failure_is_reported(tmp_path: Path) -> None:
    """An infeasible order fails within a second, in a process like any other run."""
    options = ["--seed", "3", "--seeds", "2", "--order", "motor,bolts,plate", "--quiet"]
    assert repeat.main([*options, "--out", str(tmp_path)]) == 1
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["seeds"], summary["failure"]) == ([3, 4], 2)
    (phase,) = summary["failures_by_phase"]
    assert (phase["phase"], phase["trials"]) == ("plan", 2)
    assert len(list((tmp_path / "trials").glob("*.json"))) == 2


@pytest.mark.parametrize(
    ("options", "culprit"),
    [
        (["--seeds", "0"], "--seeds must be from 1 to"),
        (["--workers", "-1"], "--workers must be from 1 to"),
        (["nosuch"], "nosuch"),
        (["--order", "motor,plate"], "bolts"),
        (["--set", "simulation.time_stop=1"], "simulation.time_stop"),
    ],
)
def test_bad_input_is_one_line_before_any_run(
    options: list[str], culprit: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert repeat.main([*options, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert culprit in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_range_is_over_runs_and_parts() -> None:
    def row(**measured: float) -> Row:
        found = {f"tighten/{k.replace('_', '/')}": value for k, value in measured.items()}
        return Row("", "assemble", "", 0, {}, {}, {}, "success", measured=found | {"place/x": 50.0})

    rows = [row(b1_x=1.0, b2_x=-2.0, b1_y=9.0), row(b1_x=3.0)]
    assert repeat.range_of(Limit("x", 1.0, "", "parts"), "tighten", rows) == (-2.0, 3.0)
    assert repeat.range_of(Limit("x", 1.0, ""), "pick", rows) is None
