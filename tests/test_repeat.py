"""Repeated assembly: bad input is found before any run, and every run is counted."""

import json
from pathlib import Path

import pytest

from experiments import repeat
from planning.operations.limits import Limit


def test_every_seed_is_run_and_its_failure_is_reported(tmp_path: Path) -> None:
    """An infeasible order fails within a second, in its own process like any other run."""
    options = ["--seed", "3", "--seeds", "2", "--order", "motor,bolts,plate", "--quiet"]
    assert repeat.main([*options, "--out", str(tmp_path)]) == 1
    runs = json.loads((tmp_path / "summary.json").read_text())["runs"]
    assert [(run["seed"], run["verdict"]) for run in runs] == [(3, "failure"), (4, "failure")]
    assert all(run["failures"][0].startswith("plan: ") for run in runs)
    assert (tmp_path / "4" / "result.json").is_file()


@pytest.mark.parametrize(
    ("options", "culprit"),
    [
        (["--seeds", "0"], "--seeds must be >= 1"),
        (["--workers", "-1"], "--workers must be >= 1"),
        (["nosuch"], "nosuch"),
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
    step = {"operation": "tighten_bolts", "measured": {"b1/x": 1.0, "b2/x": -2.0, "b1/y": 9.0}}
    other = {"operation": "place_bolts", "measured": {"b1/x": 50.0}}
    results = [{"steps": [step, other]}, {"steps": [{**step, "measured": {"b1/x": 3.0}}]}]
    assert repeat._range("tighten_bolts", Limit("x", 1.0, "", "parts"), results) == (-2.0, 3.0)
    assert repeat._range("pick_place", Limit("x", 1.0, ""), results) is None
