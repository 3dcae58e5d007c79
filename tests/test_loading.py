"""Input validation of products: units, soundness, errors that name culprit and alternatives."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from step_files import StepFile

from cell.errors import BadOrder, BadPart, InputError, UnknownName
from cell.products.assembly_io import DEFLECTION, FACET_ANGLE
from cell.products.loading import load_product, product_names
from cell.products.mesh_io import MESH_SUFFIXES
from cell.products.read_options import ReadOptions

GOOD = """
name: pair
parts:
  block: {mesh: block.stl, mass_kg: 0.1}
  peg: {mesh: peg.stl, mass_kg: 0.02, assembled_pose: {xyz_mm: [0, 0, 20], rpy_deg: [0, 0, 90]}}
orders: [[block, peg]]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a 20 mm cube and a 5 x 5 x 30 mm peg, drawn in millimetres."""
    trimesh.creation.box((20, 20, 20)).export(tmp_path / "block.stl")
    trimesh.creation.box((5, 5, 30)).apply_translation([0, 0, 25]).export(tmp_path / "peg.stl")
    (tmp_path / "notes.txt").write_text("other files are ignored")
    return tmp_path


@pytest.mark.parametrize("name", product_names())
def test_own_products_can_be_simulated(name: str) -> None:
    load_product(name).check_simulable()


def test_parts_that_cannot_be_simulated_are_named(folder: Path) -> None:
    """A part of mesh and mass alone, and one with a model but without a place in the tray."""
    text = GOOD.replace("peg.stl, mass_kg: 0.02", "bolt_m3x10")
    text = text.replace("mesh: bolt_m3x10", "model: bolt_m3x10")
    product = load_product(write(folder, text))
    with pytest.raises(InputError, match="planned, but not assembled") as caught:
        product.check_simulable()
    assert "for block: a contact model; for block, peg: a place in the tray" in str(caught.value)


def write(folder: Path, text: str) -> Path:
    file = folder / "pair.yaml"
    file.write_text(text)
    return file


def test_motor_unit_is_complete() -> None:
    product = load_product("motor_unit")
    bolts = tuple(f"bolt_{k}" for k in range(1, 7))
    assert tuple(product.parts) == ("motor", "plate", *bolts)
    assert product.items() == ("motor", "plate", "bolts")
    assert product.orders == (("motor", "plate", "bolts"), ("plate", "bolts", "motor"))
    assert product.members("bolts") == tuple(product.screws) == bolts
    assert (product.up, product.contact_tolerance) == ("+z", pytest.approx(5e-5))
    for part in product.parts.values():
        assert part.mesh.is_volume and part.model and part.X_TrayP and part.grasps
    for k, name in enumerate(bolts):
        x, y, z = product.parts[name].X_AP.translation()
        assert np.hypot(x, y) == pytest.approx(15.5e-3)
        assert np.rad2deg(np.arctan2(y, x)) % 360 == pytest.approx(60 * k, abs=1e-4)
        assert z == pytest.approx(5e-3)


@pytest.mark.parametrize("product", ["motor_unit", "idler"])
def test_grasps_close_on_the_part(product: str) -> None:
    """Both points at half the width from the jaw's axis, along its x, lie on the surface.

    In the middle of the pads or 5 mm ahead of it: they reach 7 mm or more ahead.
    """
    for part in load_product(product).parts.values():
        for grasp in part.grasps:
            offsets = []
            for ahead in (0.0, 5e-3):
                ends = [grasp.X_PJaw @ np.array([s * grasp.width / 2, 0, ahead]) for s in (-1, 1)]
                closest = trimesh.proximity.closest_point_naive(part.mesh, np.array(ends))[1]
                offsets.append(np.max(closest))
            assert min(offsets) < 2e-5  # Sagitta of the drawn 64 and 96 facets: 7 to 10 um.


def test_yaml_reads_units_poses_and_masses(folder: Path) -> None:
    product = load_product(write(folder, GOOD))
    peg = product.parts["peg"]
    assert product.name == "pair"
    assert peg.mass == 0.02
    np.testing.assert_allclose(peg.mesh.extents, [5e-3, 5e-3, 30e-3], atol=1e-9)
    np.testing.assert_allclose(peg.X_AP.translation(), [0, 0, 0.02])
    np.testing.assert_allclose(peg.X_AP.rotation().matrix()[:, 0], [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(("units", "size"), [("mm", 0.02), ("cm", 0.2)])
def test_folder_is_a_product_in_assembled_pose(folder: Path, units: str, size: float) -> None:
    product = load_product(folder, ReadOptions(units=units))
    assert list(product.parts) == ["block", "peg"]
    np.testing.assert_allclose(product.parts["block"].mesh.extents, [size] * 3)
    assert product.parts["peg"].mesh.centroid[2] == pytest.approx(25 / 20 * size)
    assert product.orders == () and product.groups == {}


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_every_supported_type_is_read(tmp_path: Path, suffix: str) -> None:
    """GLB is in metres by its specification, the others state no unit."""
    scale = 1e-3 if suffix == ".glb" else 1.0
    cube = trimesh.creation.box((20 * scale,) * 3)
    cube.export(tmp_path / f"cube{suffix}")
    part = load_product(tmp_path, ReadOptions(None if suffix == ".glb" else "mm")).parts["cube"]
    assert part.mesh.is_volume
    np.testing.assert_allclose(part.mesh.extents, [0.02] * 3, rtol=1e-6)


def test_inward_surface_is_turned_outwards(tmp_path: Path) -> None:
    cube = trimesh.creation.box((20, 20, 20))
    cube.invert()
    cube.export(tmp_path / "cube.ply")
    assert load_product(tmp_path, ReadOptions("mm")).parts["cube"].mesh.volume == pytest.approx(
        8e-6
    )


def test_unknown_product_names_the_nearest() -> None:
    with pytest.raises(UnknownName, match="Did you mean 'motor_unit'"):
        load_product("motor_unti")


def test_unsupported_input_lists_what_is(folder: Path) -> None:
    (folder / "pair.iges").write_text("")
    with pytest.raises(InputError, match=r"not a product; supported: .*yaml.*folder of meshes"):
        load_product(folder / "pair.iges")
    with pytest.raises(InputError, match="does not exist"):
        load_product(folder / "nowhere" / "thing.iges")
    with pytest.raises(InputError, match="No product file"):
        load_product(folder / "nowhere" / "thing.step")


def test_unknown_unit_lists_the_known(folder: Path) -> None:
    with pytest.raises(UnknownName, match="No unit 'mn'.*cm, in, m, mm"):
        load_product(folder, ReadOptions("mn"))
    with pytest.raises(InputError, match="states its own units"):
        load_product(write(folder, GOOD), ReadOptions("cm"))


@pytest.mark.parametrize(
    ("units", "scale", "remark"),
    [
        ("m", 1.0, "block, peg up to 30 m long: planned, but nothing here can hold more than 1 m"),
        ("in", 1.0, None),
        ("mm", 1e-3, "block down to 20 micrometres long: wrong units?"),
    ],
)
def test_size_has_no_limits_in_planning_but_is_remarked(
    tmp_path: Path, units: str, scale: float, remark: str | None
) -> None:
    for name, size in (("block", (20, 20, 20)), ("peg", (5, 5, 30 if scale == 1.0 else 900))):
        trimesh.creation.box(scale * np.array(size)).export(tmp_path / f"{name}.stl")
    product = load_product(tmp_path, ReadOptions(units=units))
    said = [note for note in product.notes if " long: " in note]
    assert (remark is None and not said) or (remark is not None and remark in said[0])
    assert len(said) <= 1


def test_what_nothing_can_hold_is_not_assembled(folder: Path) -> None:
    """The limit on size belongs to execution."""
    trimesh.creation.box((2000, 20, 20)).export(folder / "block.stl")
    with pytest.raises(BadPart, match=r"'block'.*2 m long: nothing here can hold it \(1 m at most"):
        load_product(write(folder, GOOD)).check_simulable()


def test_unsound_meshes_are_refused(tmp_path: Path) -> None:
    cube = trimesh.creation.box((20, 20, 20))
    hole = trimesh.Trimesh(cube.vertices, cube.faces[:-1])
    flat = trimesh.Trimesh(
        [[0, 0, 0], [10, 0, 0], [0, 10, 0]], [[0, 1, 2], [0, 2, 1]], process=False
    )
    for mesh, reason in [(hole, "not watertight"), (flat, "no volume|not watertight")]:
        mesh.export(tmp_path / "part.obj")
        with pytest.raises(BadPart, match=f"'part'.*({reason})"):
            load_product(tmp_path, ReadOptions("mm"))
    (tmp_path / "part.obj").write_text("v 0 0\nf nonsense\n")
    with pytest.raises(BadPart, match="'part'"):
        load_product(tmp_path, ReadOptions("mm"))


def test_empty_and_ambiguous_folders_are_refused(folder: Path, tmp_path: Path) -> None:
    trimesh.creation.box((5, 5, 5)).export(folder / "peg.obj")
    with pytest.raises(BadPart, match="'peg'.*two files"):
        load_product(folder, ReadOptions("mm"))
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(InputError, match="no mesh; supported: .obj"):
        load_product(empty)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass_kg: 0.1", "mass_kg: -0.1", "parts.block.mass_kg: expected a number"),
        ("mass_kg: 0.1", "mass_kg: 0", "parts.block.mass_kg: expected a number"),
        ("mass_kg: 0.1", "mass_kg: heavy", "parts.block.mass_kg: expected a number"),
        ("mass_kg: 0.1", "mas_kg: 0.1", "parts.block.*Did you mean 'mass_kg'"),
        ("mesh: block.stl, ", "", "'block'.*'model' or a 'mesh'"),
        ("mesh: block.stl", "mesh: blok.stl", "'block'.*no mesh file"),
        ("mesh: block.stl, mass_kg: 0.1", "model: moter", "No model 'moter'.*'motor'"),
        ("mesh: block.stl", "model: motor, mesh: block.stl", "'block'.*either"),
        ("mesh: block.stl", "model: motor", "'block'.*remove 'mass_kg'"),
        ("peg: {mesh", "block: {mesh", "'block' occurs twice"),
        ("xyz_mm: [0, 0, 20]", "xyz_mm: [0, 20]", "assembled_pose.xyz_mm.*three numbers"),
        ("peg: {mesh", "peg: {tray_pose: {xyz_mm: [0, 0, 20000]}, mesh", "outside of the cell"),
        ("xyz_mm: [0, 0, 20]", "xyz_mm: [0, 0, .nan]", "expected a number"),
        ("name: pair", "name: pair\nup: up", "No axis 'up'"),
        ("name: pair", "name: pair\nunits: furlong", "No unit 'furlong'"),
        ("name: pair", "name: pair\ncolour: red", "called 'colour'"),
        ("name: pair", "name: [pair", "not valid YAML"),
        ("parts:", "groups: {both: [block, pegg]}\nparts:", "No part 'pegg'.*'peg'"),
        ("parts:", "groups: {both: []}\nparts:", "'both' has no parts"),
        ("peg: {mesh", "1: {mesh", "the key 1 is not a name"),
        ("peg: {mesh", "[a, b]: {mesh", "a key is a name"),
        ("orders: [[block, peg]]", "orders: {a: b}", "pair.yaml: orders: expected a list"),
        ("parts:", "groups: {peg: [block]}\nparts:", "both a part and a group"),
        ("parts:", "groups: {a: [peg], b: [peg]}\nparts:", "'peg' is in 'a' and 'b'"),
    ],
)
def test_malformed_product_is_refused(folder: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(InputError, match=message):
        load_product(write(folder, GOOD.replace(old, new, 1)))


@pytest.mark.parametrize("order", ["[block]", "[block, peg, peg]"])
def test_order_lists_every_part_once(folder: Path, order: str) -> None:
    with pytest.raises(BadOrder, match="block, peg"):
        load_product(write(folder, GOOD.replace("[[block, peg]]", f"[{order}]")))


def test_malformed_grasp_is_refused(folder: Path) -> None:
    grasp = (
        "grasps: [{name: a, jaw: tip, at_mm: [0, 0, 0], closing: [1, 0, 0], "
        "approach: [1, 0, 1], width_mm: 5, force_N: 4}]"
    )
    text = GOOD.replace("mass_kg: 0.1", f"mass_kg: 0.1, {grasp}")
    with pytest.raises(InputError, match="block.grasps.0.*not perpendicular"):
        load_product(write(folder, text))
    good = text.replace("approach: [1, 0, 1]", "approach: [0, 0, 1]")
    with pytest.raises(UnknownName, match="No jaw 'tipp'"):
        load_product(write(folder, good.replace("jaw: tip", "jaw: tipp")))
    with pytest.raises(InputError, match="grasps.0..closing: the zero vector"):
        load_product(write(folder, good.replace("closing: [1, 0, 0]", "closing: [0, 0, 0]")))
    assert load_product(write(folder, good)).parts["block"].grasps[0].force == 4.0


@pytest.mark.parametrize("radius", [0.3, 1.0, 6.0])
def test_step_is_tessellated_as_finely_as_the_tolerance_asks_for(radius, tmp_path):
    """The coarser the limits, the fewer the facets: at most about half as far apart as allowed."""
    file = StepFile()
    file.product("rod", "ADVANCED_BREP_SHAPE_REPRESENTATION", [file.world(), file.rod(radius, 3.0)])
    (tmp_path / "rod.step").write_text(file.text())
    mesh = load_product(tmp_path / "rod.step").parts["rod"].mesh
    facets = int((np.abs(mesh.vertices[:, 2]) < 1e-9).sum())
    step = min(FACET_ANGLE, 2.0 * np.arccos(1.0 - DEFLECTION / radius))
    assert 2.0 * np.pi / step <= facets <= 2.2 * 2.0 * np.pi / step


def test_a_given_tolerance_makes_step_coarser_but_not_by_more_than_a_tenth_of_it(tmp_path):
    file, radius = StepFile(), 40.0
    file.product("rod", "ADVANCED_BREP_SHAPE_REPRESENTATION", [file.world(), file.rod(radius, 3.0)])
    (tmp_path / "rod.step").write_text(file.text())
    fine, coarse = (
        load_product(tmp_path / "rod.step", ReadOptions(tolerance=tolerance)).parts["rod"].mesh
        for tolerance in (1e-5, 1e-3)
    )
    assert len(fine.faces) > 2.5 * len(coarse.faces)
    for mesh, deflection in ((fine, DEFLECTION), (coarse, 0.1)):
        facets = int((np.abs(mesh.vertices[:, 2]) < 1e-9).sum())
        assert radius * (1.0 - np.cos(np.pi / facets)) <= deflection
