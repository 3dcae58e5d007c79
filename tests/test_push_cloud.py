"""The parameter cloud: what is varied exists, and the one fitted number follows from its law."""

import pytest

from cell import CellConfig
from experiments.cli import Common
from experiments.push_cloud import (
    PARAMETERS,
    SPREAD,
    Options,
    coasting_speed,
    scaled,
    value_at,
    variants,
)


def test_configured_speed_is_that_of_the_papers_mean_success() -> None:
    """Rounded to 0.01 m/s; one of them moves the jig by 0.8 mm."""
    config = CellConfig()
    assert config.push.speed == pytest.approx(coasting_speed(config), abs=0.01)


def test_samples_stay_within_the_spread_and_repeat() -> None:
    options = Options(samples=3, one_by_one=True)
    found = variants(options)
    assert found == variants(options)
    assert len(found) == 1 + 2 * len(PARAMETERS) + 3
    for _, factors in found:
        assert all(1 - SPREAD <= factor <= 1 + SPREAD for factor in factors.values())


@pytest.mark.parametrize("path", PARAMETERS)
def test_every_parameter_is_a_setting_that_can_be_scaled(path: str) -> None:
    config = CellConfig()
    changed = scaled(config, Common(), {path: 1.1})
    assert value_at(changed, path) == pytest.approx(1.1 * value_at(config, path))
