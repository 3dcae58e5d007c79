"""Errors of seen poses: their sizes and directions, and what single steps make of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform

from cell import Cell, CellConfig
from cell.errors import InputError
from experiments.campaigns.trial import Task
from experiments.studies.pose_errors import (
    COMPONENTS,
    ErringSource,
    PoseError,
    with_error,
    without_error,
)
from planning.perception.belief import TruthSource


def sources(cell: Cell, component: str, size: float) -> tuple[TruthSource, ErringSource]:
    assert cell.diagram is not None
    context = cell.diagram.CreateDefaultContext()
    truth = TruthSource.of(cell, context, 0)
    error = PoseError(component, size, np.random.default_rng(1))
    return truth, ErringSource(truth, cell.parts, error)


@pytest.mark.parametrize("component", COMPONENTS)
def test_error_has_its_size_and_leaves_everything_else(
    motor_unit_cell: Cell, component: str
) -> None:
    """A turn leaves the mass centre where it is; a shift does not turn."""
    size = 0.02
    truth, erring = sources(motor_unit_cell, component, size)
    X_WP = truth.look(["motor"], {})["motor"].X_WP
    centre = motor_unit_cell.parts["motor"].part.mesh.center_mass
    for _ in range(20):
        X_WQ = erring.look(["motor"], {})["motor"].X_WP
        turn = (X_WQ.rotation() @ X_WP.rotation().inverse()).ToAngleAxis()
        shift = X_WQ @ centre - X_WP @ centre
        turned = turn.angle() * turn.axis()
        moved, still = (shift, turned) if component in ("lateral", "height") else (turned, shift)
        assert np.linalg.norm(moved) == pytest.approx(size)
        assert np.linalg.norm(still) < 1e-12
        upright = component in ("height", "yaw")
        assert abs(moved[2]) == pytest.approx(size if upright else 0.0, abs=1e-12)


def test_every_look_at_every_part_errs_in_another_direction(motor_unit_cell: Cell) -> None:
    _, erring = sources(motor_unit_cell, "lateral", 0.001)
    places = [X.X_WP.translation() for _ in range(3) for X in erring.look(["motor"], {}).values()]
    assert np.ptp(places, axis=0).max() > 1e-4
    truth, erring = sources(motor_unit_cell, "lateral", 0.001)
    one, other = (
        erring.look([n], {})[n].X_WP.translation() - truth.look([n], {})[n].X_WP.translation()
        for n in ("motor", "plate")
    )
    assert np.linalg.norm(one - other) > 1e-5


def test_no_error_is_the_truth_to_the_last_bits(motor_unit_cell: Cell) -> None:
    truth, erring = sources(motor_unit_cell, "tilt", 0.0)
    seen, true = erring.look(["plate"], {})["plate"].X_WP, truth.look(["plate"], {})["plate"].X_WP
    assert seen.IsNearlyEqualTo(true, 1e-15)
    assert isinstance(seen, RigidTransform)


@pytest.mark.parametrize(
    ("options", "culprit"), [({"component": "roll"}, "'roll'"), ({"step": 9}, "no step 9")]
)
def test_impossible_trial_is_named(options: dict, culprit: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=culprit):
        with_error(Task("idler", CellConfig(), 0, tmp_path), **options)


@pytest.mark.slow
def test_step_bears_a_small_error_and_a_large_one_is_named(tmp_path: Path) -> None:
    """The first step of the idler; its state is kept by the run without errors."""
    task = Task("idler", CellConfig(), 0, tmp_path / "trials" / "key")
    first = without_error(task)
    assert first.success
    assert {file.name for file in task.folder.iterdir()} == {
        f"before_{k}_state.npz" for k in range(4)
    }
    erring = replace(task, folder=tmp_path / "trials" / "other")
    good = with_error(erring, start="key", component="lateral", size=1e-4)
    bad = with_error(erring, start="key", component="yaw", size=np.pi / 6)
    assert good.success and all(name.startswith("place post/") for name in good.measured)
    assert (bad.success, bad.phase.split(":")[0]) == (False, "post")
