"""Strays and islands are named and the rest is planned; likely causes; verdicts on the jig."""

from __future__ import annotations

import json

import numpy as np
import pytest
from manifold3d import Manifold
from tiny_products import box, interlocked_links, peg_in_hole, product_of, rod, stack_of_three

from cell import CellConfig
from cell.products.product import Product
from planning import load_plan, plan, save_plan
from planning.assembly_plan.explain import stop_text
from planning.assembly_plan.plan_file import plan_to_dict
from planning.assembly_plan.verdict import verdict_of
from planning.feasibility.pose_doubt import pose_doubt
from planning.feasibility.solids import solids_of
from planning.fixture_analysis.candidate import FixtureSetup
from planning.fixture_analysis.rule import general_rule
from planning.ordering.unplanned import overlapping_items


def with_stray() -> dict[str, Manifold]:
    """A block on a plate, and a small cube 39 mm beside the plate."""
    return {
        "origin_cube": box((2, 2, 2), (69, 0, -5)),
        "plate": box((60, 60, 10), (-30, -30, -10)),
        "block": box((20, 20, 10), (-10, -10, 0)),
    }


def test_a_stray_is_named_with_its_neighbour_and_the_rest_is_planned():
    fixing = plan(product_of(with_stray()))
    assert not fixing.feasible and fixing.stop is None
    assert fixing.order == ("plate", "block") and len(fixing.steps) == 1
    (stray,) = fixing.unplanned
    assert stray.name == "origin_cube"
    assert stray.reason == "touches no part; nearest is plate, 39 mm away"
    assert fixing.orders is not None and fixing.orders.ranked
    assert "origin_cube touches no part; nearest is plate, 39 mm away" in stop_text(fixing)


@pytest.mark.parametrize(
    "order", [("plate", "origin_cube", "block"), ("origin_cube", "block", "plate")]
)
def test_an_order_with_a_stray_keeps_the_rest_as_it_was_asked_for(order):
    product = product_of(with_stray())
    for asked, listed in ((order, ()), (None, (order,))):
        fixing = plan(product_of(with_stray(), orders=listed), asked)
        assert fixing.order == tuple(name for name in order if name != "origin_cube")
        assert len(fixing.steps) == 1 and not fixing.feasible
    assert [item.name for item in plan(product, order).unplanned] == ["origin_cube"]


def test_the_largest_island_is_planned():
    shapes = with_stray() | {
        "far_1": box((5, 5, 5), (200, 0, 0)),
        "far_2": box((5, 5, 5), (205, 0, 0)),
        "peg": rod(4, 10, 20),
    }
    fixing = plan(product_of(shapes))
    assert set(fixing.order) == {"plate", "block", "peg"} and len(fixing.steps) == 2
    reasons = {item.name: item.reason for item in fixing.unplanned}
    assert set(reasons) == {"origin_cube", "far_1", "far_2"}
    assert reasons["far_1"].startswith("touches far_2 only, not the rest; nearest of that is plate")


def test_a_group_is_a_stray_as_a_whole():
    shapes = with_stray() | {"origin_cube_2": box((2, 2, 2), (71, 0, -5))}
    product = product_of(shapes, groups={"cubes": ("origin_cube", "origin_cube_2")})
    fixing = plan(product)
    assert [item.name for item in fixing.unplanned] == ["cubes"]
    assert fixing.order == ("plate", "block")


def test_nothing_is_unplanned_where_all_touch_or_none_does():
    assert plan(stack_of_three()).unplanned == ()
    apart = {f"p_{k}": box((5, 5, 5), (20 * k, 0, 10 * k)) for k in range(3)}
    fixing = plan(product_of(apart))
    assert fixing.unplanned == () and fixing.stop is not None
    assert "touches no part" in fixing.stop.reason


def test_plan_file_holds_what_is_not_planned(tmp_path):
    fixing = plan(product_of(with_stray()))
    save_plan(fixing, tmp_path / "plan.json")
    data = json.loads((tmp_path / "plan.json").read_text())
    assert data["feasible"] is False and len(data["steps"]) == 1
    assert data["unplanned"] == [
        {"name": "origin_cube", "reason": "touches no part; nearest is plate, 39 mm away"}
    ]
    assert plan_to_dict(load_plan(tmp_path / "plan.json")) == plan_to_dict(fixing)


def test_few_items_are_left_out_for_overlaps():
    """The plate overlaps with all three blocks: it alone is left out. Of a pair, the lighter."""
    own = {name: name for name in ("plate", "a", "b", "c")}
    mass = {"plate": 5.0, "a": 1.0, "b": 2.0, "c": 3.0}
    pairs = [("plate", "a", 1e-3), ("b", "plate", 2e-3), ("c", "plate", 4e-3)]
    (left,) = overlapping_items(pairs, own, mass)
    assert left.name == "plate"
    assert left.reason == "overlaps a by 1 mm, b by 2 mm, c by 4 mm, which is not declared"
    (left,) = overlapping_items([("b", "c", 4e-3)], own, mass)
    assert left.name == "b" and "overlaps c by 4 mm" in left.reason
    assert overlapping_items([("a", "b", 1e-3)], own | {"b": "g", "a": "g"}, mass) == ()


def doubt(shapes: dict[str, Manifold], overlapping: tuple[tuple[str, str], ...] = ()) -> str:
    solids = list(solids_of(product_of(shapes)).values())
    fixing = np.zeros((len(solids), len(solids)), int)
    return pose_doubt(solids, fixing, overlapping)


def test_parts_about_one_origin_are_a_likely_cause():
    plate, pin = box((40, 40, 5), (-20, -20, -5)), rod(5, -5, 10)
    assert "pin_a and pin_b are equal and in the same place" in doubt(
        {"plate": plate, "pin_a": pin, "pin_b": pin}, (("plate", "pin_a"), ("plate", "pin_b"))
    )
    shapes = {"plate": plate, "bush": rod(12, -8, 3), "bar": box((30, 8, 6), (-15, -4, -5.5))}
    assert doubt(shapes) == ""  # Concentric parts that do not overlap are an assembly.
    assert "their middle" in doubt(shapes, (("plate", "bush"), ("plate", "bar"), ("bush", "bar")))
    corners = {f"p_{k}": box((10 + k, 20 - k, 5 + k), (0, 0, 0)) for k in range(4)}
    assert "their lower corner" in doubt(corners, (("p_0", "p_1"),))


def test_parts_laid_out_for_printing_are_a_likely_cause():
    flat = {f"p_{k}": box((10, 10, 3 + k), (15 * k, 0, 0)) for k in range(4)}
    fixing = plan(product_of(flat))
    assert not fixing.feasible and "side by side" in fixing.likely_cause
    assert "Likely cause: the parts are probably not in their assembled poses" in stop_text(fixing)


@pytest.mark.parametrize("make", [interlocked_links, lambda: product_of(with_stray())])
def test_other_failures_have_no_such_cause(make):
    assert plan(make()).likely_cause == ""


def judged(product: Product):
    fixing = plan(product)
    assert fixing.matrices is not None
    setup = FixtureSetup.of(CellConfig())
    rule = general_rule(product, fixing.order, fixing.steps, fixing.matrices, setup)
    return verdict_of(fixing, rule)


def test_a_plan_that_the_jig_cannot_hold_is_not_simply_feasible():
    """Plates of half a metre: they come together, and no bag is as wide."""
    wide = product_of({f"plate_{k}": box((500, 500, 10), (-250, -250, 10 * k)) for k in range(2)})
    verdict = judged(wide)
    assert verdict.feasible and not verdict.held and not verdict.good
    assert verdict.text.startswith(
        "feasible by geometry, but no step has a posture that this jig can hold: "
    )
    assert verdict.text.split("hold: ")[1]


def test_verdicts_on_usual_plans():
    good = judged(peg_in_hole())
    assert good.good and good.text == "feasible"
    failed = judged(interlocked_links())
    assert not failed.feasible and failed.text.startswith("infeasible: link_2 is blocked")
    stray = judged(product_of(with_stray()))
    assert not stray.feasible and "origin_cube touches no part" in stray.text
