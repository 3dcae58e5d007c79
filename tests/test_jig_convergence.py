"""The variations of the convergence study, and one short run of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.campaigns.trial import Task
from experiments.jig.holding import SPECIMENS, hold, lever, specimen_named
from experiments.jig.specimens import Prism
from experiments.jig_convergence import last_refinement, variations, vented


def test_every_variation_changes_one_quantity() -> None:
    """At most one differs from the default, and every sequence contains the default.

    Only the slow drags differ in both speed and approximation.
    """
    default = vented()
    sequences: dict[str, list[bool]] = {}
    for variation in variations():
        assert len(variation.changes) == 1
        changed = default.with_changes(variation.changes) != default
        sequences.setdefault(variation.varied, []).append(changed)
    assert all(changed.count(False) == 1 for changed in sequences.values()), sequences


def test_last_refinement_is_the_relative_change_at_the_fine_end() -> None:
    rows = [["cell", "2", 9.0, 1.0], ["cell", "1", 4.0, 2.0], ["cell", "0.5", 5.0, 1.0]]
    assert last_refinement([*rows, ["approximation", "sap", 9.0, 9.0]]) == {"cell": [0.25, -0.5]}


def test_every_specimen_is_pushed_below_its_top() -> None:
    levers = {name: lever(specimen_named(name)) for name in SPECIMENS}
    assert levers["standing"] == pytest.approx(0.039, abs=1e-3)
    assert levers["lying"] == pytest.approx(0.020, abs=1e-3)


def test_holding_force_of_a_cylinder_is_at_least_that_of_its_weight(tmp_path: Path) -> None:
    """0.2 kg x 9.81 x 17.5 mm over the lever arm, and less than ten times as much."""
    task = Task("motor_unit", vented(), 0, tmp_path)
    force = hold(task, specimen="standing", depth=0.005).measured["holding_N"]
    alone = 0.2 * 9.81 * 0.0175 / (lever(Prism()) + 0.005)
    assert 0.8 * alone < force < 10 * alone
