"""What would fail is said before anything is simulated: one line each, naming part or step."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from drawn_products import covered_block
from manifold3d import Manifold
from pydrake.math import RigidTransform, RotationMatrix

from cell.configuration.config import CellConfig
from cell.products.drives import Drive
from cell.products.joints import Rest, Screw
from cell.products.loading import load_product
from cell.products.product import Grasp, Part, Product
from experiments.assembly.prepare import RunningCell
from experiments.cli.main import main
from experiments.product.drawings import bar_puzzle, bearing_block, box_with_lid
from experiments.product.random_drawing import draw, write_cad
from planning.assembly_plan.planner import plan
from planning.operations.counter_hold import from_the_side
from planning.operations.tighten_bolts.phases import holdable
from planning.product_check.check import (
    borne_torques,
    fixture_choices,
    fixture_findings,
    plan_findings,
    reach_findings,
)
from planning.product_check.finding import Level
from planning.product_check.machine_limits import machine_findings
from planning.product_check.reach import reached_grasps
from planning.product_draft.reach import within_reach

CONFIG = CellConfig()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The product file of a block, a cover and two screws, drafted from meshes."""
    folder = tmp_path_factory.mktemp("covered")
    source = write_cad(covered_block(), folder / "cad")
    out = folder / "own"
    assert main(["init", str(source), "--units", "mm", "--out", str(out), "--quiet"]) == 0
    return out / "product.yaml"


@pytest.fixture(scope="module")
def product(file: Path) -> Product:
    return load_product(file)


def changed(product: Product, name: str, **changes: object) -> Product:
    """Return a product with one part changed."""
    parts = dict(product.parts)
    parts[name] = replace(parts[name], **changes)  # pyright: ignore[reportArgumentType]
    return replace(product, parts=parts)


def said(findings: Iterator, level: Level) -> str:  # pyright: ignore
    """Return the lines of a level."""
    return "\n".join(str(finding) for finding in findings if finding.level is level)


def test_a_part_that_the_fixture_bears_needs_nothing_below() -> None:
    """In the second order the motor comes last, and the plate is brought to it."""
    unit = load_product("motor_unit")
    found, todo = plan_findings(unit, plan(unit, ("plate", "bolts", "motor"), config=CONFIG))
    assert [step.name for step in todo].count("place motor") == 1
    assert all(finding.level is Level.GOOD for finding in found)


def test_a_drafted_product_passes(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(file)]) == 0
    printed = capsys.readouterr().out
    for step in ("place block", "rest cover", "place bolts", "tighten bolts"):
        assert f"{step}: every pose is reached" in printed


def test_a_tray_inside_the_jig_is_found(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(file), "--set", "workcell.p_WT=[0, 0.2, 0.2]"]) == 1
    assert "mm into the jig" in capsys.readouterr().out


def test_a_step_that_is_out_of_reach_is_named(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(file), "--set", "workcell.p_WT=[-0.28, 1.6, 0.03]"]) == 1
    assert "place block: The left arm cannot bring" in capsys.readouterr().out


def test_torque_beyond_the_driver(product: Product) -> None:
    joints = tuple(
        replace(joint, torque=1.2) if joint in product.screws.values() else joint
        for joint in product.joints
    )
    found = said(machine_findings(replace(product, joints=joints), CONFIG), Level.FAILS)
    assert "screw_1, screw_2: 1.2 N m, and the driver gives" in found
    assert said(machine_findings(product, CONFIG), Level.FAILS) == ""


def test_grasps_that_no_step_can_use_are_found(product: Product) -> None:
    cover = product.parts["cover"]
    top = cover.grasps[0]
    turned = top.X_PJaw @ RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0, 0, 0])
    upside_down = replace(top, name="top_9", X_PJaw=turned)
    wrong = changed(product, "cover", grasps=(upside_down, *cover.grasps))
    _, todo = plan_findings(wrong, plan(wrong, config=CONFIG))
    reached = reached_grasps(RunningCell(wrong, CONFIG, 0).station, todo)
    assert {grasp.name for grasp in reached["cover"]} == {g.name for g in cover.grasps}
    kept, (guess,) = within_reach(wrong, reached)
    assert kept.parts["cover"].grasps == cover.grasps
    assert "left out: top_9" in str(guess)


def with_drives(product: Product, *names: str) -> Product:
    """Return a product whose screws have these drives, in their order."""
    drives = dict(zip(product.screws, map(Drive, names), strict=True))
    joints = tuple(
        replace(joint, drive=drives[joint.part]) if isinstance(joint, Screw) else joint
        for joint in product.joints
    )
    return replace(product, joints=joints)


def test_each_screw_is_turned_by_the_bit_of_its_head(product: Product) -> None:
    """An M4 cap screw: its socket, 2 mm deep, is in a head of 4 mm [R] ISO 4762."""
    for screw in product.screws.values():
        assert screw.drive == Drive("hex 3")
        assert screw.bit_seat == pytest.approx(2e-3, abs=1e-6)


def test_a_drive_that_no_bit_fits(product: Product) -> None:
    wrong = with_drives(product, "hex 3", "hex 17")
    found = said(machine_findings(wrong, CONFIG), Level.FAILS)
    assert "screw_2: no bit fits 'hex 17'; there are hex 1.5," in found


def test_drives_that_need_several_bits(product: Product) -> None:
    several = with_drives(product, "hex 3", "cross 2")
    assert "hex 3 for screw_1; cross 2 for screw_2" in said(
        machine_findings(several, CONFIG), Level.DOUBTFUL
    )


def test_a_part_too_heavy_for_the_arm(product: Product) -> None:
    heavy = changed(product, "block", mass=4.5)
    assert "block: 4.5 kg, and the arm carries" in said(
        machine_findings(heavy, CONFIG), Level.FAILS
    )


def test_a_density_of_no_material(product: Product) -> None:
    wrong = changed(product, "cover", mass=1e-6)
    assert "wrong units?" in said(machine_findings(wrong, CONFIG), Level.DOUBTFUL)


def with_grasp(product: Product, **changes: object) -> Product:
    part: Part = product.parts["block"]
    grasp: Grasp = replace(part.grasps[0], **changes)  # pyright: ignore[reportArgumentType]
    return changed(product, "block", grasps=(grasp,))


@pytest.mark.parametrize(
    ("changes", "doubt"),
    [({"width": 0.08}, "is 80 mm wide; jaw 'tip' of hand_e grips"), ({"force": 90.0}, "90 N")],
)
def test_grasps_that_the_hand_cannot_do(
    product: Product, changes: dict[str, float], doubt: str
) -> None:
    found = list(machine_findings(with_grasp(product, **changes), CONFIG))
    assert doubt in said(iter(found), Level.DOUBTFUL)
    assert "block: none of its grasps suits hand_e" in said(iter(found), Level.FAILS)


def test_a_part_without_grasps(product: Product) -> None:
    assert "it has no grasp" in said(
        machine_findings(changed(product, "cover", grasps=()), CONFIG), Level.FAILS
    )


def test_a_part_without_grasps_that_is_too_wide(product: Product) -> None:
    corners = product.parts["cover"].mesh.copy().apply_scale(1.5)
    wide = changed(product, "cover", grasps=(), mesh=corners)
    found = said(machine_findings(wide, CONFIG), Level.FAILS)
    assert "it is 60 mm across, and hand_e opens 50 mm" in found
    assert "gripper_85 opens wider" in found


def test_a_part_that_is_gripped_from_the_side_only_is_named(product: Product) -> None:
    """Such a grasp holds it while it is screwed down: it cannot be brought with it."""
    cover = product.parts["cover"]
    side = tuple(grasp for grasp in cover.grasps if grasp.name.startswith("side"))
    assert side
    only = changed(product, "cover", grasps=side)
    _, todo = plan_findings(only, plan(only, config=CONFIG))
    station = RunningCell(only, CONFIG, 0).station
    found = said(reach_findings(station, todo), Level.FAILS)
    assert "rest cover" in found
    assert "part 'cover' has no grasp from above" in found


def gripped_from_above_only(product: Product, *names: str) -> Product:
    for name in names:
        top = tuple(g for g in product.parts[name].grasps if g.name.startswith("top"))
        assert 0 < len(top) < len(product.parts[name].grasps)
        product = changed(product, name, grasps=top)
    return product


@pytest.mark.parametrize(("borne", "level"), [(0.3, Level.FAILS), (0.9, Level.DOUBTFUL)])
def test_a_torque_that_nothing_bears_is_said(product: Product, borne: float, level: Level) -> None:
    """No grasp from the side: the jig alone holds against the driver."""
    bare = gripped_from_above_only(product, "cover", "block")
    _, todo = plan_findings(bare, plan(bare, config=CONFIG))
    station = RunningCell(bare, CONFIG, 0).station
    found = said(reach_findings(station, todo, dict.fromkeys(bare.screws, borne)), level)
    assert "tighten bolts: no grasp of 'cover' or 'block' from the side leaves room" in found
    assert ("0.3 of 0.5 N m" in found) == (level is Level.FAILS)


def test_the_part_with_the_threads_is_held_where_the_clamped_one_cannot_be(
    product: Product,
) -> None:
    bare = gripped_from_above_only(product, "cover")
    _, todo = plan_findings(bare, plan(bare, config=CONFIG))
    station = RunningCell(bare, CONFIG, 0).station
    found = list(reach_findings(station, todo, dict.fromkeys(bare.screws, 0.3)))
    assert all(finding.level is Level.GOOD for finding in found)
    station.fixed = ("block", "cover", *bare.screws)
    held, _ = next(from_the_side(station, holdable(station, todo[-1])))
    assert held == "block"


def test_what_the_jig_bears_of_a_torque_is_known(product: Product) -> None:
    fixing = plan(product, config=CONFIG)
    choices = fixture_choices(product, fixing, CONFIG)
    borne = borne_torques(fixing, choices)
    assert set(borne) == set(product.screws)
    assert all(0.05 < torque < 5.0 for torque in borne.values())
    assert said(fixture_findings(fixing, choices), Level.FAILS) == ""


def test_a_step_that_no_operation_can_run_is_named(product: Product) -> None:
    joints = tuple(joint for joint in product.joints if not isinstance(joint, Rest))
    bare = replace(product, joints=joints)
    found, todo = plan_findings(bare, plan(bare, config=CONFIG))
    assert todo == []
    assert "No operation brings 'cover' to block" in said(iter(found), Level.FAILS)


def test_what_comes_from_the_side_is_named(product: Product) -> None:
    """The same parts lying on their side: all but the first would have to come from there."""
    lying, order = replace(product, up="+y"), ("block", "cover", "screws")
    found, todo = plan_findings(lying, plan(lying, order, config=CONFIG))
    assert todo == []
    assert "no operation comes from the side" in said(iter(found), Level.FAILS)


def test_an_order_that_is_impossible_is_said(product: Product) -> None:
    order = ("block", "screws", "cover")
    found, todo = plan_findings(product, plan(product, order, config=CONFIG))
    assert todo == []
    assert said(iter(found), Level.FAILS).startswith("fails    order:")


def test_a_product_without_a_tray(file: Path, tmp_path: Path) -> None:
    text = file.read_text().replace("tray: cad_tray", "# tray: cad_tray")
    bare = file.parent / "bare.yaml"
    bare.write_text(text)
    try:
        assert main(["check", str(bare), "--quiet"]) == 1
    finally:
        bare.unlink()


def own_product(drawn: Mapping[str, Manifold], folder: Path) -> str:
    """Return the product file that is drafted from what is drawn."""
    source, out = write_cad(drawn, folder / "cad"), folder / "own"
    assert main(["init", str(source), "--units", "mm", "--out", str(out), "--quiet"]) == 0
    return str(out / "product.yaml")


@pytest.mark.slow
def test_a_bush_a_cover_over_it_and_four_screws_pass(tmp_path: Path) -> None:
    assert main(["check", own_product(bearing_block(), tmp_path), "--quiet"]) == 0


@pytest.mark.slow
def test_a_box_with_a_lip_in_its_lid_and_cross_head_screws_passes(tmp_path: Path) -> None:
    assert main(["check", own_product(box_with_lid(), tmp_path), "--quiet"]) == 0


@pytest.mark.slow
def test_five_bars_are_assembled_where_one_bridges_two(tmp_path: Path) -> None:
    file = own_product(bar_puzzle(), tmp_path)
    assert main(["assemble", file, "--out", str(tmp_path / "run"), "--quiet"]) == 0


@pytest.mark.slow
def test_covered_block_is_assembled_from_its_meshes(file: Path, tmp_path: Path) -> None:
    """From four STL files to the last screw, with no edit by hand."""
    arguments = ["assemble", str(file), "--out", str(tmp_path), "--quiet"]
    assert main(arguments) == 0


def test_products_drawn_at_random_are_whole_and_the_same_again() -> None:
    """One body each; nothing overlaps but screws and their threads."""
    for number in range(12):
        drawing, again = (draw(np.random.default_rng(number)) for _ in range(2))
        assert drawing.text == again.text
        assert all(len(solid.decompose()) == 1 for solid in drawing.parts.values())
        for one, other in combinations(drawing.parts, 2):
            shared = (drawing.parts[one] ^ drawing.parts[other]).volume()
            threaded = one == "block" and other.startswith("screw")
            assert (shared > 1.0) if threaded else (shared < 1e-6), f"{number}: {one}, {other}"
