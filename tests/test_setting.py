"""Every setting is declared once: range, unit, meaning and source; two files follow from it."""

import math
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from cell.configuration.__main__ import GENERATED
from cell.configuration.config import CellConfig
from cell.configuration.config_file import CONFIG_FOLDER
from cell.configuration.sections import Entry, entries
from cell.fixtures.soft_jig.parameters import BadJig, BagParameters
from cell.setting import BadSetting, Setting, setting

ENTRIES = list(entries(CellConfig()))
NUMBERS = [entry for entry in ENTRIES if entry.info.numeric]
SCALARS = [entry for entry in NUMBERS if isinstance(entry.info.default, float)]
TAGS = ("[S]", "[R]", "[M]", "[D]", "[A]")


def path_of(entry: Entry) -> str:
    return entry.path


def ends(info: Setting) -> tuple[float, float]:
    """Return the lower and the upper end of a range, open or closed."""
    lower = info.at_least if info.above is None else info.above
    upper = info.at_most if info.below is None else info.below
    assert lower is not None and upper is not None
    return lower, upper


def at_path(config: CellConfig, path: str) -> object:
    return {entry.path: entry.value for entry in entries(config)}[path]


# Declarations.


@pytest.mark.parametrize("entry", ENTRIES, ids=path_of)
def test_every_setting_says_what_it_is_and_where_it_comes_from(entry: Entry) -> None:
    info = entry.info
    assert info.meaning[0].isupper() and info.meaning.endswith(".")
    assert "\n" not in info.meaning + info.source
    assert info.source.startswith(TAGS) and info.source.endswith(".")
    assert len(info.source) > len("[A] .")


@pytest.mark.parametrize("entry", NUMBERS, ids=path_of)
def test_every_number_has_a_range_with_two_ends_and_a_default_inside(entry: Entry) -> None:
    info = entry.info
    assert (info.above is None) != (info.at_least is None)
    assert (info.below is None) != (info.at_most is None)
    lower, upper = ends(info)
    assert lower < upper
    assert math.isfinite(lower)
    values = entry.value if isinstance(entry.value, tuple) else [entry.value]
    assert all(info.holds(value) for value in values)


def test_only_the_visual_period_may_be_infinite() -> None:
    unbounded = [entry.path for entry in NUMBERS if ends(entry.info)[1] == math.inf]
    assert unbounded == ["jig.visual_period"]
    assert CellConfig.load(overrides=["jig.visual_period=.inf"]) == CellConfig()


def test_field_without_a_declaration_is_an_error() -> None:
    @dataclass(frozen=True)
    class Careless:
        speed: float = 1.0

    with pytest.raises(TypeError, match="Careless.speed is not declared"):
        list(entries(Careless()))


def test_nearest_valid_number_is_valid() -> None:
    info = Setting(0.5, "", "A share.", "[A] None.", above=0.0, below=1.0)
    for number in (-1.0, 0.0, 0.3, 1.0, 7.0):
        assert info.holds(info.nearest(number))
    assert info.nearest(0.3) == 0.3


@settings(deadline=None)  # A busy machine is no failure.
@given(st.sampled_from(SCALARS), st.floats(0.0, 1.0))
def test_any_number_in_its_range_is_kept_exactly(entry: Entry, share: float) -> None:
    lower, upper = ends(entry.info)
    number = entry.info.nearest(lower + share * (min(upper, 1e3) - lower))
    try:
        config = CellConfig.load(overrides={entry.path: number})
    except BadJig:
        return  # Valid by itself, and not beside the other numbers of the bag.
    assert at_path(config, entry.path) == number


@given(st.sampled_from(SCALARS), st.floats(min_value=1e-9, max_value=1e12), st.booleans())
def test_any_number_out_of_its_range_is_refused_in_one_line(
    entry: Entry, beyond: float, high: bool
) -> None:
    lower, upper = ends(entry.info)
    if high and upper == math.inf:
        return
    number = upper + beyond if high else lower - beyond
    if entry.info.holds(number):
        return  # Rounded to the end itself.
    with pytest.raises(BadSetting) as caught:
        CellConfig.load(overrides={entry.path: number})
    assert str(caught.value).startswith(f"'{entry.path}' must be {entry.info.range_text()}")
    assert "\n" not in str(caught.value)


# Generated files.


@pytest.mark.parametrize("file", GENERATED, ids=lambda file: file.name)
def test_generated_file_is_what_the_code_says(file: Path) -> None:
    """What users copy and read cannot drift from the declarations."""
    assert file.read_text(encoding="utf-8") == GENERATED[file](), "run `make models`"


def test_default_file_changes_nothing() -> None:
    """Writing and reading every value is lossless."""
    written = yaml.safe_load((CONFIG_FOLDER / "default.yaml").read_text())
    assert CellConfig.load("default") == CellConfig()
    assert written.keys() == CellConfig().to_dict().keys()


def test_every_value_in_the_default_file_has_a_comment() -> None:
    lines = (CONFIG_FOLDER / "default.yaml").read_text().splitlines()
    for above, line in zip(lines, lines[1:], strict=False):
        if ": " in line and not line.lstrip().startswith("#"):
            assert above.lstrip().startswith("# "), line


def test_every_setting_is_in_the_table() -> None:
    (table,) = (content() for file, content in GENERATED.items() if file.suffix == ".md")
    for entry in ENTRIES:
        (row,) = (line for line in table.splitlines() if line.startswith(f"| `{entry.path}` |"))
        assert entry.info.source in row


def test_setting_is_the_default_of_its_field() -> None:
    @dataclass(frozen=True)
    class Careful:
        speed: float = setting(1.0, "m/s", "Speed.", "[A] Own choice.", above=0.0, at_most=2.0)

    assert Careful().speed == 1.0
    (entry,) = entries(Careful())
    assert (entry.path, entry.value, entry.info.unit) == ("speed", 1.0, "m/s")
    assert BagParameters().volume == pytest.approx(296e-6, rel=0.01)
