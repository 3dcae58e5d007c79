"""Directions at an angle: agreement with a boolean sweep, and the plans that need them."""

from __future__ import annotations

import json
import time
from dataclasses import replace

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold
from oracle import is_blocked
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from test_interference import random_shape, solid
from tiny_products import (
    bolted,
    box,
    peg_in_hole,
    product_of,
    rod,
    tube_and_pins,
)

from cell import CellConfig
from cell.products.loading import load_product
from cell.products.product import Product
from planning import load_plan, plan, save_plan
from planning.assembly_plan.explain import step_texts
from planning.assembly_plan.plan_file import plan_to_dict
from planning.feasibility.algorithm import leaving_way, open_postures
from planning.feasibility.candidate_axes import body_normals, candidate_axes, local_hits
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.interference import FIT_TOLERANCE, interference
from planning.feasibility.slanted import (
    axis_matrix,
    decided_along,
    direction_label,
    nearest_axis,
    slanted_pair,
)
from planning.feasibility.solids import Solid
from planning.fixture_analysis.candidate import FixtureSetup, Proposal
from planning.fixture_analysis.rule import general_rule
from planning.operations.operation import NoOperation
from planning.operations.sequence import steps


def along(solids: list[Solid], axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    decided = decided_along(solids, axis, FIT_TOLERANCE)
    return axis_matrix(decided, len(solids), FIT_TOLERANCE)


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    return np.linalg.qr(rng.normal(size=(3, 3)))[0] * 1.0


def turned(shape: Manifold, R: np.ndarray) -> Manifold:
    return shape.transform(np.column_stack([R, np.zeros(3)]))


def turned_product(product: Product, R: RotationMatrix) -> Product:
    """The same product, turned about the origin of A; joints stay behind."""
    X = RigidTransform(R, np.zeros(3))
    parts = {name: replace(part, X_AP=X @ part.X_AP) for name, part in product.parts.items()}
    return replace(product, parts=parts, joints=())


def pin_at(degrees: float, width: float = 60.0) -> Product:
    """A pin in a blind hole that leans over towards +x."""
    hole = rod(8, -20, 90).rotate([0, degrees, 0])
    block = box((width, width, 40), (-width / 2, -width / 2, -40)) - hole
    return product_of({"block": block, "pin": rod(8, -20, 60).rotate([0, degrees, 0])})


def tunnel() -> dict[str, Manifold]:
    """A prism between two inclined faces and a floor: it leaves along their common edge only."""
    section = CrossSection([np.array([(-10.0, 0.0), (10.0, 0.0), (0.0, 12.0)])])
    hole = section.extrude(60).translate([0, 0, -20])
    return {
        "block": box((40, 40, 60), (-20, -15, -30)) - hole,
        "prism": section.extrude(60).translate([0, 0, -20]),
    }


@pytest.mark.parametrize("seed", range(8))
def test_matrices_agree_with_a_boolean_sweep(seed):
    """Random pairs, turned at random: along an axis of theirs that is at an angle to ours."""
    rng = np.random.default_rng(seed)
    shapes = [random_shape(rng).translate(list(2.0 * rng.integers(-6, 7, 3))) for _ in range(2)]
    if any(shape.is_empty() for shape in shapes):
        pytest.skip("an empty shape")
    R = random_rotation(rng)
    if np.linalg.det(R) < 0.0:
        R[:, 0] *= -1.0
    solids = [solid(turned(shape, R), f"part_{k}") for k, shape in enumerate(shapes)]
    for axis in range(3):
        free, _ = along(solids, R[:, axis])
        for i, k in ((0, 1), (1, 0)):
            blocked = is_blocked(shapes[i], shapes[k], axis, 1e3 * FIT_TOLERANCE)
            assert free[i, k] == int(not blocked)


@pytest.mark.parametrize("seed", range(4))
def test_both_ways_are_transposes_with_evidence(seed):
    rng = np.random.default_rng(100 + seed)
    solids = [
        solid(random_shape(rng).translate(list(2.0 * rng.integers(-4, 5, 3))), f"part_{k}")
        for k in range(4)
    ]
    axis = rng.normal(size=3)
    there, back = slanted_pair(solids, axis / np.linalg.norm(axis), FIT_TOLERANCE)
    np.testing.assert_array_equal(there.free, back.free.T)
    np.testing.assert_allclose(np.array(there.direction), -np.array(back.direction))
    for way in (there, back):
        zeros = {(i, k) for i, k in np.argwhere(way.free == 0) if i != k}
        names = [f"part_{k}" for k in range(4)]
        hits = {(names.index(b.moving), names.index(b.staying)) for b in way.blockers}
        assert hits == zeros
        assert all(b.direction == way.label and b.travel >= 0.0 for b in way.blockers)


def test_an_axis_of_the_frame_gives_the_matrix_of_the_six():
    solids = [solid(shape, name) for name, shape in tunnel().items()]
    free, margin = along(solids, np.array([0.0, 0.0, 1.0]))
    six = interference(solids)
    np.testing.assert_array_equal(free, six.free["+z"])
    np.testing.assert_allclose(margin, six.margin["+z"])


@pytest.mark.parametrize("degrees", [15.0, 36.0, 44.0])
def test_a_pin_in_a_leaning_hole_comes_from_above(degrees):
    fixing = plan(pin_at(degrees))
    assert fixing.feasible and fixing.order == ("block", "pin")
    (step,) = fixing.steps
    angle = np.deg2rad(degrees)
    np.testing.assert_allclose(step.leaves_along, [np.sin(angle), 0, np.cos(angle)], atol=1e-4)
    assert not any(step.directions.values()) and step.slanted == (step.leaves_along,)
    assert (step.posture, step.fixed_part) == ("+z", "block")
    assert f"{degrees:.3g} degrees off" in step.reason


def test_a_pin_that_leans_far_over_comes_from_the_side():
    (step,) = plan(pin_at(65.0), ("block", "pin")).steps
    assert (step.posture, step.fixed_part) == ("+x", "block")


def test_the_last_part_may_leave_at_an_angle():
    """A base, a lid on it, and a headed pin through both at 30 degrees: (0.5, 0, 0.866)."""
    hole = rod(8, -20, 90).rotate([0, 30, 0])
    shapes = {
        "base": box((60, 60, 40), (-30, -30, -40)) - hole,
        "lid": box((60, 60, 10), (-30, -30, 0)) - hole,
        "pin": (rod(8, -20, 20) + rod(14, 18, 24)).rotate([0, 30, 0]),
    }
    fixing = plan(product_of(shapes))
    assert fixing.feasible and fixing.order == ("base", "lid", "pin")
    np.testing.assert_allclose(fixing.steps[-1].leaves_along, [0.5, 0, 0.8660], atol=1e-4)
    assert fixing.steps[0].slanted != () and any(fixing.steps[0].directions.values())


def test_several_directions_in_one_product():
    base, pins, expected = box((200, 60, 40), (-100, -30, -40)), {}, {}
    for k in range(5):
        turn, place = [8.0 * k - 20.0, 12.0 + 4.0 * k, 0.0], [36.0 * k - 72.0, 0.0, 0.0]
        base -= rod(8, -20, 60).rotate(turn).translate(place)
        pins[f"pin_{k}"] = rod(8, -20, 40).rotate(turn).translate(place)
        expected[f"pin_{k}"] = RollPitchYaw(np.deg2rad(turn)).ToRotationMatrix() @ [0, 0, 1]
    started = time.process_time()
    fixing = plan(product_of({"base": base} | pins))
    assert fixing.feasible and len(fixing.steps) == 5
    for step in fixing.steps:
        np.testing.assert_allclose(step.leaves_along, expected[step.item], atol=1e-3)
    assert time.process_time() - started < 8.0  # 0.6 s; ten times that is a mistake.


@pytest.mark.parametrize("seed", range(5))
def test_a_prism_leaves_along_the_edge_of_two_faces(seed):
    R = random_rotation(np.random.default_rng(seed))
    R *= np.linalg.det(R)
    fixing = plan(product_of({name: turned(shape, R) for name, shape in tunnel().items()}))
    assert fixing.feasible
    along = 1.0 if fixing.steps[0].item == "prism" else -1.0
    np.testing.assert_allclose(fixing.steps[0].leaves_along, along * R[:, 2], atol=1e-3)


def test_a_dovetail_at_an_angle():
    section = CrossSection([np.array([(-10.0, 0.0), (10.0, 0.0), (6.0, 8.0), (-6.0, 8.0)])])
    shapes = {
        "bed": box((60, 18, 60), (-30, -10, -25)) - section.extrude(60).translate([0, 0, -20]),
        "slide": section.extrude(40).translate([0, 0, -20]),
    }
    R = RollPitchYaw(0.4, 0.3, 0.9).ToRotationMatrix().matrix()
    assert plan(product_of(shapes)).slanted == ()
    fixing = plan(product_of({name: turned(shape, R) for name, shape in shapes.items()}))
    assert fixing.feasible and len(fixing.slanted) >= 2
    cosine = abs(float(np.dot(fixing.steps[0].leaves_along, R[:, 2])))
    assert cosine == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("make", [lambda: load_product("motor_unit"), bolted, peg_in_hole])
def test_a_turned_assembly_gets_the_plan_of_the_unturned_one(make):
    product = replace(make(), joints=())
    straight = plan(product)
    turn = plan(turned_product(product, RotationMatrix.MakeYRotation(np.deg2rad(20.0))))
    assert turn.feasible and turn.order == straight.order
    for one, other in zip(straight.steps, turn.steps, strict=True):
        assert (one.posture, one.fixed_part) == (other.posture, other.fixed_part)
        if any(other.directions.values()):
            continue  # A lid on a slope may be lifted straight up as well.
        way = RotationMatrix.MakeYRotation(np.deg2rad(20.0)) @ np.array(one.leaves_along)
        np.testing.assert_allclose(other.leaves_along, way, atol=1e-3)


@pytest.mark.parametrize("make", [bolted, peg_in_hole, tube_and_pins])
def test_nothing_is_searched_where_the_six_suffice(make, monkeypatch):
    def fail(*_, **__):
        raise AssertionError("searched")

    monkeypatch.setattr("planning.assembly_plan.order_search.further_ways", fail)
    monkeypatch.setattr("planning.assembly_plan.order_search.step_ways", fail)
    fixing = plan(make())
    assert fixing.feasible and fixing.slanted == ()
    assert all(step.slanted == () for step in fixing.steps)


def test_a_requested_order_gets_the_direction_it_lacks():
    """A slider on a ramp, under a bridge: lifted out before the bridge, drawn up the ramp after."""
    shapes = {
        "base": box((60, 30, 20), (-30, -15, -20)) - box((80, 10, 12), (-20, -5, -10)),
        "slider": box((40, 10, 8), (-20, -5, -10)),
        "bridge": box((20, 30, 6), (-10, -15, 0)),
    }
    product = product_of({name: shape.rotate([0, -30, 0]) for name, shape in shapes.items()})
    free = plan(product)
    assert free.feasible and free.slanted == () and free.order.index("slider") < 2
    asked = plan(product, ("base", "bridge", "slider"))
    assert asked.feasible and asked.order == ("base", "bridge", "slider")
    np.testing.assert_allclose(asked.steps[1].leaves_along, [0.8660, 0, 0.5], atol=1e-4)
    assert asked.steps[1].posture == "+x"


def captured_ball() -> dict[str, Manifold]:
    """Printed in place: a ball with a shank in a socket that reaches over it, 0.25 mm of play."""
    socket = box((30, 30, 18), (-15, -15, -14)) - Manifold.sphere(8.25, 48)
    socket -= Manifold.cylinder(20, 5.5, 9, 48).translate([0, 0, 2])
    return {"socket": socket, "ball": Manifold.sphere(8, 48) + rod(6, 0, 30, 32)}


def hinge() -> dict[str, Manifold]:
    """A pin with two heads in the knuckles of two leaves."""
    knuckles = [rod(12, 10 * k, 10 * k + 10, 48) for k in range(3)]
    leaf_1 = knuckles[0] + knuckles[2] + box((4, 30, 30), (-2, 0, 0))
    leaf_2 = knuckles[1] + box((4, 30, 10), (-2, -30, 10))
    bore = rod(5, -5, 40, 32)
    pin = bore.trim_by_plane([0, 0, -1], -35) + rod(9, -8, 0, 32) + rod(9, 30, 38, 32)
    return {
        "leaf_1": leaf_1 - bore - rod(12.4, 10, 20, 48),
        "leaf_2": leaf_2 - bore,
        "pin": pin,
    }


def spool() -> dict[str, Manifold]:
    """A spool on a spindle, between two springs that snap under its collars."""
    spindle = rod(6, -20, 20, 32) + rod(10, -24, -20, 32) + rod(10, 20, 24, 32)
    ring = rod(30, -12, 12, 48) - rod(6, -13, 13, 32)
    springs = {
        f"spring_{k}": (rod(9, low, low + 8, 32) - rod(6, low - 1, low + 9, 32))
        for k, low in ((1, -20), (2, 12))
    }
    return {"spindle": spindle, "spool": ring} | springs


@pytest.mark.parametrize("make", [hinge, spool, captured_ball])
def test_what_is_captured_stays_infeasible_with_the_reason(make):
    shapes = make()
    fixing = plan(product_of(shapes), tolerance=3e-4 if make is captured_ball else None)
    assert not fixing.feasible and fixing.stop is not None and fixing.orders is not None
    interlock = fixing.orders.interlock
    assert interlock is not None and interlock.stuck == tuple(shapes)
    reason = fixing.orders.reason
    for words in ("six directions", "slanted ones from contacts", "threads", "no rotations"):
        assert words in reason
    assert all(name in reason for name in shapes)
    assert "slanted ones from contacts" in fixing.stop.reason


def test_a_slanted_direction_counts_as_the_axis_nearest_to_it():
    half = np.sqrt(0.5)
    assert nearest_axis((half, 0.0, half), "+z") == "+z" == nearest_axis((half, 0, half), "-z")
    assert nearest_axis((half, 0.0, half), "+x") == "+x"
    assert nearest_axis((0.5, 0.1, -0.8), "+z") == "-z"
    ways = [(0.6, 0.0, 0.8), (0.8, 0.0, 0.6), (0.1, 0.0, 0.995)]
    assert open_postures(["-y"], ways, "+z") == ["+x", "-y", "+z"]
    assert leaving_way("+z", ["-y"], ways) == ways[2]
    assert leaving_way("-y", ["-y"], ways) == (0.0, -1.0, 0.0)
    assert direction_label((0.5, -0.0, 0.8660254)) == "(0.5, 0, 0.866)"


def test_candidates_of_a_pin_begin_with_its_axis():
    """The null direction of 64 facets' normals, more precise than any two of them."""
    block, pin = (solid(to) for to in shapes_of(36.0))
    normals = body_normals([[pin], [block]], [(0, 1)], FIT_TOLERANCE)
    axes = candidate_axes([block, pin], normals)
    angle = np.deg2rad(36.0)
    np.testing.assert_allclose(axes[0], [np.sin(angle), 0, np.cos(angle)], atol=1e-6)
    assert (np.abs(axes).max(axis=1) < 1.0 - 1e-7).all()


def test_edges_that_touch_propose_nothing_but_the_parts_own_axes():
    low = solid(box((10, 10, 10), (-5, -5, -5)).rotate([10, 20, 30]))
    high = solid(box((10, 10, 10), (-5, -5, -5)).rotate([10, 20, 30]).translate([30, 0, 0]))
    normals = {(0, 1): (np.zeros((0, 3)), np.zeros(0))}
    assert len(candidate_axes([low, high], normals)) >= 1
    assert not local_hits(np.eye(3), normals, 2).any()


def shapes_of(degrees: float) -> list[Manifold]:
    hole = rod(8, -20, 90).rotate([0, degrees, 0])
    pin = rod(8, -20, 60).rotate([0, degrees, 0])
    return [box((60, 60, 40), (-30, -30, -40)) - hole, pin]


def test_plan_file_keeps_its_six_keys_and_adds_the_slanted(tmp_path):
    fixing = plan(pin_at(36.0))
    save_plan(fixing, tmp_path / "plan.json")
    data = json.loads((tmp_path / "plan.json").read_text())
    assert list(data["free"]) == list(data["reachable"]) == list(DIRECTIONS)
    (step,) = data["steps"]
    assert list(step["directions"]) == list(DIRECTIONS) and step["posture"] in DIRECTIONS
    assert step["slanted"] == [step["leaves_along"]]
    way = next(w for w in data["slanted"] if w["direction"] == step["leaves_along"])
    assert way["free"] == way["reachable"] == [[0, 0], [1, 0]]
    after = load_plan(tmp_path / "plan.json")
    assert plan_to_dict(after) == plan_to_dict(fixing) and after.steps == fixing.steps
    assert "(0.588, 0, 0.809)" in step_texts(fixing.lines[0])[0]


def test_the_general_rule_knows_what_comes_at_an_angle():
    """The pin comes from above on the block; with the block on its side, or upside down, not."""
    product = pin_at(36.0, width=44.0)
    fixing = plan(product)
    assert fixing.matrices is not None
    setup = FixtureSetup.of(CellConfig())
    (choice,) = general_rule(product, fixing.order, fixing.steps, fixing.matrices, setup)
    approach = {(c.name, c.up): c.approach for c in choice.candidates}
    assert approach["block", "+z"] == "above" and approach["block", "-z"] == "below"
    assert approach["block", "+x"] == approach["block", "+y"] == "the side"
    assert approach["pin", "-z"] == "above" and approach["pin", "+z"] == "below"
    held = next(c for c in choice.candidates if (c.name, c.up) == ("block", "+z"))
    # Horizontal share of the force, and friction on the rest: sin 36 + 0.3 cos 36.
    force = setup.insertion_force * (0.5878 + 0.3 * 0.8090)
    assert held.figures["pushed_across_N"] == pytest.approx(force, rel=1e-3)
    if held.scores:
        assert held.scores["reach"] == pytest.approx((1.0 + 0.8090) / 2.0, abs=1e-3)


def test_a_proposal_prefers_the_axes():
    def proposal(directions, slanted):
        return Proposal("a", ("a",), ("b",), directions, "+z", False, False, slanted)

    assert proposal(["+z"], [(0.6, 0.0, 0.8)]).steepest is None
    assert proposal([], [(0.6, 0.0, 0.8), (0.8, 0, 0.6)]).steepest == (0.6, 0.0, 0.8)
    assert proposal([], [(0.8, 0.0, -0.6)]).approach == "below"
    assert proposal([], [(0.6, 0.8, 0.0)]).approach == "the side"


def test_the_twin_refuses_what_comes_at_an_angle():
    product = pin_at(36.0)
    with pytest.raises(NoOperation, match="at an angle"):
        steps(product, plan(product))
