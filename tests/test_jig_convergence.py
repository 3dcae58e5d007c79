"""The convergence study's settings, and one short run of it."""

from __future__ import annotations

import pytest

from experiments.jig.specimens import Prism
from experiments.jig_convergence import holding_force, lever, settings, specimens


def test_every_setting_varies_one_thing() -> None:
    """The default first; every other setting differs from it in one number."""
    first, *others = settings()
    for setting in others:
        changed = [
            setting.params.jammed != first.params.jammed,
            setting.params.bag != first.params.bag,
            setting.time_step != first.time_step,
            setting.approximation != first.approximation,
        ]
        assert sum(changed) == 1, setting


def test_parts_are_pushed_below_their_top() -> None:
    levers = {name: lever(part) for name, part in specimens().items()}
    assert levers["standing"] == pytest.approx(0.039, abs=1e-3)
    assert levers["lying"] == pytest.approx(0.020, abs=1e-3)


def test_cylinder_holds_at_least_what_its_weight_turns_back() -> None:
    """0.2 kg x 9.81 x 17.5 mm over the lever, and not ten times it."""
    force = holding_force(Prism(facets=12), next(settings()), depth=0.005)
    alone = 0.2 * 9.81 * 0.0175 / (lever(Prism()) + 0.005)
    assert 0.8 * alone < force < 10 * alone
