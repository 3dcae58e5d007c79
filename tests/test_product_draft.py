"""From meshes alone to a product: joints, grasps and tray are recognised, and obey their laws."""

from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from drawn_products import covered_block, meshes, pinned_block
from pydrake.geometry import Box

from cell.cad.nests import PEDESTAL, rail_nest, stop_nest
from cell.cad.round_features import cylinders_of
from cell.cad.shapes import box, cylinder
from cell.errors import InputError, RunFailure, UnknownName
from cell.products.joints import Fit, Rest
from cell.products.loading import load_product
from cell.products.materials import DENSITIES, material_in, material_named
from cell.products.read_options import ReadOptions
from cell.products.screw_table import NUT_FACTOR, SIZES, head_of, size_of
from experiments.cli.main import main
from experiments.product.drawings import box_with_lid, gear_pair, screw
from experiments.product.random_drawing import write_cad
from planning.assembly_plan.planner import plan
from planning.operations.operation import NoOperation
from planning.operations.sequence import steps
from planning.product_draft.draft import Draft, DraftOptions, draft_product
from planning.product_draft.joint_guesses import guess_fits, guess_screws
from planning.product_draft.tray_layout import ScrewRow, lay_out

MM = 1e-3


def drafted(folder: Path, parts: dict, **options: object) -> Draft:  # pyright: ignore
    """Return the draft of parts that are written as STL files first."""
    source = write_cad(parts, folder / "cad")
    cad = load_product(source, ReadOptions(units="mm"))
    return draft_product(cad, folder, DraftOptions(**options))  # pyright: ignore


# Tables.


def test_stress_areas_and_tap_drills_are_those_of_printed_tables() -> None:
    """[R] ISO 898-1 as printed by usefastener.com, from M3 on; drills by nightshade.net."""
    areas = {"M3": 5.03, "M4": 8.78, "M5": 14.2, "M6": 20.1}
    drills = {"M2": 1.6, "M2.5": 2.05, "M3": 2.5, "M4": 3.3, "M5": 4.2, "M6": 5.0}
    for size in SIZES:
        assert size.tap_drill == pytest.approx(drills[size.name])
        assert size.stress_area == pytest.approx(areas.get(size.name, size.stress_area), rel=2e-3)


@pytest.mark.parametrize("size", SIZES, ids=lambda size: size.name)
def test_sizes_of_screws_are_consistent(size) -> None:  # noqa: ANN001
    assert size.diameter < size.clearance_hole < 1.25 * size.diameter
    for head in size.heads:
        assert head.bearing < head.diameter
        assert head.engagement < head.height


def test_torques_are_those_of_tightening_tables() -> None:
    """[R] For friction of 0.14: M3 1.3, M4 3.0, M5 5.9, M6 10.1 N m in class 8.8."""
    known = {"M3": 1.3, "M4": 3.0, "M5": 5.9, "M6": 10.1}
    for size in SIZES:
        if size.name in known:
            torque = size.preload_torque("8.8", NUT_FACTOR)
            assert torque == pytest.approx(known[size.name], rel=0.1)
    with pytest.raises(UnknownName, match="8.8"):
        SIZES[0].preload_torque("8.9", NUT_FACTOR)


def test_size_and_head_are_recognised() -> None:
    size = size_of(3.9)
    assert size is not None
    assert size.name == "M4"
    assert size_of(3.5) is None
    assert head_of(size, 7.0, 4.0)[0].drive == "hex 3"
    assert head_of(size, 8.0, 3.1)[0].drive == "cross 2"


def test_materials_have_names_in_any_spelling() -> None:
    assert material_named("Aluminum") == "aluminium"
    assert material_named("stainless_steel") == "stainless steel"
    assert material_in("brass_bush") == "brass"
    assert material_in("steelworks") is None
    with pytest.raises(UnknownName, match="unobtainium"):
        material_named("unobtainium")


# Joints.


@pytest.mark.parametrize("tap", [1.65, 2.0])
def test_screws_are_recognised_drilled_or_line_to_line(tap: float) -> None:
    features = {name: cylinders_of(m) for name, m in meshes(covered_block(tap)).items()}
    screws, _ = guess_screws(features)
    assert [screw.part for screw in screws] == ["screw_1", "screw_2"]
    one = screws[0]
    assert (one.size.name, one.head.drive, one.into, one.clamps) == (
        "M4", "hex 3", "block", "cover",
    )  # fmt: skip
    assert one.length == pytest.approx(12 * MM, rel=1e-6)
    assert one.thread_depth == pytest.approx(7 * MM, rel=1e-6)
    assert np.allclose(one.p_AoP, [-12 * MM, 0, 5 * MM], atol=1e-8)
    assert guess_fits(features, screws)[0] == []


def test_a_screw_without_a_hole_is_said() -> None:
    parts = meshes({"block": box((-20, -20, -40), (20, 20, 0)), "stray": screw(0, 0, 5, 4, 12)})
    screws, guesses = guess_screws({name: cylinders_of(m) for name, m in parts.items()})
    assert screws == []
    assert "no threaded hole" in str(guesses[0])


def test_a_screw_that_no_bit_fits_is_said() -> None:
    block = box((-20, -20, -40), (20, 20, 0)) - cylinder(3.4, -20.0, 1.0, 64)
    cover = box((-20, -20, 0), (20, 20, 5)) - cylinder(4.5, -1.0, 6.0, 64)
    parts = meshes({"block": block, "cover": cover, "large": screw(0, 0, 5, 8, 20)})
    screws, guesses = guess_screws({name: cylinders_of(m) for name, m in parts.items()})
    assert screws == []
    assert "sizes and bits are known from M2 to M6" in str(guesses[0])


@pytest.mark.parametrize("clearance", [0.02, 0.1, 0.25])
def test_a_fit_has_the_clearance_that_is_drawn(clearance: float) -> None:
    features = {n: cylinders_of(m) for n, m in meshes(pinned_block(clearance)).items()}
    screws, _ = guess_screws(features)
    ((fit,), _) = guess_fits(features, screws)
    assert (fit.shaft, fit.hole) == ("pin", "block")
    assert fit.clearance == pytest.approx(clearance * MM, rel=0.01)
    assert fit.depth == pytest.approx(15.5 * MM, rel=1e-6)


def test_unlike_facets_make_no_clearance() -> None:
    block = box((-9, -9, -9), (9, 9, 0)) - cylinder(4.0, -10, 1, 24)
    parts = meshes({"block": block, "pin": cylinder(4.0, -9, 5, 32)})
    features = {name: cylinders_of(m) for name, m in parts.items()}
    ((fit,), (guess,)) = guess_fits(features, [])
    assert abs(fit.clearance) < 2e-5
    assert guess.confidence < 0.9 or fit.clearance > 5e-6


# Tray.


def bounds(piece) -> tuple[np.ndarray, np.ndarray]:  # noqa: ANN001
    assert isinstance(piece.shape, Box)
    half = np.array([piece.shape.width(), piece.shape.depth(), piece.shape.height()]) / 2
    centre = piece.X_PS.translation()
    return centre - half, centre + half


def overlap(one, other) -> bool:  # noqa: ANN001
    (a_low, a_high), (b_low, b_high) = bounds(one), bounds(other)
    return bool(np.all(np.minimum(a_high, b_high) - np.maximum(a_low, b_low) > 1e-7))


def test_stops_stand_clear_of_the_part_and_of_each_other() -> None:
    solid = box((-20, -10, 5), (20, 10, 25))
    nest = stop_nest("part", solid, (30.0, -40.0))
    stops = [piece for piece in nest.pieces if "stop" in piece.name]
    assert len(stops) == 8
    assert not any(overlap(a, b) for a, b in combinations(stops, 2))
    low = np.array([-20, -10, 5]) + nest.p_TrayP
    high = np.array([20, 10, 25]) + nest.p_TrayP
    assert low[2] == PEDESTAL
    for stop in stops:
        a, b = bounds(stop)
        gap = np.maximum(a / MM - high, low - b / MM).max()
        assert gap == pytest.approx(0.5)


def test_nests_do_not_overlap_and_stay_on_the_tray() -> None:
    solids = {f"part_{k}": box((0, 0, 0), (40, 30, 20)) for k in range(4)}
    rows = [ScrewRow(("a", "b", "c"), 4.0, 12.0, 7.0), ScrewRow(("d",), 3.0, 10.0, 5.5)]
    nests = lay_out(solids, rows)
    assert [nest.name for nest in nests] == ["a", "b", "c", "d", *solids]
    for one, other in combinations([nest for nest in nests if nest.pieces], 2):
        for a, b in product(one.pieces, other.pieces):
            assert not overlap(a, b), f"{a.name}, {b.name}"
    for nest in nests:
        for piece in nest.pieces:
            assert np.all(np.abs(np.concatenate(bounds(piece))[[0, 3]]) < 130 * MM)


def test_screws_hang_by_their_heads() -> None:
    first, second = rail_nest(["a", "b"], 4.0, 12.0, 7.0, (0.0, -80.0))
    ridges = [piece for piece in first.pieces if "ridge" in piece.name]
    inner = min(abs(bounds(r)[k][1] / MM + 80.0) for r in ridges for k in (0, 1))
    assert 2.0 < inner < 3.5
    assert first.p_TrayP[2] == pytest.approx(bounds(ridges[0])[1][2] / MM)
    assert second.p_TrayP[0] - first.p_TrayP[0] > 7.0


def test_a_tray_that_is_too_small_is_said() -> None:
    with pytest.raises(InputError, match=r"too small: 'slab' is 307 mm wide"):
        lay_out({"slab": box((0, 0, 0), (300, 30, 20))}, [])


# The whole.


def test_covered_block_is_drafted_from_its_meshes(tmp_path: Path) -> None:
    draft = drafted(tmp_path, covered_block(), materials={"": "steel"})
    assert draft.base == "block"
    drafted_product = draft.product
    assert drafted_product.orders == (("block", "cover", "screws"),)
    assert drafted_product.parts["cover"].mass == pytest.approx(
        DENSITIES["steel"] * float(drafted_product.parts["cover"].mesh.volume)
    )
    assert Rest("cover", "block") in drafted_product.joints
    found = drafted_product.screws["screw_1"]
    assert (found.thread, found.into, found.clamps) == ("M4", "block", "cover")
    for part in drafted_product.parts.values():
        assert part.grasps
        inertia = trimesh.load_mesh(
            tmp_path / "models" / str(part.model) / f"{part.model}.obj"
        ).moment_inertia
        assert np.all(np.linalg.eigvalsh(inertia) > 0.0)
    reasons = [guess for guess in draft.guesses if not guess.reason]
    assert not reasons


def test_pinned_block_is_drafted_with_the_mouth_where_the_pin_enters(tmp_path: Path) -> None:
    draft = drafted(tmp_path, pinned_block())
    (fit,) = draft.product.joints
    assert isinstance(fit, Fit)
    assert np.allclose(fit.p_AoF, 0.0, atol=1e-7)
    assert fit.depth == pytest.approx(16 * MM, rel=1e-4)
    todo = steps(draft.product, plan(draft.product))
    assert [step.name for step in todo] == ["place block", "insert pin"]


def test_a_lid_goes_in_with_its_lip_and_has_cross_recesses_and_two_passes(tmp_path: Path) -> None:
    product = drafted(tmp_path, box_with_lid()).product
    (rest,) = (joint for joint in product.joints if isinstance(joint, Rest))
    assert (rest.part, rest.on) == ("lid", "box")
    assert rest.depth == pytest.approx(3 * MM, abs=0.15 * MM)
    for found in product.screws.values():
        assert (found.thread, found.drive.name, found.passes) == ("M3", "cross 1", 2)


def test_a_plate_from_the_side_is_refused(tmp_path: Path) -> None:
    """In the best order the box comes to the plate: from the side, either way."""
    product = drafted(tmp_path, box_with_lid(side_plate=True)).product
    with pytest.raises(NoOperation, match="box leaves along .* no operation comes from the side"):
        steps(product, plan(product))


def test_gears_come_over_their_shafts_and_the_bridge_over_both(tmp_path: Path) -> None:
    product = drafted(tmp_path, gear_pair()).product
    fits = {(fit.shaft, fit.hole) for fit in product.fits}
    assert {("shaft_1", "gear_1"), ("shaft_2", "gear_2"), ("shaft_1", "base")} <= fits
    todo = [step.name for step in steps(product, plan(product))]
    assert todo.index("insert gear_2") < todo.index("insert bridge") < todo.index("place bolts")


def test_parts_that_cannot_be_assembled_are_said(tmp_path: Path) -> None:
    apart = {"one": box((0, 0, 0), (10, 10, 10)), "two": box((50, 0, 0), (60, 10, 10))}
    with pytest.raises(RunFailure, match="No order to assemble"):
        drafted(tmp_path, apart)


def test_init_writes_a_product_that_is_read_back(tmp_path: Path) -> None:
    """With a name that YAML would take for something else, and a comment on every guess."""
    parts = {("2e3" if n == "cover" else n): m for n, m in covered_block().items()}
    source = write_cad(parts, tmp_path / "cad")
    out = tmp_path / "my product"
    arguments = ["init", str(source), "--units", "mm", "--out", str(out), "--quiet"]
    assert main([*arguments, "--torque", "0.4", "--material", "2e3=brass"]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["models", "product.yaml"]
    again = load_product(out / "product.yaml")
    assert set(again.parts) == set(parts)
    assert again.screws["screw_2"].torque == 0.4
    assert again.parts["2e3"].mass / float(again.parts["2e3"].mesh.volume) == pytest.approx(
        DENSITIES["brass"], rel=1e-4
    )
    text = (out / "product.yaml").read_text()
    assert "M4 socket cap screw into block" in text
    assert yaml.safe_load(text)["tray"] == "cad_tray"
    before = (out / "product.yaml").read_text()
    assert main([*arguments, "--torque", "0.3"]) == 2
    assert (out / "product.yaml").read_text() == before


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--material", "cardboard"], "cardboard"),
        (["--material", "lid=steel"], "no such part"),
        (["--strength", "9.9"], "9.9"),
        (["--up", "up"], "--up is one of"),
        (["--torque", "-1"], "--torque"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_left(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list[str], said: str
) -> None:
    source = write_cad(covered_block(), tmp_path / "cad")
    out = tmp_path / "out"
    assert main(["init", str(source), "--units", "mm", "--out", str(out), *more]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1
    assert not (out / "product.yaml").exists()
