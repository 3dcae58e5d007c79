"""The configuration: three layers, every value checked, every mistake named."""

import copy
import pickle
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from cell.configuration.config import ArmConfig, CellConfig
from cell.configuration.config_file import parse_overrides
from cell.configuration.frozen_dict import FrozenDict
from cell.configuration.sections import changed
from cell.errors import CellError, InputError, UnknownName
from cell.fixtures.soft_jig.parameters import BadJig
from cell.setting import BadSetting

# Layers.


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
    assert config == CellConfig.load(overrides=values) == CellConfig().with_changes(values)
    assert config.workcell.p_WJ == (0.1, 0.0, 0.2)
    assert not config.workcell.jig_base_fixed


def test_later_override_counts() -> None:
    overrides = ["simulation.time_step=1e-3", "simulation.time_step=2e-3"]
    assert CellConfig.load(overrides=overrides).simulation.time_step == 2e-3


# Mistakes.


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("simulation.time_step=0", r"'simulation.time_step' must be > 0 and <= 0.005 s, not 0\."),
        ("simulation.time_step=0.01", "must be > 0 and <= 0.005 s, not 0.01"),
        ("simulation.time_step=-1e-3", "must be > 0"),
        ("simulation.time_step=fast", "must be a number > 0 and <= 0.005 s, not 'fast'"),
        ("simulation.time_step=.nan", "must be a number"),
        ("simulation.time_step=true", "must be a number"),
        ("simulation.time_step=", "must be a number"),
        ("simulation.log_period=.inf", "must be > 0 and <= 10 s, not inf"),
        ("motion.max_iterations=1.5", "must be a whole number"),
        ("motion.max_iterations=.inf", "must be >= 1"),
        ("simulation.contact_approximation=tamsi", "must be one of lagged, similar, sap"),
        ("workcell.jig_base_fixed=maybe", "must be true or false"),
        ("workcell.fixture=3", "'workcell.fixture' must be text"),
        ("workcell.p_WJ=[0, 1]", r"must be a list of 3 numbers, for example \[0, 0.15, 0.2\]"),
        ("workcell.p_WJ=[0, 1, high]", r"'workcell.p_WJ\[2\]' must be a number"),
        ("arms.left.damping=[1, 1, 1, 1, 1, 0]", r"'arms.left.damping\[5\]' must be > 0"),
        ("arms.left.damping=5", "'arms.left.damping' must be a list of numbers, not 5"),
        ("arms.left=5", "'arms.left' is a section; it holds model, tool, p_WB"),
        ("arms=5", "'arms' is a section; it holds left, right"),
        ("jig.vacuum.pressure=-1", "'jig.vacuum.pressure' must be >= 0 and <= 101325 Pa, not -1"),
        ("jig.vacuum.pressure=2e5", "must be >= 0 and <= 101325 Pa, not 200000"),
        ("jig.vacuum.jam_fraction=1", "must be >= 0 and < 1, not 1"),
        ("jig.jammed.squeeze=1e-4", "'jig.jammed.squeeze' must be >= -0.001 and <= 0 m"),
        ("jig.jammed.strength=.inf", "'jig.jammed.strength' must be .* <= 1000, not inf"),
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
    assert isinstance(caught.value, InputError)


@pytest.mark.parametrize(
    ("override", "culprit"),
    [
        ("jig.bag.cap_height=0.13", "cap_height"),
        ("jig.bag.floor=0.05", "jig.bag.floor"),
    ],
)
def test_numbers_of_the_bag_that_contradict_each_other(override: str, culprit: str) -> None:
    with pytest.raises(BadJig, match=culprit) as caught:
        CellConfig.load(overrides=[override])
    assert isinstance(caught.value, InputError)


@pytest.mark.parametrize(
    ("key", "nearest"),
    [
        ("simulation.time_stp", "simulation.time_step"),
        ("simulaton.time_step", "simulation.time_step"),
        ("time_step", "simulation.time_step"),
        ("jig.soil.dampin", "jig.soil.damping"),
        ("arms.left.modle", "arms.left.model"),
        ("arms.rigth.home_deg", "arms.right.home_deg"),
    ],
)
def test_unknown_key_names_the_nearest(key: str, nearest: str) -> None:
    with pytest.raises(UnknownName, match=f"Did you mean '{nearest}'"):
        CellConfig.load(overrides=[f"{key}=1"])


def test_unknown_arm_lists_those_that_exist() -> None:
    with pytest.raises(UnknownName, match=r"'arms.middle.model'.*arms\.left, .*arms\.right"):
        CellConfig.load(overrides=["arms.middle.model=ur5e"])


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
    with pytest.raises(InputError, match="bad.yaml") as caught:
        CellConfig.load(file)
    assert "\n" not in str(caught.value)


# Arms by name.


def test_one_value_of_one_arm_changes(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("arms:\n  left:\n    p_WB: [-0.5, 0, 0]\n")
    config = CellConfig.load(file, ["arms.left.model=ur10e"])
    assert config.arms["left"].model == "ur10e"
    assert config.arms["left"].p_WB == (-0.5, 0.0, 0.0)
    assert config.arms["left"].tool == CellConfig().arms["left"].tool
    assert config.arms["right"] == CellConfig().arms["right"]
    assert list(config.arms) == ["left", "right"]


def test_joint_settings_have_any_length_and_can_be_emptied_again() -> None:
    seven = CellConfig.load(overrides={"arms.left.home_deg": [0, 10, 20, 30, 40, 50, 60]})
    assert seven.arms["left"].home_deg == (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
    assert seven.with_changes(["arms.left.home_deg=[]"]) == CellConfig()


def test_arms_cannot_be_changed_in_place() -> None:
    arms = CellConfig().arms
    assert isinstance(arms, FrozenDict)
    for change in (
        lambda: arms.update(left=ArmConfig()),
        lambda: arms.pop("left"),
        lambda: arms.clear(),
        lambda: arms.__setitem__("left", ArmConfig()),
        lambda: arms.__delitem__("left"),
        lambda: arms.setdefault("top", ArmConfig()),
        lambda: arms.__ior__({"top": ArmConfig()}),
    ):
        with pytest.raises(TypeError, match="cannot be changed"):
            change()
    assert arms == CellConfig().arms


def test_arms_given_as_a_dictionary_are_frozen() -> None:
    given_arms = dict(CellConfig().arms)
    config = replace(CellConfig(), arms=given_arms)
    given_arms.clear()
    assert config == CellConfig()
    assert hash(config) == hash(CellConfig())


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda config: pickle.loads(pickle.dumps(config))]
)
def test_configuration_survives_copying(copied) -> None:
    config = CellConfig.load(overrides=["arms.left.model=ur10e"])
    assert copied(config) == config
    assert isinstance(copied(config).arms, FrozenDict)


# As a value.


def test_configuration_is_frozen_and_loading_makes_a_new_one() -> None:
    config = CellConfig()
    with pytest.raises(FrozenInstanceError):
        config.simulation.time_step = 1.0  # type: ignore[misc]
    assert changed(config, {"simulation": {"time_step": 2e-3}}) != config
    assert config == CellConfig()


def test_dictionary_of_a_configuration_builds_it_again() -> None:
    """What result.json records is enough to repeat the run."""
    overrides = ["simulation.time_step=5e-4", "workcell.tray_yaw_deg=3", "arms.right.p_WB=[1,0,0]"]
    config = CellConfig.load(overrides=overrides)
    recorded = yaml.safe_load(yaml.safe_dump(_plain(config.to_dict())))
    assert changed(CellConfig(), recorded) == config


def _plain(value):
    if type(value) is dict:
        return {key: _plain(item) for key, item in value.items()}
    return list(value) if isinstance(value, tuple) else value


def test_poses_compose_from_their_numbers() -> None:
    """X_WT turns the tray about the vertical by the stated angle."""
    overrides = ["workcell.tray_yaw_deg=90", "workcell.p_WT=[1, 2, 1]"]
    workcell = CellConfig.load(overrides=overrides).workcell
    np.testing.assert_allclose(workcell.X_WT @ np.array([1.0, 0.0, 0.0]), [1.0, 3.0, 1.0])
