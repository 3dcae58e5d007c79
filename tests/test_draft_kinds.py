"""Kinds of parts that drafts have met in CAD of others: domed heads, low hubs, thin bases, pins."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from drawn_products import covered_block, meshes
from manifold3d import Manifold
from pydrake.geometry import Box
from pydrake.math import RigidTransform

from cell.cad.motor_unit import mesh
from cell.cad.nests import stop_nest
from cell.cad.round_features import cylinders_of
from cell.cad.shapes import box, cone, cylinder, hexagon_prism
from cell.cad.slivers import LEAST_FACE, without_slivers
from cell.configuration.config import CellConfig
from cell.errors import RunFailure
from cell.machines.grippers import HAND_E
from cell.products.loading import load_product
from cell.products.product import Part
from cell.products.read_options import ReadOptions
from experiments.cli.main import main
from experiments.product.drawings import screw
from experiments.product.random_drawing import write_cad
from planning.assembly_plan.planner import plan
from planning.fixture_analysis.candidate import FixtureSetup
from planning.product_check.check import bed_findings, plan_findings
from planning.product_check.finding import Level
from planning.product_draft.bed_reach import bed_reach
from planning.product_draft.depth_maps import DepthMaps
from planning.product_draft.draft import DraftOptions, draft_product
from planning.product_draft.grasp_sampling import sample_grasps
from planning.product_draft.grasps import BED_RISE, part_grasps
from planning.product_draft.hand_shape import HandShape, surface
from planning.product_draft.joint_guesses import guess_screws
from planning.product_draft.tray_layout import ScrewRow, lay_out

MM = 1e-3
UP = np.array([0.0, 0.0, 1.0])
CONFIG = CellConfig()
HAND = HandShape(HAND_E)


def read(parts: dict[str, Manifold], folder: Path):  # noqa: ANN201
    return load_product(write_cad(parts, folder), ReadOptions(units="mm"))


# Screws.


def test_the_dome_of_a_pan_head_belongs_to_the_head() -> None:
    """M3 pan head: a low cylinder, and a dome of two cones on it, 2.4 mm high together."""
    block, cover = box((-10, -10, -20), (10, 10, 0)), box((-10, -10, 0), (10, 10, 3))
    block -= cylinder(1.25, -9, 1, 48)
    cover -= cylinder(1.7, -1, 4, 48)
    head = cylinder(2.8, 3.0, 3.8, 48) + cone(2.8, 2.4, 3.8, 4.8, 48) + cone(2.4, 1.4, 4.8, 5.4, 48)
    screws = {"screw": head + cylinder(1.5, -5, 3.0, 48)}
    parts = meshes({"block": block, "cover": cover, **screws})
    found, _ = guess_screws({name: cylinders_of(part) for name, part in parts.items()})
    assert [(s.part, s.head.kind, s.clamps) for s in found] == [("screw", "pan", "cover")]
    assert found[0].head_size[1] == pytest.approx(2.4 * MM, abs=1e-6)


def countersunk() -> dict[str, Manifold]:
    parts = covered_block()
    for number, x in enumerate((-12.0, 12.0), start=1):
        parts["cover"] -= cone(2.25, 4.2, 2.9, 5.01, 48).translate([x, 0, 0])
        head = cone(2.0, 4.0, 2.8, 5.0, 48) - hexagon_prism(2.5, 3.6, 6.0)
        parts[f"screw_{number}"] = (cylinder(2.0, -7.0, 2.8, 48) + head).translate([x, 0, 0])
    return parts


def test_screws_of_an_unknown_kind_are_refused_by_name(tmp_path: Path) -> None:
    product = read(countersunk(), tmp_path)
    found, todo = plan_findings(product, plan(product, config=CONFIG))
    refused = {f.subject: f.text for f in found if f.level is Level.FAILS}
    assert {"screw_1", "screw_2"} <= set(refused)
    assert "screwed into 'block', but it is no screw that is known" in refused["screw_1"]
    assert not todo


def test_a_bolt_with_a_nut_is_named_when_there_is_no_order(tmp_path: Path) -> None:
    """The nut has to be held from below: every order fixes it first."""
    low, high = box((-25, -15, 0), (25, 15, 20)), box((-25, -15, 20), (25, 15, 26))
    parts = {}
    for number, x in enumerate((-15.0, 15.0), start=1):
        low -= (cylinder(2.25, -1, 21, 48) + hexagon_prism(7.3, -1, 4)).translate([x, 0, 0])
        high -= cylinder(2.25, 19, 27, 48).translate([x, 0, 0])
        bolt = cylinder(2.0, -28.0, 0.0, 48) + hexagon_prism(7.0, 0.0, 2.8)
        nut = hexagon_prism(7.0, 0.8, 4.0) - cylinder(1.65, 0, 5, 48)
        parts |= {f"bolt_{number}": bolt.translate([x, 0, 26]), f"nut_{number}": nut}
        parts[f"nut_{number}"] = nut.translate([x, 0, 0])
    product = read({"low": low, "high": high, **parts}, tmp_path)
    with pytest.raises(RunFailure, match="^bolt_1: by its shape it is screwed into 'nut_1'"):
        draft_product(product, tmp_path / "own", DraftOptions())


# Tray.


def sizes_of(piece) -> np.ndarray:  # noqa: ANN001
    assert isinstance(piece.shape, Box)
    return np.array([piece.shape.width(), piece.shape.depth()])


@pytest.mark.parametrize(
    "shape",
    [cylinder(2.1, 0, 20), cylinder(4.0, 0, 30).rotate([0, 90, 0])],
    ids=["thin pin", "lying pin"],
)
def test_a_narrow_part_stands_on_a_pedestal_within_its_foot(shape: Manifold) -> None:
    nest = stop_nest("pin", shape, (10.0, 20.0))
    (pedestal,) = [piece for piece in nest.pieces if piece.name.endswith("pedestal")]
    sizes = sizes_of(pedestal) / MM
    foot = np.array(
        shape.trim_by_plane([0, 0, -1], -(shape.bounding_box()[2] + 0.1)).bounding_box()
    )
    assert np.all(sizes >= 0.4 * (foot[3:5] - foot[:2]))
    assert np.all(sizes < foot[3:5] - foot[:2])


def test_rows_of_unlike_screws_stand_side_by_side_in_front_of_two_shelves() -> None:
    solids = {f"plate_{k}": box((0, 0, 0), (52, 52, 12)) for k in range(4)}
    rows = [ScrewRow(("a", "b"), 3.0, 14.0, 5.5), ScrewRow(("c", "d"), 4.0, 12.0, 7.0)]
    nests = {nest.name: nest for nest in lay_out(solids, rows)}
    a, b, c, d = (nests[name].p_TrayP for name in "abcd")
    assert a[1] == c[1]
    assert max(a[0], b[0]) + 3 * 5.5 / 2 + 3 * 7.0 / 2 < min(c[0], d[0])


# Grasps.


def test_jaws_meet_faces_and_not_the_flank_of_a_shaft() -> None:
    """A jaw beside the middle of a shaft touches it with its edge: it slips off."""
    shaft = mesh(cylinder(4.0, 0, 16, 48))
    maps = DepthMaps.of(shaft, np.column_stack([[1, 0, 0], [0, -1, 0], [0, 0, -1]]))
    along = (-14 * MM, -2 * MM)
    assert maps.grip((-1.5 * MM, 1.5 * MM), along) is not None
    assert maps.grip((3.0 * MM, 6.0 * MM), along) is None


def test_a_low_hub_is_gripped_above_what_stands_around_the_rest() -> None:
    """The hub of a wheel is 4 mm high: jaws between its top and the wheel's."""
    wheel = mesh(cylinder(14.0, 0, 9, 17) + cylinder(6.5, 8.9, 13, 48) - cylinder(4.1, -1, 14, 48))
    nest = mesh(box((-30, -30, -5), (30, 30, 8.9)) - cylinder(14.5, -1, 10))
    found = sample_grasps(wheel, 0.01, HAND, UP, [surface(nest)])
    assert found
    assert all(ranked.grasp.width == pytest.approx(13 * MM, abs=0.2 * MM) for ranked in found)
    # Little of it is touched: pads that are squeezed more than 0.25 mm push it out.
    for ranked in found:
        most = 2.5e-4 * HAND.stiffness(ranked.grasp.jaw) * ranked.area
        assert 5.0 <= ranked.grasp.force < most + 1.0


def test_the_bed_reaches_less_far_up_a_wide_base_than_up_a_narrow_one() -> None:
    setup = FixtureSetup.of(CONFIG)
    wide, narrow = box((-40, -20, 0), (40, 20, 14)), cylinder(17.0, 0, 50)
    assert bed_reach(mesh(wide), "+z", setup) < 5 * MM
    assert 8 * MM < bed_reach(mesh(narrow), "+z", setup) < BED_RISE


def test_a_thin_base_is_gripped_just_above_the_bed() -> None:
    """It is 14 mm high, and no jaw would come lower than 16 beside a part that sinks deep."""
    plate = box((-25, -20, 0), (25, 20, 14))
    base = mesh(plate)
    part = Part("base", base, 0.07, RigidTransform())
    nest = stop_nest("base", plate, (0.0, 0.0))
    part = replace(part, X_TrayP=RigidTransform(MM * nest.p_TrayP))
    assert part_grasps(part, HAND, UP, base=base, earlier={}, nest=nest)[0] == []
    reach = bed_reach(base, "+z", FixtureSetup.of(CONFIG))
    assert part_grasps(part, HAND, UP, base=base, earlier={}, nest=nest, imprint=reach)[0]


# Contact.


def test_corners_a_micrometre_apart_become_one() -> None:
    """Drake takes no normal from a face of 1e-12 m2: the run would end."""
    corners = np.array([[x, y, z] for x in (0.0, 4.0) for y in (0.0, 3.0) for z in (0.0, 2.0)])
    # The last corner is cut off by a micrometre.
    doubled = np.concatenate([corners[:-1], corners[-1] - 1e-3 * np.eye(3)])
    piece = trimesh.convex.convex_hull(doubled)
    assert piece.area_faces.min() < 1e-5
    mended = without_slivers(piece)
    assert mended.area_faces.min() > LEAST_FACE
    assert mended.volume == pytest.approx(24.0, rel=0.01)
    whole = trimesh.convex.convex_hull(corners)
    assert without_slivers(whole) is whole


# What is drawn.


def hung_hub() -> dict[str, Manifold]:
    """A hub on a shaft that ends 1 mm above the shoulder that it should sit on."""
    base = box((-20, -20, -36), (20, 20, 0)) + cylinder(6.0, 0, 8) + cylinder(4.0, 8, 22)
    return {"base": base, "hub": cylinder(10.0, 9, 19) - cylinder(4.08, 8, 20)}


@pytest.mark.parametrize(("lower", "refused"), [(0.0, True), (1.0, False)])
def test_a_part_under_which_nothing_is_drawn_is_refused(
    tmp_path: Path, lower: float, refused: bool
) -> None:
    parts = hung_hub()
    parts["hub"] = parts["hub"].translate([0, 0, -lower])
    draft = draft_product(read(parts, tmp_path), tmp_path / "own", DraftOptions())
    found, _ = plan_findings(draft.product, plan(draft.product, config=CONFIG))
    said = [str(f) for f in found if f.level is Level.FAILS]
    assert any("it comes to rest 1 mm lower" in text for text in said) == refused
    assert bool(said) == refused


def test_screws_and_what_they_clamp_are_borne(tmp_path: Path) -> None:
    parts = covered_block()
    parts["screw_1"] = screw(-12.0, 0.0, 5.0, 4.0, 12.0)
    draft = draft_product(read(parts, tmp_path), tmp_path / "own", DraftOptions())
    found, todo = plan_findings(draft.product, plan(draft.product, config=CONFIG))
    assert todo
    assert not [f for f in found if f.level is Level.FAILS]


def turned_base() -> dict[str, Manifold]:
    """A turned foot with a shaft, and a flange that rests on the foot's shoulder."""
    foot = cylinder(22.0, 0, 14) + cylinder(7.0, 14, 40)
    return {"foot": foot, "flange": cylinder(18.0, 14, 22) - cylinder(7.06, 13, 23)}


def test_the_bed_holds_a_turned_part_by_its_foot_and_not_by_its_shaft(tmp_path: Path) -> None:
    draft = draft_product(read(turned_base(), tmp_path), tmp_path / "own", DraftOptions())
    names = [piece.name for piece in draft.contacts["foot"].pieces]
    assert sorted(name.rpartition("_")[0] for name in names) == ["bed_boss", "boss"]
    assert draft.contacts["foot"].error.more < 0.01


def test_a_fixed_part_that_the_bed_does_not_touch_is_refused(tmp_path: Path) -> None:
    """A straight pin that another part comes over: its contact model is the shaft's."""
    parts = {"pin": cylinder(7.0, 0, 60), "cap": cylinder(12.0, 40, 64) - cylinder(7.06, 39, 60)}
    source, out = write_cad(parts, tmp_path / "cad"), tmp_path / "own"
    order = ["--order", "pin,cap"]
    assert main(["init", str(source), "--units", "mm", "--out", str(out), "--quiet", *order]) == 0
    product = load_product(out / "product.yaml")
    (refused,) = bed_findings(product, plan(product, config=CONFIG), CONFIG)
    assert refused.subject == "pin"
    assert refused.level is Level.FAILS
