"""The trials of a campaign: keys, grids and samples, and what is refused before any of them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import campaign_experiments as experiments
import pytest

from cell import CellConfig
from cell.errors import InputError
from cell.paths import model_folder
from cell.products.loading import PRODUCTS
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.catalogue import BUILT_IN, experiment_named, name_of
from experiments.campaigns.points import combined, grid, parse_grid, parse_sample, sample, trials
from experiments.cli.main import main

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = Path(experiments.__file__)


def test_key_is_that_of_the_numbers_and_the_code() -> None:
    """However a number is written, wherever the trial is listed; anything else changes it."""
    name = experiments.tiny
    (one,) = trials(name, [{"push.speed": 0.25}], seeds=[3])
    (same,) = trials(name, [{"push.speed": "2.5e-1"}], seeds=[3])
    (configured,) = trials(name, config=CellConfig.load("default", ["push.speed=0.25"]), seeds=[3])
    assert one.key == same.key == configured.key
    others = [
        *trials(name, [{"push.speed": 0.25}], seeds=[4]),
        *trials(name, [{"push.speed": 0.26}], seeds=[3]),
        *trials(name, [{"push.speed": 0.25, "hardness": 2}], seeds=[3]),
        *trials(name, [{"push.speed": 0.25}], seeds=[3], product="idler"),
        *trials(experiments.faulty, [{"push.speed": 0.25}], seeds=[3]),
    ]
    assert len({one.key, *(other.key for other in others)}) == 6


def test_key_is_the_same_in_another_process() -> None:
    code = (
        "import sys; sys.path.insert(0, 'tests');"
        "from experiments.campaigns.points import trials;"
        f"print(trials({name_of(experiments.tiny)!r}, [{{'push.speed': 0.1}}])[0].key)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    (here,) = trials(experiments.tiny, [{"push.speed": 0.1}])
    assert done.stdout.strip() == here.key


def test_changed_script_is_another_trial(tmp_path: Path) -> None:
    keys = []
    for number in (1.0, 2.0):
        script = tmp_path / str(number) / "own.py"
        script.parent.mkdir()
        script.write_text(
            "from __future__ import annotations\n"
            "from dataclasses import dataclass\n"
            "from experiments import Outcome\n"
            "@dataclass\nclass Detail:\n    x: float\n"
            f"def own(task):\n    return Outcome(True, {{'x': {number}}})\n"
        )
        keys.append(trials(f"{script}:own")[0].key)
    assert keys[0] != keys[1]


def test_anything_that_a_product_file_says_is_part_of_the_key(tmp_path: Path) -> None:
    """Grip force, order, tolerance, a model's own files: none may be taken for a former trial."""
    text = (PRODUCTS / "idler.yaml").read_text()
    model = tmp_path / "models" / "idler_post" / "idler_post.sdf"
    shutil.copytree(model_folder("idler_post"), model.parent)

    def key(number: int, old: str = "", new: str = "") -> str:
        file = tmp_path / f"{number}.yaml"
        file.write_text(text.replace(old, new, 1) if old else text)
        assert not old or old in text
        return trials(experiments.tiny, product=str(file))[0].key

    keys = [
        key(0),
        key(1, "force_N: 40", "force_N: 30"),
        key(2, "width_mm: 34", "width_mm: 33"),
        key(3, "  - [post, arm, bolts]\n  - [arm, bolts, post]", "  - [arm, bolts, post]"),
        key(4, "contact_tolerance_mm: 0.05", "contact_tolerance_mm: 0.06"),
        key(5, "at_mm: [0, 0, -10]", "at_mm: [0, 0, -11]"),
    ]
    model.write_text(model.read_text() + "<!-- changed -->\n")
    keys.append(key(6))
    assert len(set(keys)) == len(keys)


def test_what_is_listed_twice_is_one_trial() -> None:
    assert len(trials(experiments.tiny, grid({"push.speed": [0.1, 0.1, "0.1"]}))) == 1


def test_samples_fill_their_ranges_evenly() -> None:
    """Each of as many equal slices of each range has one point, in both designs."""
    ranges = {"push.speed": (0.1, 0.3), "jig.vacuum.pressure": (40e3, 90e3)}
    for design in ("sobol", "lhs"):
        points = sample(ranges, 16, design, seed=5)
        assert points == sample(ranges, 16, design, seed=5)
        assert points != sample(ranges, 16, design, seed=6)
        for name, (low, high) in ranges.items():
            slices = {int(16 * (point[name] - low) / (high - low)) for point in points}
            assert slices == set(range(16))


def test_designs_are_combined() -> None:
    points = combined(grid({"case": ["a", "b"]}), sample({"push.speed": (0.1, 0.2)}, 4))
    assert len(points) == 8 and all(set(point) == {"case", "push.speed"} for point in points)
    assert combined(grid({}), sample({}, 4)) == [{}]


@pytest.mark.parametrize("number", [0, -4])
def test_no_samples_are_refused_in_a_program_too(number: int) -> None:
    with pytest.raises(InputError, match="at least 1"):
        sample({"push.speed": (0.1, 0.2)}, number)


def test_grids_and_samples_are_read_from_text() -> None:
    assert parse_grid(["a.b=1,2.5,x", 'order="b,a","a,b"', "flag=true"]) == {
        "a.b": [1, 2.5, "x"],
        "order": ["b,a", "a,b"],
        "flag": [True],
    }
    assert parse_sample(["a=1e-3:2"]) == {"a": (1e-3, 2.0)}


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        (["qqq"], "No experiment 'qqq'. Known: FILE.py:FUNCTION, assemble"),
        ([f"{SCRIPT}:qqq"], "No function in"),
        ([f"{SCRIPT}:with_positional_option"], "option 'option' must come after"),
        (["/no/such/file.py:f"], "No file '/no/such/file.py'"),
        (["push", "--grid", "push.sped=1,2"], "Did you mean 'push.speed'?"),
        (["push", "--grid", "speed=1,2"], "No option of 'push' 'speed'. Known: case, hand"),
        (["push", "--grid", "push.speed=1,fast"], "'push.speed' must be"),
        (["push", "--grid", "push.speed"], "write it like"),
        (["push", "--sample", "push.speed=1"], "write it like"),
        (["push", "--sample", "push.speed=0.3:0.1"], "the first end must be smaller"),
        (["push", "--sample", "push.speed=0.1:0.3", "--samples", "100"], "64 or 128"),
        (["push", "--grid", "push.speed=0.2", "--sample", "push.speed=0.1:0.3"], "both in a grid"),
        (["push", "--seeds", "0"], "--seeds must be from 1 to"),
        (["push", "--seeds", "9" * 30], "--seeds must be from 1 to"),
        (["push", "--samples", "0"], "--samples must be from 1 to"),
        (["push", "--workers", "0"], "--workers must be from 1 to"),
        (["push", "--product", "qqq"], "qqq"),
    ],
)
def test_bad_input_is_one_line_before_any_trial(
    arguments: list[str], culprit: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert main(["sweep", *arguments, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert culprit in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_unknown_executor_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="local, or dask"):
        run_campaign(trials(experiments.tiny), tmp_path, executor="slurm")


@pytest.mark.parametrize("name", BUILT_IN)
def test_named_experiments_exist_and_their_options_have_defaults(name: str) -> None:
    assert experiment_named(name).options
