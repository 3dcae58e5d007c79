"""The contact study: every run is valid, and what the default changes beyond the step is marked."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from experiments import contact_study
from experiments.cli.common import Common
from experiments.contact_study import (
    ASSEMBLIES,
    DEFAULT,
    FULL,
    HALF,
    RIG,
    WAYS,
    StudyOptions,
    StudyRun,
    assembly_values,
    compare,
    main,
    rig_values,
    run,
    study_runs,
)


def test_every_run_is_valid_and_has_a_folder_of_its_own(tmp_path: Path) -> None:
    options = StudyOptions(common=Common(out=tmp_path))
    runs = study_runs(3)
    assert len(runs) == len({each.folder for each in runs}) == 3 * (3 * len(ASSEMBLIES) + len(RIG))
    for each in runs:
        config = each.common(options).load_config()
        assert (each.way == DEFAULT) or config.simulation.contact == "full"
    assert {each.common(options).load_config().simulation.time_step for each in runs} == {
        1e-3,
        5e-4,
    }


def assembly(clamps: list[float], force: float) -> dict:
    measured = {f"bolt_{k}/clamp_N": clamp for k, clamp in enumerate(clamps)} | {"force_N": force}
    return {"verdict": "success", "steps": [{"name": "tighten", "measured": measured}]}


def test_change_beyond_that_of_the_step_is_marked() -> None:
    ways = {
        FULL: [assembly([100.0, 110.0], 5.0), assembly([105.0, 100.0], 6.0)],
        HALF: [assembly([103.0, 110.0], 5.0), assembly([105.0, 100.0], 6.0)],
        DEFAULT: [assembly([100.0, 112.0], 5.0), assembly([105.0, 100.0], 7.0)],
    }
    values = {way: [assembly_values(result) for result in runs] for way, runs in ways.items()}
    clamp, force = compare("unit", values)
    assert (clamp.where, clamp.quantity) == ("tighten", "clamp_N")
    assert (clamp.full, clamp.changed, clamp.by_step) == (103.75, 2.0, 3.0)
    assert not clamp.marked
    assert (force.changed, force.by_step, force.marked) == (1.0, 0.0, True)


def test_quantity_that_one_way_lacks_is_marked() -> None:
    """A run that stopped early must not look alike."""
    values = {way: [assembly_values(assembly([1.0, 2.0], 5.0))] for way in WAYS}
    values[DEFAULT] = [assembly_values(assembly([1.0], 5.0))]
    clamp, force = compare("unit", values)
    assert np.isnan(clamp.changed) and clamp.marked
    assert not force.marked


def test_cases_are_told_apart_by_direction() -> None:
    case = {"part": "motor", "posture": "P1", "measured": {"displacement_m": 0.07}}
    result = {"cases": [case | {"direction": "a"}, case | {"direction": "b"}]}
    assert set(rig_values(result)) == {
        ("motor/P1/a", "displacement_m"),
        ("motor/P1/b", "displacement_m"),
    }


def test_finished_runs_are_not_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contact_study, "RIG", {})
    for each in study_runs(1):
        folder = tmp_path / each.folder
        folder.mkdir()
        result = assembly([1.0], 2.0)
        result["steps"][0]["cpu_seconds"] = 1.0
        (folder / "result.json").write_text(json.dumps(result))
    options = StudyOptions(seeds=1, common=Common(out=tmp_path, quiet=True))
    assert run(options) == 0
    rows = json.loads((tmp_path / "study.json").read_text())["rows"]
    assert {row["name"] for row in rows} == set(ASSEMBLIES)


def test_bad_options_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--seeds", "0", "--out", str(tmp_path)]) == 2
    assert "--seeds must be >= 1" in capsys.readouterr().err
    assert StudyRun("place", HALF, 0).folder == "place_full_half_step_0"
