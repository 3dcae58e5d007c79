"""Whatever a user brings: STEP assemblies, meshes in need of repair, identical parts, bad input."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold
from step_files import step_assembly
from tiny_products import box, product_of, rod, to_trimesh

import cell.products.loading as loading
from cell.errors import BadPart, InputError, UnknownName
from cell.products.identical import handedness, identical_parts
from cell.products.loading import DEFAULT_DENSITY, load_product
from cell.products.read_options import ReadOptions
from experiments.cli.main import main

PLATE = box((40, 40, 10), (-20, -20, 0)) - rod(6, -1, 11, 32) - rod(6, -1, 11).translate([12, 0, 0])
PIN = rod(6, 0, 20, 32)
INSTANCES: list[tuple[str, str, tuple[float, float, float]]] = [
    ("base", "plate", (5.0, 0.0, 0.0)),
    ("NAUO2", "pin", (5.0, 0.0, 0.0)),
]
INSTANCES += [("pin", "pin", (17.0, 0.0, 0.0))]


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))


def step_file(folder: Path, unit: str = "mm") -> Path:
    scale = 1.0 if unit == "mm" else 1e-3
    shapes = {"plate": PLATE.scale([scale] * 3), "pin": PIN.scale([scale] * 3)}
    places = [(n, s, (scale * x, scale * y, scale * z)) for n, s, (x, y, z) in INSTANCES]
    file = folder / "asm.step"
    file.write_text(step_assembly(shapes, places, unit))
    return file


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_step_keeps_names_instances_and_units(tmp_path: Path, unit: str) -> None:
    """A made-up instance name gives way to the product's; the second of a name gets a number."""
    product = load_product(step_file(tmp_path, unit))
    assert list(product.parts) == ["base", "pin", "pin_2"]
    base = product.parts["base"].mesh
    assert base.volume == pytest.approx(1e-9 * PLATE.volume(), rel=1e-5)
    np.testing.assert_allclose(base.bounds, [[-15e-3, -20e-3, 0], [25e-3, 20e-3, 10e-3]], atol=1e-7)
    places = sorted(round(1e3 * product.parts[name].mesh.centroid[0]) for name in ("pin", "pin_2"))
    assert places == [5, 17]
    assert all(part.mesh.is_volume for part in product.parts.values())


def test_step_assembly_is_planned(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file, out = step_file(tmp_path), tmp_path / "out"
    options = ["--order", "base,pins", "--group", "--out", str(out), "--no-cache"]
    assert main(["plan", str(file), *options]) == 0
    printed = capsys.readouterr()
    assert "pins = pin, pin_2" in printed.out and "taken as 2700 kg/m3" in printed.out
    assert (out / "plan.json").exists() and printed.err == ""


def test_gltf_keeps_names_and_poses(tmp_path: Path) -> None:
    """Two nodes of one shape."""
    pin = trimesh.creation.box((0.004, 0.004, 0.01))
    scene = trimesh.Scene()
    for name, x in (("left pin", -0.01), ("right pin", 0.01)):
        pose = trimesh.transformations.translation_matrix([x, 0, 0])
        scene.add_geometry(pin, node_name=name, geom_name="pin", transform=pose)
    scene.export(tmp_path / "pins.glb")
    product = load_product(tmp_path / "pins.glb")
    assert list(product.parts) == ["left_pin", "right_pin"]
    assert product.parts["right_pin"].mesh.centroid[0] == pytest.approx(0.01)
    assert product.parts["left_pin"].mesh.volume == pytest.approx(pin.volume)
    small = load_product(tmp_path / "pins.glb", ReadOptions("mm"))
    np.testing.assert_allclose(small.parts["left_pin"].mesh.extents, [4e-6, 4e-6, 1e-5], rtol=1e-5)
    assert (
        "warning: 'pins.glb' states m, and is taken as mm, because --units says so" in small.notes
    )


@pytest.mark.parametrize("suffix", ["step", "glb"])
@pytest.mark.parametrize("text", ["", "ISO-10303-21; rubbish", "\0\1\2"])
def test_a_broken_assembly_file_is_one_line(tmp_path: Path, text: str, suffix, capfd) -> None:
    """The readers' own complaints stay off the terminal."""
    (tmp_path / f"bad.{suffix}").write_text(text)
    assert main(["plan", str(tmp_path / f"bad.{suffix}"), "--out", str(tmp_path / "out")]) == 2
    printed = capfd.readouterr()
    assert printed.out == "" and f"bad.{suffix}' " in printed.err and printed.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_densities_are_of_parts_or_of_all(tmp_path: Path) -> None:
    file = step_file(tmp_path)
    plain = load_product(file)
    product = load_product(file, ReadOptions(densities={"": 1000.0, "base": 7850.0}))
    volume = {name: float(part.mesh.volume) for name, part in product.parts.items()}
    assert product.parts["base"].mass == pytest.approx(7850.0 * volume["base"])
    assert product.parts["pin"].mass == pytest.approx(1000.0 * volume["pin"])
    assert plain.parts["pin"].mass == pytest.approx(DEFAULT_DENSITY * volume["pin"])
    assert any("density of all parts" in remark for remark in plain.remarks)
    assert not any("density" in remark for remark in product.remarks)
    with pytest.raises(UnknownName, match="No part 'bas'.*'base'"):
        load_product(file, ReadOptions(densities={"bas": 1.0}))
    with pytest.raises(InputError, match="above zero"):
        load_product(file, ReadOptions(densities={"": 0.0}))


def cube() -> trimesh.Trimesh:
    return trimesh.creation.box((20, 20, 20))


def exported(mesh: trimesh.Trimesh, folder: Path) -> Path:
    mesh.export(folder / "cube.ply")
    return folder


def test_duplicated_corners_are_welded_and_said(tmp_path: Path) -> None:
    """Every face with corners of its own, off by 20 nanometres."""
    corners = cube().triangles.reshape(-1, 3)
    corners = corners + np.random.default_rng(0).uniform(-2e-5, 2e-5, corners.shape)
    soup = trimesh.Trimesh(corners, np.arange(36).reshape(-1, 3), process=False)
    product = load_product(exported(soup, tmp_path), ReadOptions("mm"))
    mesh = product.parts["cube"].mesh
    assert mesh.is_volume and len(mesh.vertices) == 8
    assert mesh.volume == pytest.approx(8e-6, rel=1e-6)
    assert any("'cube' repaired: " in r and "welded" in r for r in product.remarks)


def test_doubled_and_turned_faces_are_repaired_and_said(tmp_path: Path) -> None:
    whole = cube()
    doubled = trimesh.Trimesh(
        whole.vertices, np.vstack([whole.faces, whole.faces[:3]]), process=False
    )
    product = load_product(exported(doubled, tmp_path), ReadOptions("mm"))
    assert any("3 degenerate or doubled faces removed" in r for r in product.remarks)
    faces = np.array(whole.faces)
    faces[4] = faces[4][::-1]
    product = load_product(
        exported(trimesh.Trimesh(whole.vertices, faces, process=False), tmp_path), ReadOptions("mm")
    )
    assert product.parts["cube"].mesh.volume == pytest.approx(8e-6)
    assert any("turned outwards" in r for r in product.remarks)


def test_a_hole_is_not_guessed_shut(tmp_path: Path) -> None:
    open_cube = trimesh.Trimesh(cube().vertices, cube().faces[1:], process=False)
    with pytest.raises(BadPart, match=r"'cube'.*not watertight: 3 open edges, one of them at \("):
        load_product(exported(open_cube, tmp_path), ReadOptions("mm"))


def test_identical_parts_are_found_in_any_pose() -> None:
    bolt = rod(3, 0, 10, 32) + rod(6, 10, 13, 32)
    hook = box((10, 4, 2), (0, 0, 0)) + box((3, 4, 9), (0, 0, 0)) + box((3, 9, 2), (7, 0, 0))
    shapes = {
        "bolt_1": bolt,
        "hook_a": hook,
        "bolt_2": bolt.rotate([10, 20, 30]).translate([30, 0, 0]),
        "longer": rod(3, 0, 10.5, 32) + rod(6, 10.5, 13.5, 32),
        "hook_b": hook.rotate([-50, 0, 120]),
        "mirrored": hook.mirror([1, 0, 0]),
    }
    meshes = {name: to_trimesh(shape) for name, shape in shapes.items()}
    assert identical_parts(meshes) == [("bolt_1", "bolt_2"), ("hook_a", "hook_b")]
    assert handedness(meshes["hook_a"]) == -handedness(meshes["mirrored"]) != 0.0
    assert handedness(meshes["bolt_1"]) == 0.0


def test_grouping_is_opt_in_and_keeps_declared_groups(tmp_path: Path) -> None:
    file = step_file(tmp_path)
    assert load_product(file).groups == {}
    assert any("identical parts: pin, pin_2" in r for r in load_product(file).remarks)
    assert load_product(file, ReadOptions(group=True)).groups == {"pins": ("pin", "pin_2")}
    bolts = load_product("motor_unit", ReadOptions(group=True))
    assert list(bolts.groups) == ["bolts"] and bolts.remarks == ()


def folder_of(folder: Path, shapes: dict[str, Manifold]) -> Path:
    """Meshes in millimetres."""
    for name, mesh in product_of(shapes).parts.items():
        mesh.mesh.copy().apply_scale(1e3).export(folder / f"{name}.stl")
    return folder


LOW, HIGH = box((20, 20, 20), (0, 0, 0)), box((20, 20, 20), (0, 0, 20))


@pytest.mark.parametrize(("up", "fixed"), [("+z", "+z / low"), ("-z", "+z / high")])
def test_up_is_an_option_where_no_file_states_it(tmp_path: Path, up, fixed, capsys) -> None:
    folder_of(tmp_path, {"low": LOW, "high": HIGH})
    options = ["--units", "mm", "--order", "low,high", f"--up={up}", "--no-html"]
    assert main(["plan", str(tmp_path), "--out", str(tmp_path / "out"), *options]) == 0
    assert fixed in capsys.readouterr().out


@pytest.mark.parametrize(
    ("shapes", "options", "code", "message"),
    [
        ({}, ["--units", "mm"], 2, "holds no mesh; supported: .obj"),
        ({"low": LOW, "high": HIGH}, [], 2, "states no unit of length: add --units"),
        ({"low": LOW, "high": HIGH}, ["--units", "m"], 0, "high, low up to 20 m long.*wrong units"),
        ({"low": LOW, "high": HIGH}, ["--units", "feet"], 2, "No unit 'feet'"),
        ({"low": LOW, "high": HIGH}, ["--units", "mm"], 0, "Tolerance 0.05 mm, by default"),
        ({"low": LOW}, ["--units", "mm"], 0, "'low' is the only part: there is nothing"),
        ({"low": LOW, "high": HIGH}, ["--units", "mm", "--group"], 0, "'highs' is the only item"),
        (
            {"low": LOW, "high": HIGH.translate([0, 0, 3])},
            ["--units", "mm", "--order", "low,high"],
            1,
            "high, low touch no other part",
        ),
        (
            {"low": LOW, "high": HIGH.translate([1, 1, -2])},
            ["--units", "mm"],
            1,
            r"1 pair overlaps(.|\n)*high, low: 2 mm deep at",
        ),
        ({"low": LOW, "high": HIGH}, ["--units", "mm", "--order", "low"], 2, "lacks high"),
        ({"low": LOW, "high": HIGH}, ["--units", "mm", "--up", "z"], 2, "No up axis 'z'"),
        ({"low": LOW, "high": HIGH}, ["--units", "mm", "--order", "low,low"], 2, "repeats low"),
        ({"low": LOW, "high": HIGH}, ["--units", "mm", "--density", "x"], 2, "--density x: write"),
        ({"low": LOW, "high": HIGH}, ["--units", "mm", "--tolerance-mm", "0"], 2, "from 1e-6"),
    ],
)
def test_bad_input_is_one_line_and_an_answer_has_its_warning(
    shapes, options, code, message, tmp_path: Path, capsys
) -> None:
    """Exit 2 with one line and nothing written, or an answer that says what is odd."""
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    folder_of(folder, shapes)
    assert main(["plan", str(folder), "--out", str(out), *options]) == code
    printed = capsys.readouterr()
    assert re.search(message, printed.err if code == 2 else printed.out)
    assert printed.err.count("\n") == (1 if code == 2 else 0)
    assert out.exists() == (code != 2)


def test_two_files_of_one_name_and_broken_files_are_refused_by_name(tmp_path, capsys) -> None:
    folder_of(tmp_path, {"low": LOW, "high": HIGH})
    (tmp_path / "low.obj").write_text("v 0 0\nf nonsense\n")
    assert main(["plan", str(tmp_path), "--units", "mm", "--out", str(tmp_path / "out")]) == 2
    (tmp_path / "low.stl").unlink()
    assert main(["plan", str(tmp_path), "--units", "mm", "--out", str(tmp_path / "out")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2 and all("Part 'low'" in line for line in lines)


def test_many_parts_are_planned_with_a_remark(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(loading, "MANY_PARTS", 1)
    folder_of(tmp_path, {"low": LOW, "high": HIGH})
    notes = load_product(tmp_path, ReadOptions("mm")).notes
    assert "2 parts: matrices of more than 1 take minutes" in notes
