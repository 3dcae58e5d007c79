"""Common volume of parts: how deep and where, what is meant and what is an error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from manifold3d import Manifold
from tiny_products import bolted, box, product_of, rod, to_trimesh

from cell.errors import InputError, UnknownName
from cell.products.declared import declared_from
from cell.products.product import Product
from planning import plan
from planning.assembly_plan.explain import overlap_text
from planning.feasibility.contact import contact_matrix, gap_matrix
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.matrices import AssemblyMatrices, matrices_of
from planning.feasibility.overlap_depth import overlap_of
from planning.feasibility.solids import Solid, solids_of

TOLERANCE = 5e-5
BLOCK = box((40, 40, 20), (-20, -20, 0))


def solid(shape: Manifold, name: str = "a") -> Solid:
    mesh = to_trimesh(shape)
    return Solid(name, np.array(mesh.vertices), np.array(mesh.faces), 1.0, np.zeros(3))


def two_blocks(gap: float) -> Product:
    """Two 20 mm cubes, the second above the first by a gap [mm]."""
    return product_of(
        {"low": box((20, 20, 20), (0, 0, 0)), "high": box((20, 20, 20), (3, 4, 20 + gap))}
    )


def pressed(interference: float, **declared: list[str]) -> Product:
    """A pin pressed into a blind hole, by an interference on the radius [mm]."""
    shapes = {"block": BLOCK - rod(10, 5, 25, 96), "pin": rod(10 + 2 * interference, 5, 35, 96)}
    product = product_of(shapes)
    return replace(product, declared=declared_from(product, **declared))


def ways(matrices: AssemblyMatrices, part: str, other: str) -> list[str]:
    """The directions in which a part leaves another."""
    (i, k), free = matrices.indices([part, other]), matrices.interference.free
    return [j for j in DIRECTIONS if free[j][i, k]]


@pytest.mark.parametrize(
    ("shape", "depth", "place"),
    [
        (box((10, 10, 5), (0, 0, 19.5)), 0.5, (None, None, 19.5)),  # A slab.
        (rod(4, 16, 40), 4.0, (None, None, 16.0)),  # A peg where a hole is missing.
        (Manifold.sphere(5, 96).translate([1, 2, 23]), 2.0, (1.0, 2.0, 18.0)),  # A ball.
        (Manifold.sphere(3, 48).translate([0, 0, 10]), 10.0, (None, None, 10.0)),  # Inside.
        (BLOCK, 20.0, (None, None, 10.0)),  # The same block twice, in one place.
    ],
    ids=["slab", "peg", "ball", "inside", "copy"],
)
def test_depth_and_place_are_those_of_the_deepest_point(shape, depth, place):
    found = overlap_of(solid(BLOCK), solid(shape, "b"))
    assert 1e3 * found.depth == pytest.approx(depth, rel=0.01)
    for value, known in zip(found.p_AoD, place, strict=True):
        assert known is None or 1e3 * value == pytest.approx(known, abs=0.35)
    assert 1e9 * found.volume == pytest.approx((BLOCK ^ shape).volume())


@pytest.mark.parametrize("axis", [[0, 0, 0], [30, 0, 0], [20, 50, 0]])
@pytest.mark.parametrize("interference", [0.01, 0.1, 0.3])
def test_depth_of_a_ring_is_its_thickness(interference, axis):
    block = (BLOCK - rod(10, -1, 21, 96)).rotate(axis)
    pin = rod(10 + 2 * interference, -5, 35, 96).rotate(axis)
    found = overlap_of(solid(block), solid(pin, "b"))
    assert 1e3 * found.depth == pytest.approx(interference, abs=0.004)  # Sagitta: 2.7 um.


@pytest.mark.parametrize("shift", [0.0, 1e-9, 3e-8, -1e-8, 4e-7])
def test_a_film_between_flush_faces_hides_no_overlap(shift):
    """The lid lies on the rim by rounding; the peg in its middle sticks 4 mm into it."""
    base = box((60, 60, 10), (-30, -30, 0)) + box((2, 2, 4), (-1, -1, 10))
    lid = box((60, 60, 10), (-30, -30, 10 + shift))
    found = overlap_of(solid(base), solid(lid, "b"))
    assert 1e3 * found.depth == pytest.approx(4.0, abs=1e-3)
    (error,) = matrices_of(product_of({"base": base, "lid": lid})).errors
    assert error.depth == found.depth


@pytest.mark.parametrize("gap", [0.0, 1e-9, 0.01, 1.0])
def test_parts_that_only_touch_do_not_overlap(gap):
    low, high = solids_of(two_blocks(gap)).values()
    assert overlap_of(low, high).depth == 0.0


@pytest.mark.parametrize("depth", [0.06, 1.0])
def test_every_overlap_beyond_the_tolerance_is_listed(depth):
    blocks = {f"block_{k}": box((20, 20, 20), ((20 - depth) * k, 0, 0)) for k in range(3)}
    fixing = plan(product_of(blocks), tolerance=TOLERANCE)
    found = {(one.part, one.other): 1e3 * one.depth for one in fixing.overlaps}
    known = {("block_0", "block_1"): depth, ("block_1", "block_2"): depth}
    assert found == pytest.approx(known, rel=1e-6)
    assert not fixing.feasible


@pytest.mark.parametrize("gap", [0.0, -0.04, 1.0])
def test_overlap_within_the_tolerance_is_accepted(gap):
    assert not matrices_of(two_blocks(gap), TOLERANCE).errors


def test_contained_parts_overlap():
    seed = rod(4, 8, 12).translate([10, 10, 0])
    (error,) = matrices_of(product_of({"block": BLOCK, "seed": seed})).errors
    assert (error.part, error.other) == ("block", "seed")


@pytest.mark.parametrize(("hole", "pin"), [(24, 36), (12, 64), (16, 24), (96, 12), (24, 24)])
@pytest.mark.parametrize("radius", [5.0, 25.0])
def test_facets_that_do_not_match_are_a_line_to_line_fit(hole, pin, radius):
    """A hole of radius 25 mm with 12 facets lies 0.85 mm inside its circle."""
    block = box((80, 80, 20), (-40, -40, 0)) - rod(2 * radius, 5, 25, hole)
    peg = rod(2 * radius, 5, 35, pin).rotate([0, 0, 180 / hole])
    matrices = matrices_of(product_of({"block": block, "peg": peg}))
    assert not matrices.errors
    assert ways(matrices, "peg", "block") == ["+z"]


@pytest.mark.parametrize("interference", [0.15, 0.3])
def test_an_overlap_deeper_than_the_facets_are_coarse_is_an_error(interference):
    """64 facets lie 0.03 mm off a circle of radius 25 mm; chamfers and flats are no curves."""
    for facets in (64, 96):
        hole = rod(50, 5, 25, facets) + Manifold.cylinder(2, 25, 27, facets).translate([0, 0, 18])
        block = box((80, 80, 20), (-40, -40, 0)) - hole
        peg = rod(50 + 2 * interference, 5, 35, facets).rotate([0, 0, 1.3])
        assert len(matrices_of(product_of({"block": block, "peg": peg})).errors) == 1


def test_the_rest_of_an_assembly_is_decided_all_the_same():
    """Two of four blocks on a plate overlap; what holds for the others does not change."""
    shapes = {"plate": box((80, 40, 5), (-40, -20, -5))}
    shapes |= {f"block_{k}": box((10, 10, 10), (12 * k - 30, 0, 0)) for k in range(4)}
    sound = matrices_of(product_of(shapes))
    faulty = matrices_of(product_of(shapes | {"block_3": box((10, 10, 10), (3.5, 0, 0))}))
    assert {(one.part, one.other) for one in faulty.errors} == {("block_2", "block_3")}
    for j in DIRECTIONS:
        np.testing.assert_array_equal(
            faulty.interference.free[j][:4, :4], sound.interference.free[j][:4, :4]
        )
    np.testing.assert_array_equal(faulty.contact[:4, :4], sound.contact[:4, :4])


def test_a_declared_press_fit_is_planned_and_reported():
    fixing = plan(pressed(0.1, press=["block,pin"]))
    assert fixing.feasible and fixing.evidence and fixing.matrices
    assert ways(fixing.matrices, "pin", "block") == ["+z"]
    (one,) = fixing.evidence.overlaps
    assert one.kind == "press"
    assert 1e3 * one.depth == pytest.approx(0.1, abs=0.003)


def test_an_undeclared_press_fit_is_not_feasible_and_recognised():
    fixing = plan(pressed(0.1))
    assert not fixing.feasible
    assert [one.press_fit for one in fixing.overlaps] == [True]
    assert "a press fit by its shape" in overlap_text(fixing)
    assert "--press block,pin" in overlap_text(fixing)


@pytest.mark.parametrize("accept", ["plate,key", "key,plate", "all"])
def test_an_accepted_overlap_counts_as_contact(accept):
    """A key drawn 0.3 mm into a plate: it leaves upwards and sideways as if it lay on it."""
    product = product_of({"plate": BLOCK, "key": box((10, 10, 10), (-5, -5, 19.7))})
    fixing = plan(replace(product, declared=declared_from(product, accept=[accept])))
    assert fixing.feasible and fixing.contact[0, 1] == 1 and fixing.matrices
    assert "+z" in ways(fixing.matrices, "key", "plate")
    assert "-z" not in ways(fixing.matrices, "key", "plate")


def test_accepting_all_overlaps_leaves_threads_threads():
    base = box((30, 30, 20), (-15, -15, -20)) - rod(2.5, -10, 5, 32)
    key = box((5, 5, 5), (8, 8, -0.5))
    product = product_of({"base": base, "bolt": rod(3, -5, 6, 32), "key": key})
    matrices = matrices_of(replace(product, declared=declared_from(product, accept=["all"])))
    assert [(thread.bolt, thread.nut) for thread in matrices.threads] == [("bolt", "base")]
    assert [(one.part, one.other, one.kind) for one in matrices.overlaps.others] == [
        ("base", "key", "accept")
    ]


def test_what_is_declared_without_effect_is_said():
    product = two_blocks(0.0)
    declared = declared_from(product, press=["low,high"], snap=["high,low"], flexible=["low"])
    fixing = plan(replace(product, declared=declared))
    assert fixing.evidence
    idle = [remark for remark in fixing.evidence.remarks if "without effect" in remark]
    assert [remark.split(": ")[1].split(",")[0] for remark in idle] == [
        "press high",
        "snap high",
        "flexible low",
    ]


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"press": ["block"]}, "write two different parts"),
        ({"press": ["block,block"]}, "write two different parts"),
        ({"accept": ["block,pin,pin"]}, "write two different parts"),
        ({"snap": ["block,pni"]}, "No part or group 'pni'. Did you mean 'pin'"),
        ({"flexible": ["belt"]}, "No part or group 'belt'"),
    ],
)
def test_wrong_declarations_name_the_culprit(declared, message):
    with pytest.raises((InputError, UnknownName), match=message):
        pressed(0.1, **declared)


def test_a_group_stands_for_its_parts_in_declarations():
    shapes = {f"pin_{k}": rod(4, 0, 5).translate([6 * k, 0, 0]) for k in range(2)}
    product = product_of({"block": BLOCK, **shapes}, groups={"pins": ("pin_0", "pin_1")})
    declared = declared_from(product, accept=["pins,block"])
    assert declared.accept == {frozenset(("block", f"pin_{k}")) for k in range(2)}


def test_thread_drawn_at_the_tap_drill_is_cut_for_a_declared_fastener():
    product = bolted(thread=2.5)
    matrices = matrices_of(product, TOLERANCE)
    assert not matrices.errors
    assert ways(matrices, "bolt", "base") == ["+z"]
    gaps = gap_matrix(list(matrices.solids.values()), 1e-4)
    assert contact_matrix(gaps, TOLERANCE)[0, 2] == 1


def test_a_bolt_far_thicker_than_its_hole_is_an_error():
    """Overlap of 1 mm is no thread of pitch 0.5 mm."""
    (error,) = matrices_of(bolted(thread=1.0), TOLERANCE).errors
    assert (error.part, error.other) == ("base", "bolt")


@pytest.mark.parametrize("interference", [0.02, 0.06, 0.12])
def test_feasibility_is_never_lost_as_the_tolerance_grows(interference):
    verdicts = [
        plan(pressed(interference), tolerance=1e-3 * tolerance).feasible
        for tolerance in np.linspace(0.01, 0.15, 8)
    ]
    assert verdicts == sorted(verdicts) and verdicts[-1]
