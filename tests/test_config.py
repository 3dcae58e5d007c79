"""The configuration: three layers, every value checked, every mistake named."""

from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from cell.configuration.config import CellConfig
from cell.configuration.config_file import CONFIG_FOLDER, changed, parse_overrides
from cell.configuration.config_yaml import HEADER, commented_yaml
from cell.errors import CellError, UnknownName
from cell.setting import BadSetting


def test_default_file_is_what_the_code_says() -> None:
    """The file that users copy from cannot drift from the defaults."""
    text = (CONFIG_FOLDER / "default.yaml").read_text()
    assert text == f"{HEADER}{commented_yaml(CellConfig())}\n", "run `make models`"


def test_default_file_changes_nothing() -> None:
    """Writing and reading every value is lossless."""
    assert CellConfig.load("default") == CellConfig()


def test_every_value_in_the_default_file_has_a_comment() -> None:
    lines = (CONFIG_FOLDER / "default.yaml").read_text().splitlines()
    for above, line in zip(lines, lines[1:], strict=False):
        if ": " in line and not line.lstrip().startswith("#"):
            assert above.lstrip().startswith("# "), line


def test_layers_code_then_file_then_override(tmp_path: Path) -> None:
    """A partial file keeps the other defaults; an override beats the file."""
    file = tmp_path / "mine.yaml"
    file.write_text("simulation:\n  time_step: 5e-4\n  log_period: 0.02\nmotion:\n")
    config = CellConfig.load(file, ["simulation.log_period=0.05"])
    assert config.simulation.time_step == 5e-4
    assert config.simulation.log_period == 0.05
    assert config.simulation.contact_approximation == "lagged"
    assert config.motion == CellConfig().motion


def test_overrides_as_mapping_and_as_text_agree() -> None:
    texts = ["workcell.p_WJ=[0.1, 0, 0.2]", "workcell.jig_base_fixed=false", "jig.soil.damping=2e4"]
    values = {
        "workcell.p_WJ": (0.1, 0, 0.2),
        "workcell.jig_base_fixed": False,
        "jig.soil.damping": 2e4,
    }
    config = CellConfig.load(overrides=texts)
    assert config == CellConfig.load(overrides=values)
    assert config.workcell.p_WJ == (0.1, 0.0, 0.2)
    assert not config.workcell.jig_base_fixed


def test_later_override_counts() -> None:
    overrides = ["simulation.time_step=1e-3", "simulation.time_step=2e-3"]
    assert CellConfig.load(overrides=overrides).simulation.time_step == 2e-3


@given(st.floats(min_value=1e-6, max_value=5e-3))
def test_any_valid_time_step_is_kept_exactly(time_step: float) -> None:
    config = CellConfig.load(overrides=[f"simulation.time_step={time_step!r}"])
    assert config.simulation.time_step == time_step


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("simulation.time_step=0", r"'simulation.time_step' must be > 0 and <= 0.005 s, not 0\."),
        ("simulation.time_step=0.01", "must be > 0 and <= 0.005 s, not 0.01"),
        ("simulation.time_step=-1e-3", "must be > 0"),
        ("simulation.time_step=fast", "must be a number > 0 and <= 0.005 s, not fast"),
        ("simulation.time_step=.nan", "must be a number"),
        ("simulation.time_step=true", "must be a number"),
        ("simulation.time_step=", "must be a number"),
        ("simulation.log_period=.inf", "must be a number"),
        ("motion.max_iterations=1.5", "must be a whole number"),
        ("simulation.contact_approximation=tamsi", "must be one of lagged, similar, sap"),
        ("workcell.jig_base_fixed=maybe", "must be true or false"),
        ("workcell.p_WJ=[0, 1]", r"must be a list of 3 numbers, for example \[0, 0.15, 0.2\]"),
        ("workcell.p_WJ=[0, 1, high]", r"'workcell.p_WJ\[2\]' must be a number"),
        ("left_arm.damping=[1, 1, 1, 1, 1, 0]", r"'left_arm.damping\[5\]' must be > 0"),
        ("jig.vacuum.pressure=-1", "'jig.vacuum.pressure' must be >= 0, not -1"),
        ("jig.jammed.squeeze=1e-4", "'jig.jammed.squeeze' must be <= 0"),
        ("simulation=3", "'simulation' is a section; it holds time_step"),
        ("simulation.time_step", "written key=value"),
        ("=3", "written key=value"),
        ("simulation.time_step=[1", "cannot read the value"),
    ],
)
def test_impossible_value_is_one_clear_line(override: str, message: str) -> None:
    with pytest.raises(BadSetting, match=message) as caught:
        CellConfig.load(overrides=[override])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "nearest"),
    [
        ("simulation.time_stp", "simulation.time_step"),
        ("simulaton.time_step", "simulation.time_step"),
        ("time_step", "simulation.time_step"),
        ("jig.soil.dampin", "jig.soil.damping"),
    ],
)
def test_unknown_key_names_the_nearest(key: str, nearest: str) -> None:
    with pytest.raises(UnknownName, match=f"Did you mean '{nearest}'"):
        CellConfig.load(overrides=[f"{key}=1"])


def test_path_below_a_value_is_refused() -> None:
    """A value has no keys of its own."""
    with pytest.raises(CellError):
        CellConfig.load(overrides=["simulation.time_step.seconds=1"])
    with pytest.raises(BadSetting, match="'time_step' is not a section"):
        parse_overrides(["simulation.time_step=1", "simulation.time_step.seconds=1"])


def test_unknown_file_lists_the_known() -> None:
    with pytest.raises(UnknownName, match="Known: default"):
        CellConfig.load("defualt")
    with pytest.raises(UnknownName, match="nowhere.yaml"):
        CellConfig.load("nowhere.yaml")


@pytest.mark.parametrize("text", ["- 1\n- 2\n", "simulation: [\n", "3"])
def test_file_that_holds_no_sections_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with pytest.raises(BadSetting, match="bad.yaml") as caught:
        CellConfig.load(file)
    assert "\n" not in str(caught.value)


def test_configuration_is_frozen_and_loading_makes_a_new_one() -> None:
    config = CellConfig()
    with pytest.raises(FrozenInstanceError):
        config.simulation.time_step = 1.0  # type: ignore[misc]
    assert changed(config, {"simulation": {"time_step": 2e-3}}) != config
    assert config == CellConfig()


def test_dictionary_of_a_configuration_builds_it_again() -> None:
    """What result.json records is enough to repeat the run."""
    config = CellConfig.load(overrides=["simulation.time_step=5e-4", "workcell.tray_yaw_deg=3"])
    recorded = yaml.safe_load(yaml.safe_dump(_plain(config.to_dict())))
    assert changed(CellConfig(), recorded) == config


def _plain(value):
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return list(value) if isinstance(value, tuple) else value


def test_poses_compose_from_their_numbers() -> None:
    """X_WT turns the tray about the vertical by the stated angle."""
    overrides = ["workcell.tray_yaw_deg=90", "workcell.p_WT=[1, 2, 3]"]
    workcell = CellConfig.load(overrides=overrides).workcell
    np.testing.assert_allclose(workcell.X_WT @ np.array([1.0, 0.0, 0.0]), [1.0, 3.0, 3.0])
