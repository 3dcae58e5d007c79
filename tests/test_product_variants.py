"""Product variants: what a table changes, and the differences that are found."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from drawn_products import covered_block

from cell import load_product
from cell.errors import InputError
from cell.products.read_options import ReadOptions
from experiments import product_variants
from experiments.product.random_drawing import write_cad
from experiments.studies.variant_input import read_table, write_variant

MM = ReadOptions(units="mm")


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of STL: a block, its cover of 5 mm, and two screws."""
    return write_cad(covered_block(), tmp_path_factory.mktemp("cad") / "block")


LINES = """variant,cover.z,cover.dz,screw_1.dz,screw_2.dz
same,,,,
thick,6,,1,1
sunk,,-2.5,,
"""


def table(folder: Path, text: str) -> Path:
    file = folder / "table.csv"
    file.write_text(text)
    return file


@pytest.fixture(scope="module")
def study(block: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Path, dict]:
    """Return exit code, folder and result of a study with the variants of `LINES`, and a twin."""
    folder = tmp_path_factory.mktemp("study")
    out, twin = folder / "out", write_cad(covered_block(), folder / "twin")
    lone = write_cad({"block": covered_block()["block"]}, folder / "lone")
    options = ["--units", "mm", "--table", str(table(folder, LINES)), "--order"]
    options += ["block,cover,screw_1,screw_2", "--junit", str(out / "variants.xml"), "--quiet"]
    code = product_variants.main([str(block), str(twin), str(lone), *options, "--out", str(out)])
    return code, out, json.loads((out / "variants.json").read_text())


def differences(study: tuple[int, Path, dict], name: str) -> dict[tuple[str, str], dict]:
    found = study[2]["differences"]
    return {
        (d["where"].removeprefix(f"{name}: "), d["quantity"]): d
        for d in found
        if d["where"].startswith(f"{name}: ")
    }


def test_dimension_changes_one_extent_of_one_part(block: Path, tmp_path: Path) -> None:
    """The low end stays; a shift moves the whole part; everything else is as it was."""
    folder = write_variant(block, {"cover.z": 7, "screw_1.dz": 2}, tmp_path / "new", MM)
    old, new = load_product(block, MM), load_product(folder)
    for name, part in old.parts.items():
        now = new.parts[name].mesh.bounds
        expected = part.mesh.bounds.copy()
        if name == "cover":
            expected[1, 2] = expected[0, 2] + 0.007
        if name == "screw_1":
            expected[:, 2] += 0.002
        np.testing.assert_allclose(now, expected, atol=1e-8)  # Floats of 32 bits in the file.


def test_value_of_a_product_file_is_changed(tmp_path: Path) -> None:
    changes = {"joints.0.torque_Nm": 0.3, "parts.post.grasps.0.force_N": 20}
    product = load_product(write_variant("idler", changes, tmp_path / "new", ReadOptions()))
    assert product.screws["bolt_1"].torque == pytest.approx(0.3)
    assert product.parts["post"].grasps[0].force == 20
    assert product.screws["bolt_2"].torque == pytest.approx(0.3)  # Of the same joint.
    assert (
        product.parts["arm"].grasps[0].force == load_product("idler").parts["arm"].grasps[0].force
    )


def test_same_product_under_another_name_does_not_differ(study: tuple[int, Path, dict]) -> None:
    """Neither does a line of the table without a change; with the base they are one trial."""
    _, out, result = study
    assert not differences(study, "same") and not differences(study, "twin")
    assert result["compared"] > 100
    assert len(list((out / "trials").glob("*.json"))) == 4


def test_thicker_cover_is_named_with_what_it_changes(study: tuple[int, Path, dict]) -> None:
    """The plan stays; screws and cover end 1 and 0.5 mm higher, and so does what is carried."""
    found = differences(study, "thick")
    changed = found["add screw_1", "cog_height_m"]
    assert 0.0 < changed["variant"] - changed["base"] < 0.001
    assert not any(where == "plan" for where, _ in found)
    assert 'name="thick: add screw_1"' in (study[1] / "variants.xml").read_text()
    assert "thick" in (study[1] / "variants.html").read_text()


def test_part_in_the_way_changes_plan_and_verdict(study: tuple[int, Path, dict]) -> None:
    """The cover is sunk by half into the block."""
    found = differences(study, "sunk")
    assert {("variant", "verdict"), ("plan", "feasible")} <= set(found)
    about = study[2]["variants"]["sunk"]
    assert about["phase"] == "plan" and "cover" in about["evidence"]


def test_variant_without_a_part_of_the_order_comes_to_no_verdict(
    study: tuple[int, Path, dict],
) -> None:
    """It is named, and the others are compared all the same."""
    code, out, result = study
    assert (code, result["verdict"]) == (3, "error")
    assert "cover" in result["variants"]["lone"]["evidence"]
    assert 'name="lone"' in (out / "variants.xml").read_text()


@pytest.mark.parametrize(
    ("options", "culprit"),
    [
        (["idler"], "VARIANT"),
        (["idler", "nosuch"], "nosuch"),
        (["idler", "motor_unit", "--order", "post,lid"], "'lid'"),
        (["idler", "motor_unit", "motor_unit"], "motor_unit"),
    ],
)
def test_bad_option_is_named_before_any_trial(
    options: list[str], culprit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert product_variants.main([*options, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert culprit in error and error.count("\n") == 1
    assert not (tmp_path / "out" / "trials").exists()


@pytest.mark.parametrize(
    ("text", "culprit"),
    [
        ("name,cover.z\na,1\n", "first line"),
        ("variant,cover.z\n", "no variant"),
        ("variant,cover.z\na,1\na,2\n", "line 3: 'a'"),
        ("variant,cover.z\n../a,1\n", "'../a'"),
        ("variant,cover.z\na,1,2\n", "3 cells, not 2"),
    ],
)
def test_bad_table_is_named(text: str, culprit: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        read_table(table(tmp_path, text))
    assert culprit in str(refused.value)


@pytest.mark.parametrize(
    ("changes", "culprit"),
    [
        ({"lid.z": 1}, "'lid'"),
        ({"cover.r": 1}, "'r'"),
        ({"cover.z": 0}, "cover.z"),
        ({"cover.z": "thick"}, "cover.z"),
    ],
)
def test_bad_dimension_is_named(changes: dict, culprit: str, block: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=culprit):
        write_variant(block, changes, tmp_path / "new", MM)
    assert not (tmp_path / "new").exists()


def test_bad_key_of_a_product_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="joints.0.torque' 'torque'.*torque_Nm"):
        write_variant("idler", {"joints.0.torque": 1}, tmp_path / "new", ReadOptions())
