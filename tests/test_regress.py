"""``soft-jig regress``: which cases run, what is stored, and what a drift is."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from cell import CellConfig
from cell.errors import InputError
from experiments.campaigns.trial import Row
from experiments.cli.main import main
from experiments.compare.comparison import compared
from experiments.regress.baseline import metrics_of, read_baseline
from experiments.regress.command import BASELINES, Regression
from experiments.regress.suites import NAMES, SUITES, cases_named, trials_of

CASES = ["push/plate/P1/a", "hold/standing"]


def row(verdict: str = "success", **measured: float) -> Row:
    return Row("k", "hold", "motor_unit", 0, {}, {}, {}, verdict, measured=measured)


@pytest.fixture
def fake_trials(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[Row]]:
    """Rows by case, in place of trials that are run."""
    rows = {case: [row(holding_N=4.0)] for case in CASES}
    monkeypatch.setattr(
        Regression,
        "_run_trials",
        lambda self, out, console: {case: rows[case] for case in self.suite.cases},
    )
    return rows


def regress(tmp_path: Path, *options: str) -> int:
    baseline = ["--baseline", str(tmp_path / "own.json"), "--quiet"]
    return main(["regress", *baseline, "--out", str(tmp_path / "out"), *options])


def result_of(tmp_path: Path) -> dict[str, Any]:
    return json.loads((tmp_path / "out" / "result.json").read_text())


def stored_in(tmp_path: Path) -> Mapping[str, Any]:
    return json.loads((tmp_path / "own.json").read_text())["cases"]


# ---- Cases


def test_beginning_of_a_name_selects_all_cases_that_begin_with_its_words() -> None:
    assert cases_named(["push/plate/P2", "hold/standing"], NAMES) == (
        "push/plate/P2/a", "push/plate/P2/b", "push/plate/P2/c", "hold/standing",
    )  # fmt: skip
    assert cases_named(["place", "push", "hold"], NAMES) == NAMES
    with pytest.raises(InputError, match="No case 'push/pl'. Known: place/motor/P1,"):
        cases_named(["push/pl"], NAMES)


def test_every_case_has_trials_and_the_package_stores_the_cases_of_its_suites() -> None:
    for name, suite in SUITES.items():
        found = trials_of(suite, CellConfig())
        assert all(len(found[case]) in (1, suite.trials) for case in suite.cases)
        assert set(read_baseline(BASELINES / f"{name}.json").cases) == set(suite.cases)


def test_metrics_are_means_over_the_trials_that_have_them() -> None:
    rows = [row(depth_m=0.01, odd=1.0), row("failure", depth_m=0.03), row("failure")]
    assert metrics_of(rows) == pytest.approx({"success_rate": 1 / 3, "depth_m": 0.02})


# ---- Drift


def test_drift_is_a_metric_outside_its_tolerance_or_missing() -> None:
    stored = {"place/motor/P2": {"success_rate": 1.0, "depth_m": 0.0100}}
    same = {"place/motor/P2": {"success_rate": 1.0, "depth_m": 0.0103}}
    assert all(each.ok for each in compared(stored, same))
    flipped = {"place/motor/P2": {"success_rate": 0.0, "depth_m": 0.0100}}
    assert [each.quantity for each in compared(stored, flipped) if not each.ok] == ["success_rate"]
    assert not any(each.ok for each in compared(stored, {"place/motor/P2": {}}))


def test_own_baseline_is_stored_and_compared(tmp_path: Path, fake_trials: Any) -> None:
    cases = [option for case in CASES for option in ("--case", case)]
    assert regress(tmp_path, *cases) == 2  # Nothing is stored yet.
    assert regress(tmp_path, *cases, "--update") == 0
    assert list(stored_in(tmp_path)) == CASES
    assert regress(tmp_path) == 0  # The cases of the baseline.
    assert result_of(tmp_path)["cases"] == CASES
    fake_trials["hold/standing"] = [row(holding_N=3.9)]
    junit = tmp_path / "new" / "r.xml"
    assert regress(tmp_path, "--junit", str(junit)) == 1
    failed = [m for m in result_of(tmp_path)["metrics"] if not m["ok"]]
    assert [(m["case"], m["metric"]) for m in failed] == [("hold/standing", "holding_N")]
    root = ElementTree.parse(junit).getroot()
    assert (root.attrib["tests"], root.attrib["failures"]) == ("2", "1")
    assert regress(tmp_path, "--case", "push") == 0  # Only that.


def test_update_of_a_case_leaves_the_others(tmp_path: Path, fake_trials: Any) -> None:
    cases = [option for case in CASES for option in ("--case", case)]
    assert regress(tmp_path, *cases, "--update") == 0
    before = stored_in(tmp_path)
    for case in CASES:
        fake_trials[case] = [row(holding_N=1.0)]
    assert regress(tmp_path, "--case", "hold/standing", "--update") == 0
    after = stored_in(tmp_path)
    assert after["push/plate/P1/a"] == before["push/plate/P1/a"]
    assert after["hold/standing"]["holding_N"] == 1.0


def test_case_that_is_not_stored_is_named_before_any_work(
    tmp_path: Path, fake_trials: Any, capsys: pytest.CaptureFixture
) -> None:
    assert regress(tmp_path, "--case", "hold/standing", "--update") == 0
    (tmp_path / "out" / "result.json").unlink()
    assert regress(tmp_path, "--case", "push/plate/P1/a") == 2
    assert "No case 'push/plate/P1/a'. Known: hold/standing." in capsys.readouterr().err
    assert not (tmp_path / "out" / "result.json").exists()


def test_trial_without_a_verdict_is_an_error_and_is_not_stored(
    tmp_path: Path, fake_trials: Any
) -> None:
    assert regress(tmp_path, "--case", "hold/standing", "--update") == 0
    before = (tmp_path / "own.json").read_text()
    fake_trials["hold/standing"] = [row("killed")]
    junit = tmp_path / "r.xml"
    for options in ([], ["--update"]):
        assert regress(tmp_path, *options, "--junit", str(junit)) == 3
        assert result_of(tmp_path)["verdict"] == "error"
        assert ElementTree.parse(junit).getroot().attrib["errors"] == "1"
    assert (tmp_path / "own.json").read_text() == before


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "Cannot read the stored metrics"),
        ("[]", "Cannot read the stored metrics"),
        ('{"cases": {}, "drake": "1", "trials": 1}', "it lacks 'speed'"),
        ('{"cases": {"hold": 3}, "drake": "1", "trials": 1, "speed": {}}', "Cannot read"),
        ('{"cases": {"a": {"x": NaN}}, "drake": "1", "trials": 1, "speed": {}}', "not finite"),
        ('{"cases": {"a": {"x": 1}}, "drake": "1", "trials": 1, "speed": {}}', "No case 'a'"),
    ],
)
def test_bad_baseline_is_one_line(
    content: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / "own.json").write_text(content)
    assert regress(tmp_path) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert said in line
    assert not (tmp_path / "out").exists()


def test_result_says_that_it_runs_and_why_it_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = {}

    def stop(self: Regression, out: Path, console: Any) -> None:
        seen["verdict"] = json.loads((out / "result.json").read_text())["verdict"]
        raise KeyboardInterrupt

    monkeypatch.setattr(Regression, "_run_trials", stop)
    regression = Regression.of("full", (), None, False, config=CellConfig(), quiet=True)
    with pytest.raises(KeyboardInterrupt):
        regression.run(tmp_path)
    assert seen["verdict"] == "running"
    assert json.loads((tmp_path / "result.json").read_text())["verdict"] == "interrupted"
