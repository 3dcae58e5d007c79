"""plan.html: parts where they should be, a page that any browser shows, and what it says."""

from __future__ import annotations

import base64
import io
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from matplotlib.image import imread
from pydrake.math import RigidTransform
from test_report import Outline
from tiny_products import interlocked_links, peg_in_hole, stack_of_three, tube_and_pins

from cell import CellConfig
from cell.fixtures.soft_jig import BagParameters
from cell.machines.cameras.rendering import rendering_problem
from cell.products.loading import load_product
from cell.products.mesh_io import obj_text
from cell.products.product import Part, Product
from experiments.plan import drawn, page
from experiments.plan.arrangement import ARROW, arrow, bag_mesh, exploded, jig, step_arrangement
from experiments.plan.command import save_matrices
from experiments.plan.drawn import SHOWN, Body, DrawnProduct, Shape
from experiments.plan.heatmaps import contact_map, direction_maps
from experiments.plan.page import write_page
from experiments.plan.scene import projected, view_of
from planning import plan
from planning.assembly_plan.verdict import verdict_of
from planning.feasibility.bolt_remark import bolt_remarks
from planning.feasibility.directions import DIRECTIONS
from planning.fixture_analysis.candidate import FixtureSetup
from planning.fixture_analysis.rule import general_rule

BAG = BagParameters()
ONE = np.array([0x3B, 0x6E, 0xA5], np.float32) / np.float32(255)
SETUP = FixtureSetup.of(CellConfig())
needs_rendering = pytest.mark.skipif("rendering_problem() is not None", reason="no rendering here")


def boxes_overlap(a: Body, b: Body) -> bool:
    return bool(np.all(a.bounds[0] < b.bounds[1]) and np.all(b.bounds[0] < a.bounds[1]))


def write(product: Product, file: Path, order: tuple[str, ...] | None = None) -> str:
    fixing = plan(product, order)
    assert fixing.matrices is not None
    ranking = general_rule(product, fixing.order, fixing.steps, fixing.matrices, SETUP)
    write_page(file, product, fixing, ranking, verdict_of(fixing, ranking), SETUP, ["a <note>"])
    return file.read_text()


def test_bag_is_the_cap_of_the_jig():
    """Height, opening and volume of the drawn bag are those of the parameters."""
    mesh = bag_mesh(BAG)
    assert mesh.bounds[1, 2] == pytest.approx(BAG.cap_height)
    low = mesh.vertices[mesh.vertices[:, 2] < 1e-9]
    assert np.linalg.norm(low[:, :2], axis=1).max() == pytest.approx(BAG.aperture_radius, rel=1e-3)


@pytest.mark.parametrize("up", ["+z", "-z"])
def test_what_is_fixed_stands_on_the_bag_and_the_rest_comes_from_above(up):
    """The same step seen upright and with the roles exchanged: the peg below, the block above."""
    product = replace(peg_in_hole(), up=up)
    fixing = plan(product, ("block", "peg"))
    shown = step_arrangement(DrawnProduct.of(product), fixing.steps[0], BAG, depth=0.01)
    parts = {item.name: item.body for item in shown if item.name}
    below, above = ("block", "peg") if up == "+z" else ("peg", "block")
    assert parts[below].bounds[0, 2] == pytest.approx(BAG.cap_height - 0.01)
    assert parts[above].bounds[0, 2] > parts[below].bounds[1, 2]
    (pointer,) = (item.body for item in shown if item.color == ARROW)
    widths = np.ptp(pointer.vertices[pointer.vertices[:, 2] < pointer.bounds[0, 2] + 1e-6], axis=0)
    assert np.allclose(widths, 0.0, atol=1e-9)  # It ends in its tip, below: it points down.


def test_arrow_points_along_its_direction():
    body = [Body(Shape(trimesh.creation.box((0.02, 0.02, 0.02))))]
    for along in np.vstack([np.eye(3), -np.eye(3)]):
        pointer = Body(Shape(arrow(body, along)))
        ahead = pointer.vertices @ along
        tip = pointer.vertices[ahead > ahead.max() - 1e-9]
        np.testing.assert_allclose(np.ptp(tip, axis=0), 0.0, atol=1e-9)
        assert not boxes_overlap(pointer, body[0])


@pytest.mark.parametrize("make", [peg_in_hole, stack_of_three, tube_and_pins])
def test_exploded_parts_are_apart(make):
    product = make()
    shown = exploded(DrawnProduct.of(product), plan(product).steps)
    meshes = [item.body for item in shown]
    assert len(meshes) == len(product.parts)
    assert not any(boxes_overlap(a, b) for k, a in enumerate(meshes) for b in meshes[:k])


def test_camera_sees_everything_and_labels_find_it():
    mesh = trimesh.creation.box((0.1, 0.2, 0.3))
    view = view_of([Body(Shape(mesh))])
    np.testing.assert_allclose(projected(view, np.zeros(3)), [view.width / 2, view.height / 2])
    pixels = np.array([projected(view, corner) for corner in mesh.vertices])
    assert np.all(pixels > 0) and np.all(pixels < [view.width, view.height])
    assert projected(view, np.array([0, 0, 0.1]))[1] < view.height / 2  # Up is up.


def blue(svg: str) -> int:
    """Count the pixels of the colour of a 1, of which each entry has one."""
    pictures = re.findall(r'href="data:image/png;base64,([^"]+)"', svg)
    return sum(
        int((imread(io.BytesIO(base64.b64decode(data)), format="png")[..., :3] == ONE).all(2).sum())
        for data in pictures
    )


def test_heat_maps_show_the_ones():
    """C is drawn symmetrically."""
    names, none, one, two = ("a", "b", "c"), np.zeros((3, 3), int), np.zeros((3, 3), int), None
    one[0, 1] = 1
    two = one.copy()
    two[0, 2] = 1
    areas = [blue(contact_map(names, matrix)) for matrix in (none, one, two)]
    assert areas == [0, 2, 4]
    layers = dict.fromkeys(DIRECTIONS, none) | {"+y": one}
    assert blue(direction_maps(names, layers, "M")) == 1


def test_many_parts_fit_into_a_heat_map():
    names = [f"part_{k}" for k in range(120)]
    assert blue(contact_map(names, np.triu(np.ones((120, 120), int), 1))) == 120 * 119


def test_names_of_any_script_are_text():
    names = ("底板", "シャフト", "vis & écrou")
    svg = contact_map(names, np.zeros((3, 3), int))
    assert all(svg.count(f">{name}</text>") == 2 for name in (*names[:2], "vis &amp; écrou"))
    svg = direction_maps(names, dict.fromkeys(DIRECTIONS, np.zeros((3, 3), int)), "M")
    ElementTree.fromstring(svg)  # Well formed.
    assert svg.count(">底板</text>") == 2 + 3  # Left of two rows, below three columns.


def test_page_without_rendering_says_so(monkeypatch, tmp_path):
    monkeypatch.setattr(page, "rendering_problem", lambda: "no libEGL")
    html = write(tube_and_pins(), tmp_path / "plan.html")
    outline = Outline(html)
    assert not outline.open and "No pictures: no libEGL." in outline.text
    assert outline.seen.count("svg") == 3 and "img" not in outline.seen  # The heat maps are there.
    assert "a <note>" in outline.text and "General rule:" in outline.text
    assert "feasible" in outline.text and "Exploded view" not in outline.text


def test_page_of_an_infeasible_product_shows_the_evidence(monkeypatch, tmp_path):
    monkeypatch.setattr(page, "rendering_problem", lambda: "no libEGL")
    text = Outline(write(interlocked_links(), tmp_path / "plan.html")).text
    assert "infeasible" in text
    assert "none of link_1, link_2 can leave the others" in text
    assert "link_2 hits link_1 at (15.00," in text


@needs_rendering
def test_page_holds_a_picture_per_step_and_the_exploded_view(tmp_path):
    """Self-contained: every picture is inside, in colour, with the names of the parts as text."""
    product = stack_of_three()
    html = write(product, tmp_path / "plan.html")
    outline = Outline(html)
    assert not outline.open and outline.seen.count("svg") == 3 + 3
    assert not re.search(r'(src|href)="(?!data:)', html)
    pictures = html[: html.index("<h2>Matrices</h2>")]
    seen = [pictures.count(f">{name}</text>") for name in product.parts]
    assert seen == [3, 3, 2]  # plate_2 comes in with the second step.
    for data in re.findall(r'<image [^>]*href="data:image/png;base64,([^"]+)"', pictures):
        rgb = imread(io.BytesIO(base64.b64decode(data)), format="png")
        assert rgb[..., :3].std() > 0.05
    assert rendering_problem() is None


def test_matrices_as_arrays(tmp_path):
    fixing = plan(tube_and_pins())
    save_matrices(fixing, tmp_path / "matrices.npz")
    with np.load(tmp_path / "matrices.npz", allow_pickle=False) as arrays:
        assert arrays["parts"].tolist() == list(fixing.parts)
        assert arrays["directions"].tolist() == list(DIRECTIONS)
        np.testing.assert_array_equal(arrays["contact"], fixing.contact)
        for k, j in enumerate(DIRECTIONS):
            np.testing.assert_array_equal(arrays["free"][k], fixing.free[j])
            np.testing.assert_array_equal(arrays["reachable"][k], fixing.reachable[j])


def foot_on_the_other_side(product: Product) -> Product:
    """The motor unit with its plate reflected in the middle of its 5 mm face."""
    plate = product.parts["plate"]
    vertices = np.array(plate.mesh.vertices) * [1, 1, -1] + [0, 0, 5e-3]
    mesh = trimesh.Trimesh(vertices, plate.mesh.faces[:, ::-1], process=False)
    return replace(product, parts={**product.parts, "plate": replace(plate, mesh=mesh)})


def test_the_papers_remark_on_bolts_depends_on_the_side_of_the_foot():
    """Foot on the motor's side: lower on the heads. On the other: lower with bolts on top."""
    product = load_product("motor_unit")
    for one, holds in ((product, False), (foot_on_the_other_side(product), True)):
        matrices = plan(one, ("motor", "plate", "bolts")).matrices
        assert matrices is not None
        (remark,) = bolt_remarks(one, matrices.solids)
        assert (remark.part, remark.bolts, remark.holds) == ("plate", 6, holds)
        assert ("does not hold" not in remark.text()) == holds
        print(remark.text())


def test_drawn_parts_are_coarse_and_close():
    """A ball of 20 000 triangles loses most of them, and moves by less than half a pixel."""
    ball = trimesh.creation.icosphere(5, 0.01)
    product = Product("ball", {"ball": Part("ball", ball, 1.0, RigidTransform([0.1, 0, 0]))})
    (shape,) = DrawnProduct.of(product).shapes.values()
    assert len(shape.mesh.faces) < len(ball.faces) / 3 and shape.mesh.is_watertight
    radii = np.linalg.norm(shape.mesh.triangles_center - [0.1, 0, 0], axis=1)
    assert radii.min() > 0.01 - 1.1 * SHOWN * np.linalg.norm(ball.extents)


@needs_rendering
def test_parts_are_made_ready_once_for_all_pictures(monkeypatch, tmp_path):
    """Three parts in three pictures, bag and base in two: each is converted once."""
    converted: list[int] = []

    def counted(mesh: trimesh.Trimesh, normals: bool = False) -> str:
        converted.append(len(mesh.faces))
        return obj_text(mesh, normals=normals)

    monkeypatch.setattr(drawn, "obj_text", counted)
    jig.cache_clear()
    write(stack_of_three(), tmp_path / "plan.html")
    assert len(converted) == 3 + 2 + 2  # Parts, bag and base, an arrow per step.
