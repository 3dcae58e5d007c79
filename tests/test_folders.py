"""Folders of CAD: every file and object becomes a part, or is named as left out with the reason."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold
from step_files import StepTree
from tiny_products import box, to_trimesh

from cell.errors import BadPart, InputError
from cell.products.loading import load_product, require_product_file
from cell.products.product import LeftOut
from cell.products.read_options import ReadOptions
from experiments.cli.main import main

CUBE, SLAB = box((10, 10, 10), (0, 0, 0)), box((40, 20, 5), (0, 0, -5))
MM = ReadOptions("mm")


def in_mm(shape: Manifold) -> trimesh.Trimesh:
    return to_trimesh(shape).apply_scale(1e3)


def write_step(file: Path, unit: str = "mm", **parts: Manifold) -> None:
    step = StepTree(unit)
    products = [("", step.part(name, shape), (0.0, 0.0, 0.0)) for name, shape in parts.items()]
    if len(products) > 1:
        step.assembly("root", *products)
    file.write_text(step.text())


def write_obj(file: Path, tag: str, shapes: Mapping[str, Manifold]) -> None:
    """Objects (o) or groups (g), listed one after the other."""
    text, count = "", 1
    for name, shape in shapes.items():
        mesh = in_mm(shape)
        text += f"{tag} {name}\n" + "".join("v {} {} {}\n".format(*v) for v in mesh.vertices)
        text += "".join("f {} {} {}\n".format(*(face + count)) for face in mesh.faces)
        count += len(mesh.vertices)
    file.write_text(text)


@pytest.fixture
def mixed(tmp_path: Path) -> Path:
    """STL, STEP of one and of two solids, and what is no CAD."""
    in_mm(SLAB).export(tmp_path / "plate.stl")
    (tmp_path / "plate.stl").rename(tmp_path / "PLATE.STL")
    write_step(tmp_path / "pin_b.StEp", unnamed=CUBE)
    write_step(
        tmp_path / "clamp.stp", jaw=CUBE.translate([10, 0, 0]), screw=CUBE.translate([20, 0, 0])
    )
    for name in ("readme.txt", "photo.png", "draft.3mf", ".hidden"):
        (tmp_path / name).write_text("")
    (tmp_path / "old").mkdir()
    return tmp_path


def test_a_folder_may_mix_meshes_and_assemblies(mixed: Path) -> None:
    product = load_product(mixed, MM)
    assert set(product.parts) == {"PLATE", "pin_b", "clamp/jaw", "clamp/screw"}
    for name, part in product.parts.items():
        size = [40e-3, 20e-3, 5e-3] if name == "PLATE" else [10e-3] * 3
        np.testing.assert_allclose(part.mesh.extents, size, rtol=1e-6)


def test_what_is_no_cad_is_named_but_for_hidden_files(mixed: Path) -> None:
    left_out = {thing.name: thing.reason for thing in load_product(mixed, MM).left_out}
    other = "not a mesh or STEP file"
    assert left_out == {
        "readme.txt": other,
        "photo.png": other,
        "draft.3mf": other,
        "old/": "a sub-folder: plan it by itself",
    }


def test_the_plan_says_what_was_left_out(mixed: Path, capsys: pytest.CaptureFixture) -> None:
    options = ["--units", "mm", "--no-html", "--no-cache", "--out", str(mixed / "out")]
    main(["plan", str(mixed), *options])
    printed = capsys.readouterr()
    assert (
        "Note: left out: draft.3mf, photo.png, readme.txt (not a mesh or STEP file)" in printed.out
    )
    assert printed.err == ""
    remarks = json.loads((mixed / "out" / "plan.json").read_text())["evidence"]["remarks"]
    assert any(remark.startswith("left out: old/") for remark in remarks)


def test_a_file_may_be_left_out_by_its_name(mixed: Path) -> None:
    (mixed / "broken.obj").write_text("v 0 0\nf nonsense\n")
    with pytest.raises(BadPart, match="'broken'"):
        load_product(mixed, MM)
    out = ("broken.obj", "clamp/jaw", "PLATE")
    product = load_product(mixed, ReadOptions("mm", leave_out=out))
    assert set(product.parts) == {"pin_b", "clamp/screw"}
    assert {t.name for t in product.left_out if t.reason == "by --leave-out"} == set(out)


def test_files_keep_the_unit_that_they_state(tmp_path: Path) -> None:
    """--units is for those that state none, and overrides where there are none of these."""
    write_step(tmp_path / "pin.step", "in", pin=CUBE)
    assert load_product(tmp_path).parts["pin"].mesh.extents[0] == pytest.approx(0.254)
    product = load_product(tmp_path, MM)
    assert product.parts["pin"].mesh.extents[0] == pytest.approx(0.01)
    assert "warning: 'pin.step' states in, and is taken as mm" in " ".join(product.notes)
    in_mm(SLAB).export(tmp_path / "plate.stl")
    product = load_product(tmp_path, MM)
    assert product.parts["pin"].mesh.extents[0] == pytest.approx(0.254)
    assert product.parts["plate"].mesh.extents[0] == pytest.approx(0.04)
    assert "'pin.step' is in in, as it states; --units mm is for" in " ".join(product.notes)


@pytest.mark.parametrize(("states", "units", "size"), [("m", "mm", 0.01), ("mm", "in", 0.254)])
def test_units_override_an_assembly_with_its_places(states, units, size, tmp_path: Path) -> None:
    write_step(tmp_path / "a.step", states, one=CUBE, two=CUBE.translate([30, 0, 0]))
    product = load_product(tmp_path / "a.step", ReadOptions(units))
    np.testing.assert_allclose(product.parts["two"].mesh.bounds[0], [3 * size, 0, 0], atol=1e-8)
    assert f"states {states}, and is taken as {units}" in product.notes[0]
    same = load_product(tmp_path / "a.step", ReadOptions(states))
    assert not any("taken as" in note and "states" in note for note in same.notes)


def test_bodies_of_a_file_are_said_or_split(tmp_path: Path) -> None:
    feet = [CUBE.translate([20.0 * k, 0, 0]) for k in range(4)]
    trimesh.util.concatenate([in_mm(foot) for foot in feet]).export(tmp_path / "feet.stl")
    in_mm(SLAB).export(tmp_path / "plate.stl")
    product = load_product(tmp_path, MM)
    assert list(product.parts) == ["feet", "plate"]
    assert "feet holds 4 separate bodies; --split makes them parts" in product.notes
    split = load_product(tmp_path, ReadOptions("mm", split=True))
    assert list(split.parts) == ["feet_1", "feet_2", "feet_3", "feet_4", "plate"]
    assert not any("--split" in note for note in split.notes)
    assert split.parts["feet_3"].mesh.bounds[0][0] == pytest.approx(0.04)
    fewer = load_product(tmp_path, ReadOptions("mm", split=True, leave_out=("feet_2",)))
    assert list(fewer.parts) == ["feet_1", "feet_3", "feet_4", "plate"]


def test_split_takes_no_name_that_a_file_has(tmp_path: Path) -> None:
    two = [in_mm(CUBE), in_mm(CUBE.translate([50, 0, 0]))]
    trimesh.util.concatenate(two).export(tmp_path / "foot.stl")
    in_mm(SLAB).export(tmp_path / "foot_1.stl")
    product = load_product(tmp_path, ReadOptions("mm", split=True))
    assert list(product.parts) == ["foot_1", "foot_2", "foot_3"]
    assert 1e9 * product.parts["foot_1"].mesh.volume == pytest.approx(4000)


def test_bodies_that_touch_along_an_edge_are_closed(tmp_path: Path) -> None:
    touching = [in_mm(CUBE), in_mm(CUBE.translate([10, 10, 0]))]
    trimesh.util.concatenate(touching).export(tmp_path / "stack.stl")
    product = load_product(tmp_path, MM)
    assert product.parts["stack"].mesh.is_volume and product.left_out == ()
    assert "stack holds 2 bodies, of which some touch; --split makes them parts" in product.notes


def test_bodies_that_overlap_are_united_in_one_part(tmp_path: Path) -> None:
    trimesh.util.concatenate([in_mm(CUBE), in_mm(SLAB.translate([0, 0, 2]))]).export(
        tmp_path / "welded.stl"
    )
    product = load_product(tmp_path, MM)
    assert "welded holds 2 bodies that overlap, united; --split" in " ".join(product.notes)
    assert 1e9 * product.parts["welded"].mesh.volume == pytest.approx(1000 + 4000 - 200, rel=1e-5)


@pytest.mark.parametrize("tag", ["o", "g"])
def test_objects_of_a_file_keep_their_names(tag: str, tmp_path: Path) -> None:
    two = CUBE.translate([50, 0, 0]) + CUBE.translate([80, 0, 0])
    shapes = {"left plate": SLAB, "pin": CUBE, "rest": two}
    write_obj(tmp_path / "all.obj", tag, shapes)
    assert "all holds 4 bodies, of which some touch" in " ".join(load_product(tmp_path, MM).notes)
    split = load_product(tmp_path / "all.obj", ReadOptions("mm", split=True))
    assert list(split.parts) == ["left_plate", "pin", "rest_1", "rest_2"]
    assert 1e9 * split.parts["left_plate"].mesh.volume == pytest.approx(4000)


def test_groups_that_are_faces_of_a_body_are_no_parts(tmp_path: Path) -> None:
    mesh = in_mm(CUBE)
    lines = ["v {} {} {}".format(*v) for v in mesh.vertices]
    for k, face in enumerate(mesh.faces + 1):
        lines += [f"g face{k}", "f {} {} {}".format(*face)]
    (tmp_path / "cube.obj").write_text("\n".join(lines) + "\n")
    product = load_product(tmp_path, ReadOptions("mm", split=True))
    assert list(product.parts) == ["cube"] and product.left_out == ()


def test_an_open_mesh_among_solids_is_left_out(tmp_path: Path) -> None:
    in_mm(SLAB).export(tmp_path / "plate.stl")
    whole = in_mm(CUBE)
    trimesh.Trimesh(whole.vertices, whole.faces[1:], process=False).export(tmp_path / "pin.ply")
    trimesh.PointCloud(whole.vertices).export(tmp_path / "scan.ply")
    product = load_product(tmp_path, MM)
    assert list(product.parts) == ["plate"]
    reasons = {thing.name: thing.reason for thing in product.left_out}
    assert reasons["pin"].startswith("not watertight: 3 open edges, one of them at (")
    assert reasons["scan"] == "no faces"
    same = load_product(tmp_path, ReadOptions("mm", leave_out=("pin",)))
    assert LeftOut("pin", "by --leave-out") in same.left_out


def test_shapes_in_other_files_are_read_from_beside_the_assembly(tmp_path: Path) -> None:
    """In any case of letters; the file is then no part by itself, and is named if it is missing."""
    car = StepTree()
    wheel, hub = car.part("wheel"), car.part("hub", CUBE)
    car.refer(wheel, r"C:\models\wheel.stp")
    car.assembly("car", ("", wheel, (0, 0, 30)), ("", wheel, (0, 0, 60)), ("", hub, (0, 0, 0)))
    (tmp_path / "car.step").write_text(car.text())
    (missing,) = {thing.reason for thing in load_product(tmp_path / "car.step").left_out}
    assert missing == r"its shape is in 'C:\models\wheel.stp', which is not beside 'car.step'"
    write_step(tmp_path / "Wheel.STP", disc=SLAB)
    for product in (load_product(tmp_path / "car.step"), load_product(tmp_path)):
        assert list(product.parts) == ["hub", "wheel_1", "wheel_2"]
        heights = [product.parts[f"wheel_{k}"].mesh.bounds[1][2] for k in (1, 2)]
        np.testing.assert_allclose(heights, [30e-3, 60e-3], atol=1e-8)
    said = LeftOut("Wheel.STP", "read as part of car.step, which refers to it")
    assert load_product(tmp_path).left_out == (said,)


def test_assembling_cad_says_what_works(mixed: Path, capsys: pytest.CaptureFixture) -> None:
    for given, needs in ((mixed, " with --units mm"), (mixed / "clamp.stp", "")):
        with pytest.raises(InputError, match="can be planned, but not assembled"):
            require_product_file(given)
        assert main(["assemble", str(given), "--out", str(mixed / "out")]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert f"soft-jig init{needs} drafts a product file" in line
        assert not (mixed / "out").exists()


def test_options_for_cad_are_refused_for_a_product_file() -> None:
    for options in (ReadOptions(split=True), ReadOptions(depth=1), ReadOptions(leave_out=("x",))):
        with pytest.raises(InputError, match="motor_unit.yaml' lists its parts and groups itself"):
            load_product("motor_unit", options)
