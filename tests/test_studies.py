"""What studies compute from campaigns, by functions and rates whose answers are known."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cell import CellConfig
from cell.errors import InputError
from cell.fixtures.soft_jig.parameters import BagParameters
from experiments import jig_design_study, pose_error_study
from experiments.campaigns.trial import Row, Task
from experiments.paper.trial import run_trial
from experiments.studies import jig_design
from experiments.studies.jig_design import design, sized
from experiments.studies.sensitivity import pick_freeze, sobol
from experiments.studies.tolerance import tolerance

# ---- Sobol indices


def test_indices_of_ishigamis_function_are_the_analytic_ones() -> None:
    """Its variances are known in closed form; 1024 base samples are good for 0.05."""
    a, b, seed = 7.0, 0.1, 0
    points = pick_freeze(dict.fromkeys("xyz", (-np.pi, np.pi)), 1024, seed)
    values = [
        np.sin(p["x"]) + a * np.sin(p["y"]) ** 2 + b * p["z"] ** 4 * np.sin(p["x"]) for p in points
    ]
    alone = 0.5 * (1 + b * np.pi**4 / 5) ** 2
    second, both = a**2 / 8, b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    variance = alone + second + both
    found = sobol(values, 3, seed)
    assert found is not None
    assert found.first == pytest.approx(np.array([alone, second, 0.0]) / variance, abs=0.05)
    assert found.total == pytest.approx(np.array([alone + both, second, both]) / variance, abs=0.05)
    for value, (low, high) in zip(found.total, found.total_interval, strict=True):
        assert low < value < high


def test_points_are_in_their_ranges_and_differ_in_one_parameter_from_the_first_block() -> None:
    ranges = {"a": (0.0, 1.0), "b": (10.0, 30.0)}
    points = pick_freeze(ranges, 4, seed=3)
    assert points == pick_freeze(ranges, 4, seed=3)
    assert len(points) == 4 * (2 + 2)
    for name, (low, high) in ranges.items():
        assert all(low <= point[name] <= high for point in points)
    first, second, only_a, only_b = (points[4 * k : 4 * k + 4] for k in range(4))
    for k in range(4):
        assert only_a[k] == {"a": second[k]["a"], "b": first[k]["b"]}
        assert only_b[k] == {"a": first[k]["a"], "b": second[k]["b"]}


@pytest.mark.parametrize("number", [0, 1, 3, 12])
def test_number_of_samples_is_a_power_of_two(number: int) -> None:
    with pytest.raises(InputError, match=f"--samples must be a power of 2, not {number}"):
        pick_freeze({"a": (0.0, 1.0)}, number, 0)


def test_outcome_that_never_varies_has_no_indices() -> None:
    assert sobol([1.0] * 16, 2, 0) is None


# ---- Tolerances


def test_tolerance_is_where_the_rate_crosses_the_goal() -> None:
    """From 10 of 10 at 1 to 8 of 10 at 4: 9 of 10 halfway, in the logarithm, at 2."""
    found = tolerance([1.0, 4.0, 16.0], [10, 8, 0], [10, 10, 10], 0.9)
    assert (found.size, found.sign) == (pytest.approx(2.0), "")


def test_larger_error_that_seems_better_is_chance() -> None:
    """9 and then 10 of 10 are 95 % at both: the goal is met up to the last of them."""
    found = tolerance([1.0, 2.0, 4.0], [9, 10, 0], [10, 10, 10], 0.95)
    assert found.size == pytest.approx(2.0)


def test_tolerance_outside_of_the_sizes_is_a_bound() -> None:
    assert str(tolerance([1.0, 2.0], [10, 10], [10, 10], 0.9).sign) == ">"
    below = tolerance([1.0, 2.0], [5, 0], [10, 10], 0.9)
    assert (below.sign, below.size) == ("<", 1.0)


def test_component_with_the_least_margin_dominates(tmp_path: Path) -> None:
    """Of one step, yaw fails first in degrees, but sideways has the smaller margin."""

    def row(component: str, size: float, seed: int, good: bool) -> Row:
        unit = pose_error_study.UNITS[component][1]
        varied = {"step": 0, "component": component, "size": unit * size}
        verdict = "success" if good else "failure"
        return Row("", "with_error", "idler", seed, varied, {}, {}, verdict, phase="grip")

    levels = {"lateral": [1.0, 4.0], "yaw": [1.0, 4.0]}
    rows = [row("lateral", s, k, s < 2 or k > 7) for s in (1.0, 4.0) for k in range(10)]
    rows += [row("yaw", s, k, k > 0) for s in (1.0, 4.0) for k in range(10)]
    found = list(pose_error_study.curves(rows, ["place"], levels))
    expected = {"lateral": 1.0, "yaw": 0.1}
    lines = list(pose_error_study.tolerance_rows(found, expected))
    assert [line["dominates"] for line in lines] == ["dominates", ""]
    assert lines[0]["fails in"] == "grip"
    facts = {"product": "idler", "trials": 40, "seeds": 10, "goal": 0.9, "versions": {}}
    pose_error_study.write_study(tmp_path, facts, found, expected)
    study = json.loads((tmp_path / "study.json").read_text())
    assert [(x["size"], x["successes"], x["trials"]) for x in study["levels"]] == [
        (1.0, 10, 10), (4.0, 2, 10), (1.0, 9, 10), (4.0, 9, 10),
    ]  # fmt: skip
    assert (tmp_path / "study.csv").read_text().count("\n") == 5
    assert "dominates" in (tmp_path / "study.html").read_text()


@pytest.mark.parametrize(
    ("options", "culprit"),
    [
        (["idler", "--seeds", "0"], "--seeds"),
        (["idler", "--step", "fly"], "'fly'"),
        (["idler", "--level", "sideways=1"], "'sideways'"),
        (["idler", "--level", "yaw=1,-2"], "positive"),
        (["nosuch"], "nosuch"),
    ],
)
def test_bad_option_of_the_error_study_is_named_before_any_trial(
    options: list[str], culprit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert pose_error_study.main([*options, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert culprit in error and error.count("\n") == 1
    assert not (tmp_path / "out" / "trials").exists()


# ---- The jig's design


def test_bag_of_another_size_keeps_shape_and_fill_and_has_a_base_that_is_heavier() -> None:
    config, bag = sized(CellConfig(), 0.072), BagParameters()
    new = config.jig.bag
    assert new.aperture_radius == pytest.approx(1.2 * bag.aperture_radius)
    assert new.volume == pytest.approx(1.2**3 * bag.volume)
    assert new.bead_volume / new.volume == pytest.approx(bag.bead_volume / bag.volume)
    assert config.push.jig_mass == pytest.approx(1.05 * 1.2**2 + 0.45 * 1.2**3)
    assert sized(CellConfig(), bag.cap_radius) == CellConfig()


def test_part_that_is_wider_than_the_bag_is_a_verdict_on_the_design(tmp_path: Path) -> None:
    task = Task("motor_unit", CellConfig(), 0, tmp_path)
    outcome = design(task, case="plate/P1/a", radius=0.0355)
    assert (outcome.success, outcome.phase) == (False, "fit")
    assert "70 mm wide" in outcome.evidence and outcome.measured["holding_N"] == 0.0


def fake_rows(wanted: Any, *_: Any, **__: Any) -> list[Row]:
    """Rows in which the vacuum alone decides the holding, and nothing whether a part is placed."""
    found = []
    for trial in wanted:
        vacuum = trial.varied["jig.vacuum.pressure"]
        pushed = vacuum > 60e3
        measured = {"holding_N": 1e-4 * vacuum, "placed": 1.0, "pushed": float(pushed)}
        measured |= {"depth_m": 0.01, "lifting_N": 1.0}
        row = Row(trial.key, "design", "motor_unit", 0, trial.varied, {}, {}, "success")
        found.append(Row(**{**vars(row), "measured": measured, "cpu_seconds": 1.0}))
    return found


def test_study_names_the_parameter_that_decides(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jig_design_study, "run_campaign", fake_rows)
    assert jig_design_study.main(["--samples", "32", "--quiet", "--out", str(tmp_path)]) == 0
    study = json.loads((tmp_path / "study.json").read_text())
    lines = {(x["outcome"], x["parameter"]): x for x in study["indices"]}
    for outcome in ("holding_N", "pushed"):
        for name in jig_design_study.RANGES:
            expected = 1.0 if name == "jig.vacuum.pressure" else 0.0
            assert lines[outcome, name]["total"] == pytest.approx(expected, abs=0.25)
    assert "same at all base points" in lines["placed", ""]["remark"]
    html = (tmp_path / "study.html").read_text()
    assert html.count("<img") == 4 and "jig.vacuum.pressure" in html


def test_trial_without_a_verdict_leaves_no_indices(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def one_killed(wanted: Any, *_: Any, **__: Any) -> list[Row]:
        first, *others = fake_rows(wanted)
        return [Row(**{**vars(first), "verdict": "killed"}), *others]

    monkeypatch.setattr(jig_design_study, "run_campaign", one_killed)
    assert jig_design_study.main(["--samples", "2", "--quiet", "--out", str(tmp_path)]) == 3
    assert not (tmp_path / "study.json").exists()


@pytest.mark.slow
def test_pulls_do_not_disturb_the_push(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The trial ends as one without them, to the last bit."""
    task = Task("motor_unit", CellConfig(), 0, tmp_path)
    pulled = design(task, case="plate/P1/a").measured
    monkeypatch.setattr(jig_design, "run_trial", lambda hand, push, watch: run_trial(hand, push))
    alone = design(task, case="plate/P1/a").measured
    for name in ("depth_m", "displacement_m", "pushed"):
        assert pulled[name] == alone[name]
    assert pulled["holding_N"] > 1.0 and pulled["lifting_N"] > 1.0
