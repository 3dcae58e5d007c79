"""The place and push commands: input validation, results and their files."""

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform

from cell import CellConfig
from cell.simulation.log import Log
from experiments.campaigns import campaign
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import trials
from experiments.campaigns.trial import Row, Trial
from experiments.cli.main import main
from experiments.paper import place_push
from experiments.paper.case_results import Experiment, by_outcome, verdict
from experiments.paper.cases import Case, CaseResult, TrialResult, judged
from experiments.paper.place_push import run_experiment
from experiments.paper.postures import POSTURES, PUSHES
from experiments.paper.trial import TrialRecord
from experiments.paper.trial_metrics import force_peaks, place_fault


def refused(arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture) -> str:
    out = tmp_path / "out"
    assert main([*arguments, "--out", str(out)]) == 2
    assert not out.exists()
    (line,) = capsys.readouterr().err.strip().splitlines()
    return line


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["push", "--case", "motor/P3/a"], "motor/P1/a, motor/P1/b"),
        (["place", "--case", "shaft"], "motor/P1, motor/P2, plate/P1"),
        (["place", "--case", "plate/P9"], "plate/P4"),
        (["push", "--trials", "0"], "from 1 to"),
        (["place", "--trials", "-3"], "from 1 to"),
        (["push", "--pressure", "-5"], "must be >= 0 and <= 101325 Pa, not -5000"),
        (["push", "--pressure", "400"], "must be >= 0 and <= 101325 Pa, not 400000"),
        (["push", "--set", "jig.vacuum.pressure=9e9"], "must be >= 0 and <= 101325 Pa"),
        (["push", "--set", "push.jig_mass=0.2"], "push.jig_mass"),
        (["place", "--set", "jig.bag.cap_height=0.005"], "wide"),
        (["place", "--set", "jig.bag.cap_height=0.2"], "cap_height"),
        (["place", "--set", "jig.bag.cell=0"], "'jig.bag.cell' must be >= 0.0002"),
        (["place", "--set", "jig.vacuum.jam_fraction=1"], "jam_fraction"),
        (["place", "--fixture", "vise"], "No fixture 'vise'. Known: flat_plate, rigid_jig,"),
        (["push", "--hand", "foot"], "robot"),
        (["regress", "--suite", "huge"], "huge"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert said in refused(arguments, tmp_path, capsys)


def test_trial_that_failed_before_any_record_is_a_verdict() -> None:
    trial = TrialRecord(planned=RigidTransform(), failure=("pick: lift", "lost the part"))
    trial.log = Log().arrays()
    result = judged(Case(POSTURES["motor/P2"]), trial)
    assert not result.success
    assert result.measured == {}


def test_diverged_trial_can_be_written() -> None:
    """Values that are not finite are omitted."""
    trial = TrialRecord(
        planned=RigidTransform(), held=RigidTransform(), placed=RigidTransform([0, 0, np.nan])
    )
    trial.failure = ("push", "the state is not finite")
    result = judged(Case(POSTURES["motor/P2"]), trial)
    assert not result.success
    assert np.isfinite(list(result.measured.values())).all()


@pytest.mark.parametrize(
    ("raised", "aside", "said"),
    [
        (2e-3, 0.0, "wedged: it stands 2.00 mm off a support"),
        (0.0, 6e-4, "it is 0.60 mm from its seat"),
        (2e-5, 2e-4, ""),
    ],
)
def test_placement_counts_on_a_fixture_of_its_own_only_if_seated(
    raised: float, aside: float, said: str
) -> None:
    trial = TrialRecord(planned=RigidTransform(), seat=RigidTransform())
    trial.placed, trial.off_supports = RigidTransform([aside, 0.0, raised]), raised
    result = judged(Case(POSTURES["motor/P2"]), trial)
    assert result.success == (not said)
    assert said in place_fault(trial, result.measured)
    # Wherever it was put counts on the soft jig.
    trial.seat = trial.off_supports = None
    assert judged(Case(POSTURES["motor/P2"]), trial).success


def test_part_that_falls_over_is_a_failure_with_a_full_report(tmp_path: Path) -> None:
    """The motor on a flat plate: a verdict with measurements, and exit code 1."""
    config = CellConfig().with_changes({"workcell.fixture": "flat_plate"})
    experiment = Experiment("place", config, "rig", 1, 0, tmp_path, quiet=True)
    assert run_experiment(experiment, "motor/P2") == 1
    result = json.loads((tmp_path / "result.json").read_text())
    (case,) = result["cases"]
    assert result["verdict"] == "failure"
    assert (case["part"], case["posture"]) == ("motor", "P2")
    assert (case["trials"], case["successes"], case["expected"]) == (1, 0, "success")
    (failure,) = case["failures"]
    assert failure["phase"] == "settle" or case["measured"]["tilt_rad"] > 0.5  # It may roll off.
    assert result["real_time_factor"] > 0
    assert "force plate" in (tmp_path / "report.html").read_text()
    (state,) = tmp_path.glob("trials/*/failed_state.npz")
    with np.load(state) as arrays:
        assert float(arrays["time"]) > 0.0
        assert np.isfinite(arrays["q"]).all() and np.isfinite(arrays["v"]).all()


@pytest.mark.parametrize(
    ("error", "said"), [(KeyboardInterrupt, "interrupted"), (OSError, "error")]
)
def test_result_says_that_the_trials_run_and_why_they_ended(
    error: type[BaseException], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def stop(*_: object, **__: object) -> None:
        seen.append(json.loads((tmp_path / "result.json").read_text()))
        raise error

    monkeypatch.setattr(place_push, "run_campaign", stop)
    experiment = Experiment("place", CellConfig(), "rig", 1, 0, tmp_path, quiet=True)
    with pytest.raises(error):
        run_experiment(experiment, "motor/P2")
    assert (seen[0]["verdict"], seen[0]["cases"]) == ("running", [])
    assert json.loads((tmp_path / "result.json").read_text())["verdict"] == said


@contextmanager
def here(address: str, workers: int) -> Iterator[ThreadPoolExecutor]:
    """Run trials in this process."""
    with ThreadPoolExecutor(1) as pool:
        yield pool


def test_case_that_cannot_be_run_is_a_row_of_a_campaign(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that does not exist, and a part wider than the bag; neither ends the others."""
    monkeypatch.setattr(campaign, "pool_at", here)
    small = {"jig.bag.cap_height": 0.005}  # Its aperture measures 48 mm.
    for experiment, good, bad in (("place", "plate/P1", "P9"), ("push", "plate/P1/a", "plate/P9")):
        points = [{"case": bad}, {"case": good, **small}, {"case": good, "hand": "foot"}]
        rows = run_campaign(trials(experiment, points), tmp_path / experiment)
        assert [row.verdict for row in rows] == ["error"] * 3
        for row, culprit in zip(rows, (f"'{bad}'", "70 mm wide", "'foot'"), strict=True):
            assert culprit in row.evidence
        summary = json.loads((tmp_path / experiment / "summary.json").read_text())
        assert (summary["verdict"], summary["error"]) == ("error", 3)
        assert (tmp_path / experiment / "trials.parquet").exists()
        assert bad in (tmp_path / experiment / "report.html").read_text()


@pytest.mark.parametrize(("kind", "code"), [("failure", 1), ("error", 3)])
def test_trial_that_ends_before_it_is_simulated_is_counted_and_reported(
    kind: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has no log: of a planner that finds no way, or of an error."""

    def ended(wanted: list[Trial], *_: object, **__: object) -> list[Row]:
        rows = []
        for trial in wanted:
            about = (trial.key, "place", trial.product, 0, trial.varied, trial.options, {})
            rows.append(Row(*about, kind, phase="unknown", evidence="no path was found"))
        return rows

    monkeypatch.setattr(place_push, "run_campaign", ended)
    experiment = Experiment("place", CellConfig(), "rig", 2, 0, tmp_path, quiet=True)
    assert run_experiment(experiment, "motor/P2") == code
    (case,) = json.loads((tmp_path / "result.json").read_text())["cases"]
    assert (case["trials"], case["successes"]) == (2, 0)
    assert "no path was found" in (tmp_path / "report.html").read_text()
    assert place_push.timed(ended(trials("place"))[0], tmp_path) is None


def case_with(label: str, displacements: list[float]) -> CaseResult:
    push = PUSHES[label]
    trials = [
        TrialResult(d > 0.063, {"displacement_m": d}, None, TrialRecord(planned=None))
        for d in displacements
    ]
    return CaseResult(Case(push.posture, push), trials)


def test_verdict_is_success_if_every_case_is_as_expected() -> None:
    good = [case_with("motor/P1/a", [0.07] * 5), case_with("motor/P2/a", [0.01] * 5)]
    assert verdict(good) == "success"
    assert verdict([case_with("motor/P2/a", [0.07, 0.07, 0.07, 0.01, 0.01])]) == "failure"


def test_displacements_are_compared_by_outcome() -> None:
    found = by_outcome(
        [case_with("motor/P1/a", [0.076, 0.078, 0.080]), case_with("motor/P2/a", [0.02, 0.04])],
        "displacement_m",
        {"success": 0.0782, "failure": 0.0542},
    )
    assert found["success"]["mean"] == pytest.approx(0.078)
    assert found["failure"]["mean"] == pytest.approx(0.030)
    assert found["failure"]["paper_mean"] == 0.0542
    low, high = found["success"]["interval"]
    # Student's t for two degrees of freedom: 4.303 * 2 mm / sqrt(3).
    assert (high - low) / 2 == pytest.approx(0.00497, abs=1e-5)
    assert found["welch_p"] < 0.2


def test_push_with_a_small_force_is_no_second_peak() -> None:
    time = np.linspace(0.0, 2.0, 2001)
    weight, placing = 1.0, 20.0 * np.exp(-(((time - 0.5) / 0.1) ** 2))
    pushing = np.exp(-(((time - 1.5) / 0.1) ** 2))
    assert force_peaks(time, weight + placing + 10.0 * pushing, begun=1.0) == 2
    assert force_peaks(time, weight + placing + 2.0 * pushing, begun=1.0) == 1
