"""The contact study: every run is valid, and what the default changes beyond the step is marked."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cell import CellConfig
from experiments.campaigns.run_trial import row_of
from experiments.campaigns.store import write_trial
from experiments.campaigns.trial import Outcome, Row
from experiments.cli.common import Common
from experiments.contact_study import (
    ASSEMBLIES,
    DEFAULT,
    FULL,
    HALF,
    WAYS,
    StudyOptions,
    StudyRun,
    compare,
    main,
    run,
    study_runs,
    values_of,
)

CASES = 6 + 9  # Placements and pushes.


def test_every_run_is_valid_and_a_trial_of_its_own() -> None:
    runs = study_runs(3)
    found = [each.trial(CellConfig.load()) for each in runs]
    assert len(runs) == len({trial.key for trial in found}) == 3 * (3 * len(ASSEMBLIES) + CASES)
    for each, trial in zip(runs, found, strict=True):
        assert (each.way == DEFAULT) or trial.config.simulation.contact == "full"
    assert {trial.config.simulation.time_step for trial in found} == {1e-3, 5e-4}


def row_with(**measured: float | None) -> Row:
    found = {name.replace("__", "/"): value for name, value in measured.items()}
    return Row("", "", "", 0, {}, {}, {}, "success", measured=found)


def assembly(clamps: list[float], force: float) -> dict:
    """Return the values of a run that tightened some bolts."""
    bolts = {f"tighten__bolt_{k}__clamp_N": clamp for k, clamp in enumerate(clamps)}
    row = row_with(**bolts, tighten__force_N=force)
    return values_of(StudyRun("motor unit", "", FULL, 0), row)


def test_change_beyond_that_of_the_step_is_marked() -> None:
    ways = {
        FULL: [assembly([100.0, 110.0], 5.0), assembly([105.0, 100.0], 6.0)],
        HALF: [assembly([103.0, 110.0], 5.0), assembly([105.0, 100.0], 6.0)],
        DEFAULT: [assembly([100.0, 112.0], 5.0), assembly([105.0, 100.0], 7.0)],
    }
    clamp, force = compare("unit", ways)
    assert (clamp.where, clamp.quantity) == ("tighten", "clamp_N")
    assert (clamp.full, clamp.changed, clamp.by_step) == (103.75, 2.0, 3.0)
    assert not clamp.marked
    assert (force.changed, force.by_step, force.marked) == (1.0, 0.0, True)


def test_quantity_that_one_way_lacks_is_marked() -> None:
    """A run that stopped early must not look alike."""
    values = {way: [assembly([1.0, 2.0], 5.0)] for way in WAYS}
    values[DEFAULT] = [assembly([1.0], 5.0)]
    clamp, force = compare("unit", values)
    assert np.isnan(clamp.changed) and clamp.marked
    assert not force.marked


def test_values_of_the_rig_are_those_of_its_case() -> None:
    pushed = StudyRun("push", "motor/P1/a", FULL, 0)
    values = values_of(pushed, row_with(displacement_m=0.07, offset_m=0.001, depth_m=None))
    assert set(values) == {("motor/P1/a", "displacement_m"), ("motor/P1/a", "depth_m")}
    assert np.isnan(values["motor/P1/a", "depth_m"])


def test_study_is_made_from_finished_trials(tmp_path: Path) -> None:
    for each in study_runs(1):
        trial = each.trial(CellConfig.load())
        measured = {"tighten/bolt_1/clamp_N": 2.0} if each.where == "" else {"tilt_rad": 1.0}
        write_trial(tmp_path, row_of(trial, "success", Outcome(True, measured), 1.0, "", tmp_path))
    options = StudyOptions(seeds=1, common=Common(out=tmp_path, quiet=True))
    assert run(options) == 0
    rows = json.loads((tmp_path / "study.json").read_text())["rows"]
    assert len(rows) == len(ASSEMBLIES) + CASES
    assert {row["name"] for row in rows} == {*ASSEMBLIES, "place", "push"}
    assert {row["changed"] for row in rows} == {0.0}


def test_bad_options_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--seeds", "0", "--out", str(tmp_path)]) == 2
    assert "--seeds must be from 1 to" in capsys.readouterr().err
    assert (
        StudyRun("push", "motor/P1/a", HALF, 0).trial(CellConfig()).options["case"] == "motor/P1/a"
    )
