"""Robustness of the pushes: variants are valid; the one fitted number follows from its law."""

import pytest

from cell import CellConfig
from experiments.push_robustness import (
    CONTROLS,
    MEASURABLE,
    NUMERICS,
    PARAMETERS,
    RobustnessOptions,
    coasting_speed,
    config_of,
    decided_by,
    flips,
    main,
    scaled,
    value_at,
    variants,
)


def test_configured_speed_is_that_of_the_papers_mean_success() -> None:
    """Rounded to 0.01 m/s, which moves the jig by 0.8 mm."""
    config = CellConfig()
    assert config.push.speed == pytest.approx(coasting_speed(config), abs=0.01)


def test_samples_are_within_the_spread_and_reproducible() -> None:
    options = RobustnessOptions(samples=3, spread=0.2, one_by_one=True, numerics=True)
    config = CellConfig()
    found = variants(options, config)
    assert found == variants(options, config)
    assert len(found) == 1 + len(NUMERICS) + 2 * len(PARAMETERS) + 3
    for variant in found[1 + len(NUMERICS) :]:
        for path, value in variant.changes.items():
            assert abs(value / value_at(config, path) - 1) <= options.spread + 1e-12


@pytest.mark.parametrize("path", PARAMETERS)
def test_every_parameter_can_be_scaled(path: str) -> None:
    config = CellConfig()
    changes = scaled(config, {path: 1.1})
    changed = CellConfig.load("default", changes)
    assert value_at(changed, path) == pytest.approx(1.1 * value_at(config, path))


@pytest.mark.parametrize("changes", [*NUMERICS.values(), *CONTROLS.values()], ids=str)
def test_every_named_variant_is_a_valid_configuration(changes: dict) -> None:
    assert CellConfig.load("default", changes) != CellConfig()


def test_wide_samples_are_clipped_to_the_valid_range() -> None:
    options = RobustnessOptions(samples=20, spread=0.7, one_by_one=True)
    found = variants(options, CellConfig())
    pressures = [config_of(options, variant).jig.vacuum.pressure for variant in found]
    assert max(pressures) == pytest.approx(101.325e3)
    assert min(pressures) < 40e3


def test_last_control_is_the_flat_plate() -> None:
    options = RobustnessOptions(samples=0, controls=True)
    found = variants(options, CellConfig())
    fixtures = [config_of(options, variant).workcell.fixture for variant in found]
    assert fixtures == ["soft_jig"] * (1 + len(CONTROLS)) + ["flat_plate"]


def test_flip_is_an_outcome_that_differs_from_the_configured_one() -> None:
    base = {"outcome": {"a": "success", "b": "failure"}, "displacement_m": {"a": 0.08, "b": 0.0}}
    other = {"outcome": {"a": "failure", "b": "failure"}, "displacement_m": {"a": 0.02, "b": 0.0}}
    assert flips(other, base) == ["a (20 mm)"]
    assert flips(base, base) == []


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [("--samples -1", "--samples"), ("--spread 1", "--spread"), ("--case motor/P9", "motor/P9")],
)
def test_bad_usage_is_named(
    arguments: str, culprit: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments.split()) == 2
    assert culprit in capsys.readouterr().err


def test_a_quantity_decides_the_cases_whose_outcome_it_changes() -> None:
    base = {"variant": "as configured", "outcome": {"a": "success", "b": "failure"}}
    light = {"variant": "push.jig_mass=1", "outcome": {"a": "success", "b": "success"}}
    heavy = {"variant": "push.jig_mass=2.5", "outcome": {"a": "success", "b": "failure"}}
    rough = {"variant": "push.base_friction=0.6", "outcome": {"a": "success", "b": "failure"}}
    decided = decided_by([base, light, heavy, rough])
    assert decided == {"push.jig_mass": ["b"], "push.base_friction": []}


@pytest.mark.parametrize("path", MEASURABLE)
def test_measurable_quantities_bracket_the_configured_value(path: str) -> None:
    values = MEASURABLE[path]
    configured = value_at(CellConfig(), path)
    assert configured not in values
    assert min(values) < configured
    assert CellConfig.load("default", {path: values[0]}) != CellConfig()
