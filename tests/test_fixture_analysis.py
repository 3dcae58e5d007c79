"""The general rule: statics with known answers, each reason to reject, and the motor unit."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from tiny_products import bolted, box, peg_in_hole, product_of, rod, tube_and_pins

from cell import CellConfig
from cell.errors import InputError
from cell.fixtures.soft_jig import JigParameters
from cell.products.loading import load_product
from cell.products.product import Product
from cell.vectors import rotation_with_up
from planning import plan
from planning.feasibility.directions import DIRECTIONS, unit_vector
from planning.feasibility.matrices import AssemblyMatrices
from planning.fixture_analysis.candidate import Candidate, Choice, FixtureSetup
from planning.fixture_analysis.capacity import (
    sideways_capacity,
    turning_capacity,
    wall_strength,
)
from planning.fixture_analysis.footprint import footprint
from planning.fixture_analysis.grip import BELOW, GripAnalysis
from planning.fixture_analysis.imprint import Imprint, press, samples_of
from planning.fixture_analysis.loads import OperationLoad
from planning.fixture_analysis.rule import general_rule
from planning.fixture_analysis.support import SupportAnalysis

JIG = JigParameters()
SETUP = FixtureSetup.of(CellConfig.load())


def matrices_of(product: Product) -> AssemblyMatrices:
    matrices = plan(product).matrices
    assert matrices is not None
    return matrices


def turned(up: str) -> np.ndarray:
    return rotation_with_up(up).matrix()


def choices(product: Product, order: tuple[str, ...] | None = None) -> tuple[Choice, ...]:
    fixing = plan(product, order)
    assert fixing.matrices is not None
    return general_rule(product, fixing.order, fixing.steps, fixing.matrices, SETUP)


def candidate(choice: Choice, body: str, up: str) -> Candidate:
    """The one whose body begins with a part."""
    return next(c for c in choice.candidates if c.body[0] == body and c.up == up)


@pytest.mark.parametrize("up", DIRECTIONS)
def test_rotation_turns_the_axis_up(up):
    R_JA = turned(up)
    np.testing.assert_allclose(R_JA @ unit_vector(up), [0, 0, 1], atol=1e-15)  # sin(pi).
    np.testing.assert_allclose(R_JA @ R_JA.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(R_JA) == pytest.approx(1.0)


def test_footprint_of_a_rectangle():
    """40 x 20 mm: margin, lever, narrowest width and circle by hand."""
    outline = footprint(np.array([[-0.02, -0.01], [0.02, -0.01], [0.02, 0.01], [-0.02, 0.01]]))
    assert outline is not None
    assert outline.margin(np.array([0.015, 0.0])) == pytest.approx(0.005)
    assert outline.margin(np.array([0.0, 0.013])) == pytest.approx(-0.003)
    assert outline.lever(np.array([0.005, 0.0]), np.array([1.0, 0.0])) == pytest.approx(0.015)
    assert outline.narrowest == pytest.approx(0.02)
    assert outline.circle[1] == pytest.approx(np.hypot(0.04, 0.02))
    moved = outline.shifted(np.array([0.1, 0.2]))
    assert moved.margin(np.array([0.115, 0.2])) == pytest.approx(0.005)


def test_points_on_a_line_are_no_footprint():
    assert footprint(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]])) is None


def embedded(width: float, depth: float, cell: float = 1e-4) -> Imprint:
    """A square post in a flat bed, in closed form."""
    n = round(width / cell)
    grid = np.full((n + 6, n + 6), np.inf)
    grid[3:-3, 3:-3] = 0.0
    half = width / 2
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    bed = np.full(grid.shape, depth)
    bed[3:-3, 3:-3] = 0.0
    return Imprint(depth, 20.0, 0.0, 0.0, cell, bed, bed, grid, footprint(corners))


@pytest.mark.parametrize(("depth", "expected"), [(5e-3, 2.2), (10e-3, 6.6), (15e-3, 13.8)])
def test_capacity_is_that_of_the_formula(depth, expected):
    """[D] The formula for a motor 34.8 mm wide, 1.86 N, pushed 40 mm up, by hand."""
    load = OperationLoad(0.0, 1.0, 0.0, np.zeros(2), 0.040)
    found = sideways_capacity(embedded(34.8e-3, depth), JIG, 1.86, np.zeros(2), load)
    wall = wall_strength(JIG) * 34.8e-3 * depth
    by_hand = min(wall + 0.9 * 1.86, (1.86 * 17.4e-3 + wall * depth / 2) / 0.040)
    assert found == pytest.approx(by_hand, rel=1e-3)
    assert found == pytest.approx(expected, abs=0.1)


def test_a_low_push_slides_instead_of_tipping():
    load = OperationLoad(0.0, 1.0, 0.0, np.zeros(2), 1e-3)
    found = sideways_capacity(embedded(34.8e-3, 5e-3), JIG, 1.86, np.zeros(2), load)
    wall = wall_strength(JIG) * 34.8e-3 * 5e-3
    assert found == pytest.approx(wall + 0.9 * 1.86, rel=1e-3)


def test_a_load_beside_the_footprint_tips_it():
    """10 N down at 20 mm beyond the edge overturn what 10 N in the middle steady."""
    shallow = embedded(34.8e-3, 1e-3)
    bears = [
        sideways_capacity(
            shallow, JIG, 1.86, np.zeros(2), OperationLoad(10.0, 1.0, 0.0, np.array([x, 0.0]), 0.04)
        )
        for x in (0.0, 37.4e-3)
    ]
    assert bears[0] > 4.0 and bears[1] == 0.0


def test_wall_strength_of_the_beads():
    """[D] 132 kPa for 90 kPa of vacuum and 25 degrees."""
    assert wall_strength(JIG) == pytest.approx(132e3, rel=0.005)


def test_an_infinite_strength_factor_keeps_the_strength_of_the_beads():
    """It turns yielding off in the simulation; a finite one scales the walls here as there."""
    for factor, expected in ((np.inf, 1.0), (0.5, 0.5)):
        jig = replace(JIG, jammed=replace(JIG.jammed, strength=factor))
        assert wall_strength(jig) == pytest.approx(expected * wall_strength(JIG))


def test_turning_is_borne_by_friction_of_a_disc():
    """The torque is mu W 2/3 r, r of the disc of equal area."""
    post = embedded(34.8e-3, 5e-3)
    load = OperationLoad(10.0, 3.0, 0.5, np.zeros(2), 0.04)
    expected = 0.9 * 11.86 * 2 / 3 * 34.8e-3 / np.sqrt(np.pi)
    assert turning_capacity(post, JIG, 1.86, load) == pytest.approx(expected, rel=1e-3)


def test_imprint_bears_the_press_force_and_keeps_the_beads():
    """A flat cylinder like the motor's can under 20 N; its beads go into the collar."""
    product = product_of({"can": rod(34.8, 0, 50)})
    matrices = matrices_of(product)
    imprint = press([samples_of(matrices.solids["can"])], turned("+z"), np.zeros(2), JIG, 20.0)
    assert 20.0 <= imprint.force < 23.0
    assert 8e-3 < imprint.depth < 14e-3  # [M] In the twin the arm stops at 9.5 mm.
    assert imprint.excess < 0.01 * imprint.volume
    assert imprint.contact is not None
    assert imprint.contact.circle[1] == pytest.approx(34.8e-3, abs=2 * imprint.cell)
    walls = [imprint.walls(np.array(push))[0].sum() for push in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    assert max(walls) < 1.3 * min(walls)  # Round: the same from all sides, but for the grid.


def test_more_force_sinks_deeper():
    matrices = matrices_of(product_of({"can": rod(34.8, 0, 50)}))
    can = [samples_of(matrices.solids["can"])]
    depths = [press(can, turned("+z"), np.zeros(2), JIG, f).depth for f in (5.0, 10.0, 20.0)]
    assert depths[0] < depths[1] < depths[2]


def support_of(product: Product) -> SupportAnalysis:
    return SupportAnalysis(product, matrices_of(product))


def test_loose_pins_fall_when_the_plate_is_turned_over():
    support = support_of(tube_and_pins())
    assert support.falling(("plate", "pin_1", "pin_2"), "+z") == []
    tall = box((60, 30, 10), (-30, -15, 0)) - rod(6, -5, 8, 32)
    blind = product_of({"plate": tall, "pin": rod(6, -20, 8, 32)})
    support = support_of(blind)
    assert support.falling(("plate", "pin"), "-z") == []
    assert support.dropped(("plate", "pin"), "+z") == ["pin"]


def test_fastened_parts_do_not_fall():
    """Bolt and lid hang upside down on their thread; without it both would drop."""
    product = bolted()
    support = support_of(product)
    assert support.dropped(("base", "lid", "bolt"), "-z") == []
    loose = support_of(replace(product, joints=product.fits))
    assert loose.dropped(("base", "lid", "bolt"), "-z") != []


def test_pieces_of_a_group_are_carried_one_by_one():
    support = support_of(tube_and_pins())
    assert support.components(("pin_1", "pin_2")) == [("pin_1",), ("pin_2",)]
    assert support.dropped(("pin_1", "pin_2"), "-z") == []


@pytest.mark.parametrize(
    ("size", "obstacle"),
    [((40, 90, 10), ""), ((60, 90, 10), "60 mm across, the gripper opens 50 mm")],
)
def test_grip_needs_a_place_narrower_than_the_stroke(size, obstacle):
    product = product_of({"bar": box(size, (0, 0, 0))})
    width, found = GripAnalysis(product, matrices_of(product).solids, 0.050).width(
        ("bar",), turned("+z")
    )
    assert width == pytest.approx(min(size[:2]) * 1e-3) and found == obstacle
    assert SETUP.gripper_stroke == pytest.approx(0.050)


def test_the_configured_gripper_decides_the_stroke():
    arms = CellConfig().arms
    wide = replace(CellConfig(), arms={**arms, "left": replace(arms["left"], tool="gripper_85")})
    assert FixtureSetup.of(wide).gripper_stroke == pytest.approx(0.085)
    with pytest.raises(InputError, match="No arm carries a gripper"):
        FixtureSetup.of(replace(CellConfig(), arms={"right": arms["right"]}))


def test_declared_grasps_decide_and_must_not_come_from_below():
    motor_unit = load_product("motor_unit")
    matrices = matrices_of(motor_unit)
    grip = GripAnalysis(motor_unit, matrices.solids, SETUP.gripper_stroke)
    assert grip.width(("plate",), turned("+z")) == (0.07, "")
    assert grip.width(("bolt_1",), turned("-z"))[1] == BELOW


@pytest.fixture(scope="module")
def motor_unit() -> dict[tuple[str, ...], tuple[Choice, ...]]:
    """Choices for both orders of the paper."""
    product = load_product("motor_unit")
    return {order: choices(product, order) for order in product.orders}


@pytest.mark.parametrize("number", [0, 1])
def test_rules_agree_on_the_motor_unit(motor_unit, number):
    """Found by the rule, not put in: in both orders of the paper, in every step."""
    for choice in list(motor_unit.values())[number]:
        assert choice.agrees, choice.verdict
        assert "Both rules take" in choice.verdict


def test_reasons_to_reject_on_the_motor_unit(motor_unit):
    first, second = motor_unit["motor", "plate", "bolts"]
    assert "from below" in candidate(first, "motor", "-z").rejected
    # The shaft protrudes by 17 mm below the plate, and the bag bulges a little into the hole.
    inside = re.fullmatch(
        r"motor would end (\d+) mm inside the frozen bed", candidate(first, "plate", "-z").rejected
    )
    assert inside and 16 <= int(inside[1]) <= 23
    assert "are not connected" in candidate(second, "bolt_1", "-z").rejected
    best = second.candidates[0]
    assert "0.50 N m" in best.notes[0]  # The hand has to hold it: the base does not.


def test_loose_bolts_may_protrude(motor_unit):
    first, _ = motor_unit["plate", "bolts", "motor"]
    assert first.best is not None and first.best.body == ("plate",)
    assert any("may protrude by up to" in note for note in first.best.notes)


def test_rules_disagree_and_say_so():
    """A flat cap on a tall post with a wide foot: turned over, all is lower.

    Algorithm 1 keeps +z up, as the product says; there is a blind hole, so only +z is open.
    """
    post = rod(20, 0, 80)
    block = box((46, 46, 25), (-23, -23, 60)) - rod(20, 50, 80)
    choice = choices(product_of({"post": post, "block": block}), ("post", "block"))[0]
    assert not choice.agrees and choice.best is not None
    assert choice.best.body == ("block",) and choice.best.up == "-z"
    assert "The rules disagree" in choice.verdict


def test_a_footprint_wider_than_the_bag_is_rejected():
    table = box((120, 40, 10), (-60, -20, 0))
    knob = box((10, 10, 20), (-5, -5, 10))
    choice = choices(product_of({"table": table, "knob": knob}), ("table", "knob"))[0]
    # The circle around 120 x 40 mm; the bag's aperture is 116.6 mm.
    assert (
        "126.5 mm across, the bag's aperture 116.6 mm" in candidate(choice, "table", "+z").rejected
    )


def test_a_body_that_tips_over_is_rejected():
    """A gallows: a thin post under the end of a beam."""
    post = box((8, 8, 60), (0, 0, 0)) + box((90, 8, 20), (0, 0, 60))
    cap = box((8, 8, 10), (0, 0, 80))
    choice = choices(product_of({"post": post, "cap": cap}), ("post", "cap"))[0]
    reason = candidate(choice, "post", "+z").rejected
    assert "outside its support area" in reason or "base plate" in reason


def test_scores_are_shares_and_rank_the_candidates():
    for choice in choices(peg_in_hole(), ("block", "peg")):
        scores = [c.score for c in choice.candidates]
        assert scores == sorted(scores, reverse=True)
        for one in choice.candidates:
            assert bool(one.rejected) != bool(one.scores)
            assert all(0.0 <= score <= 1.0 for score in one.scores.values())
