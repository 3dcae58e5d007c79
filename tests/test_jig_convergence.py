"""The convergence study's settings, and one short run of it."""

from __future__ import annotations

import pytest

from experiments.jig.element_tests import parameters
from experiments.jig.specimens import Prism
from experiments.jig_convergence import (
    Setting,
    holding_force,
    last_refinement,
    lever,
    settings,
    specimens,
)


def test_every_setting_varies_one_thing() -> None:
    """It differs from the default in one number at most, and every sequence has the default.

    Only what is dragged slowly differs in speed and approximation.
    """
    default = Setting("", "", parameters())
    sequences: dict[str, list[int]] = {}
    for setting in (each for each in settings() if each.speed == default.speed):
        changed = [
            setting.params.jammed != default.params.jammed,
            setting.params.bag != default.params.bag,
            setting.time_step != default.time_step,
            setting.approximation != default.approximation,
        ]
        sequences.setdefault(setting.varied, []).append(sum(changed))
    assert all(sorted(changed)[:2] == [0, 1] for changed in sequences.values()), sequences
    assert all(max(changed) == 1 for changed in sequences.values())


def test_last_refinement_is_the_relative_change_at_the_fine_end() -> None:
    rows = [["cell", "2", 9.0, 1.0], ["cell", "1", 4.0, 2.0], ["cell", "0.5", 5.0, 1.0]]
    assert last_refinement([*rows, ["approximation", "sap", 9.0, 9.0]]) == {"cell": [0.25, -0.5]}


def test_parts_are_pushed_below_their_top() -> None:
    levers = {name: lever(part) for name, part in specimens().items()}
    assert levers["standing"] == pytest.approx(0.039, abs=1e-3)
    assert levers["lying"] == pytest.approx(0.020, abs=1e-3)


def test_cylinder_holds_at_least_what_its_weight_turns_back() -> None:
    """0.2 kg x 9.81 x 17.5 mm over the lever, and not ten times it."""
    force = holding_force(Prism(facets=12), Setting("", "", parameters()), depth=0.005)
    alone = 0.2 * 9.81 * 0.0175 / (lever(Prism()) + 0.005)
    assert 0.8 * alone < force < 10 * alone
