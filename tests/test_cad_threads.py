"""Screw threads from the meshes alone: which overlaps are threads, and where their axis points."""

from __future__ import annotations

import numpy as np
import pytest
from cad_screws import solid
from manifold3d import Manifold
from pydrake.math import RigidTransform
from tiny_products import bolted, box, product_of, rod, to_trimesh

from cell.products.product import Part, Product
from planning import plan
from planning.feasibility.cad_threads import find_press_fit, find_thread
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.matrices import matrices_of

TOLERANCE = 5e-5


def undeclared(thread: float) -> Product:
    """The bolted lid, without saying that the bolt is one."""
    return product_of({name: part for name, part in bolted_shapes(thread).items()})


def bolted_shapes(thread: float) -> dict[str, Manifold]:
    base = box((30, 30, 20), (-15, -15, -20)) - rod(thread, -10, 5, 32)
    lid = box((30, 30, 5), (-15, -15, 0)) - rod(3.4, -5, 10, 32)
    return {"base": base, "lid": lid, "bolt": rod(3, -5, 6, 64) + rod(5.5, 5, 8, 32)}


def overlapping(shapes: dict[str, Manifold]) -> set[tuple[str, str]]:
    """The pairs that overlap by an error of the CAD."""
    return {(one.part, one.other) for one in matrices_of(product_of(shapes)).errors}


@pytest.mark.parametrize("thread", [2.387, 2.5, 2.6])
def test_a_bolt_in_its_tap_drill_hole_is_a_fastener(thread):
    """M3 minor diameter, tap drill, and a wider one; nothing says what the parts are."""
    matrices = matrices_of(undeclared(thread))
    (found,) = matrices.threads
    assert (found.bolt, found.nut) == ("bolt", "base")
    np.testing.assert_allclose(found.axis, [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(found.p_AoT, [0, 0, -2.5e-3], atol=1e-6)
    assert found.diameter == pytest.approx(3e-3, rel=1e-6)
    assert found.height == pytest.approx((3.0 - thread) / 2 * 1e-3, rel=0.02)
    assert found.length == pytest.approx(5e-3, rel=1e-6)


def test_a_bolt_leaves_along_its_thread_only():
    matrices = matrices_of(undeclared(2.5))
    names = list(matrices.solids)
    bolt, base = names.index("bolt"), names.index("base")
    free = [j for j in DIRECTIONS if matrices.interference.free[j][bolt, base]]
    assert free == ["+z"] and matrices.contact[base, bolt] == 1
    blocked = {(b.direction) for b in matrices.interference.blockers if b.moving == "bolt"}
    assert "+z" not in blocked


def test_a_declared_fastener_gives_the_same_plan_as_a_recognised_one():
    declared, recognised = plan(bolted(2.5)), plan(undeclared(2.5), ("base", "lid", "bolt"))
    assert declared.feasible and recognised.feasible
    for j in DIRECTIONS:
        np.testing.assert_array_equal(declared.free[j], recognised.free[j])


@pytest.mark.parametrize("seed", range(5))
def test_a_thread_is_found_in_any_pose(seed):
    """Turned and moved at random; the axis turns with it and points to the head."""
    rng = np.random.default_rng(seed)
    turn, move = rng.uniform(-180, 180, 3), rng.uniform(-50, 50, 3)
    shapes = {
        name: shape.rotate(list(turn)).translate(list(move))
        for name, shape in bolted_shapes(2.5).items()
    }
    found = find_thread(solid(shapes["base"], "base"), solid(shapes["bolt"], "bolt"), TOLERANCE)
    assert found is not None and (found.bolt, found.nut) == ("bolt", "base")
    axis = Manifold.cube([1e-3, 1e-3, 1.0], True).rotate(list(turn)).to_mesh64()
    corners = np.array(axis.vert_properties)[:, :3]
    along = np.linalg.svd(corners - corners.mean(axis=0))[2][0]
    assert abs(along @ np.array(found.axis)) == pytest.approx(1.0, abs=1e-4)
    head = np.array(shapes["bolt"].to_mesh64().vert_properties)[:, :3].mean(axis=0)
    assert (1e-3 * head - np.array(found.p_AoT)) @ np.array(found.axis) > 0.0


def test_a_nut_on_a_bolt_with_a_bore_is_found():
    """The bolt is a tube itself: what fills the wall inside the thread decides, not the axis."""
    nut = box((18, 18, 8), (-9, -9, 0)) - rod(8.5, -1, 9, 48)
    stud = rod(10, -20, 20, 64) - rod(5, -30, 30, 32)
    found = find_thread(solid(nut, "nut"), solid(stud, "stud"), TOLERANCE)
    assert found is not None and (found.bolt, found.nut) == ("stud", "nut")


@pytest.mark.parametrize(
    ("hole", "peg"),
    [
        (rod(20, -1, 21) - rod(1, -1, 1), rod(10, 0, 30)),  # A peg sunk in solid material.
        (rod(10, 5, 25, 64), rod(10.24, 5, 35, 64)),  # A press fit: far too shallow for a thread.
        (rod(6, 5, 25, 64), rod(10, 5, 35, 64)),  # A peg far too thick for its hole.
    ],
    ids=["solid", "press fit", "gross"],
)
def test_other_overlaps_are_errors(hole, peg):
    block = box((40, 40, 20), (-20, -20, 0)) - hole
    assert overlapping({"block": block, "peg": peg}) == {("block", "peg")}


def test_a_half_sunk_key_is_no_thread():
    """A flat layer of overlap, as thin as a thread but not round."""
    plate, key = box((40, 40, 10), (-20, -20, 0)), box((10, 10, 10), (-5, -5, 9.7))
    assert overlapping({"plate": plate, "key": key}) == {("plate", "key")}


FLUSH = {
    "end on the floor of the hole": box((30, 30, 20), (-15, -15, -20)) - rod(3.3, -8, 5, 32),
    "head on the nut": box((20, 20, 8), (-10, -10, -8)) - rod(3.3, -9, 5, 32),
    "both": box((20, 20, 20), (-10, -10, -20)) - rod(3.3, -8, 5, 32),
}


@pytest.mark.parametrize("rounding", [0.0, 1e-9, 1e-8, 1e-7, 1e-6])
@pytest.mark.parametrize("where", FLUSH)
def test_faces_of_the_bolt_that_lie_on_the_nut_do_not_hide_its_thread(where, rounding):
    """Rounding makes a film of common volume there, which may be wider than the thread."""
    head = rod(7, 0, 4, 24) if where != "end on the floor of the hole" else rod(4, 0, 4, 32)
    shapes = {"nut": FLUSH[where], "bolt": rod(4, -8 if where != "head on the nut" else -12, 1, 32)}
    shapes["bolt"] += head
    for seed in range(4):
        rng = np.random.default_rng(seed)
        nut, bolt = (solid(shape, name) for name, shape in shapes.items())
        for each in (nut, bolt):
            each.vertices[:] += rng.uniform(-rounding, rounding, each.vertices.shape)
        found = find_thread(nut, bolt, TOLERANCE)
        assert found is not None and (found.bolt, found.nut) == ("bolt", "nut")
        assert found.height == pytest.approx(0.35e-3, abs=2e-5)
        np.testing.assert_allclose(np.abs(found.axis), [0, 0, 1], atol=1e-3)


@pytest.mark.parametrize("sink", [0.055, 0.07, 0.095, 0.11])
@pytest.mark.parametrize("tilt", [0.0, 30.0, 45.0])
def test_a_layer_thicker_than_the_tolerance_is_an_error(sink, tilt):
    """Up to twice the tolerance it does not block across, but it is an overlap all the same."""
    plate, cube = box((40, 40, 10), (-20, -20, 0)), box((10, 10, 10), (-5, -5, 10 - sink))
    shapes = {name: s.rotate([tilt, 0, 0]) for name, s in {"plate": plate, "cube": cube}.items()}
    (error,) = matrices_of(product_of(shapes), TOLERANCE).errors
    assert error.depth == pytest.approx(1e-3 * sink, rel=1e-3)


@pytest.mark.parametrize("sink", [0.02, 0.045])
def test_a_thinner_layer_is_a_fit(sink):
    plate, cube = box((40, 40, 10), (-20, -20, 0)), box((10, 10, 10), (-5, -5, 10 - sink))
    free = matrices_of(product_of({"plate": plate, "cube": cube}), TOLERANCE).interference.free
    assert [j for j in DIRECTIONS if free[j][1, 0]] == ["+x", "-x", "+y", "-y", "+z"]


@pytest.mark.parametrize("thread", [2.81, 2.85, 2.87])
def test_a_fine_thread_of_one_to_two_tolerances_is_a_fastener(thread):
    """0.065 to 0.095 mm deep on 3 mm: it leaves along its axis, as thread and not as a fit."""
    matrices = matrices_of(undeclared(thread), TOLERANCE)
    (found,) = matrices.threads
    assert (found.bolt, found.nut) == ("bolt", "base")
    assert [j for j in DIRECTIONS if matrices.interference.free[j][2, 0]] == ["+z"]


@pytest.mark.parametrize(
    ("facets", "diameter", "places"),
    [
        (32, 3.0, [(12.5, 0.0)]),
        (24, 6.0, [(-12.5, 0.37), (0.0, 0.37), (13.75, 0.37)]),
        (96, 6.0, [(-13.75, 0.37), (0.0, 0.0), (12.5, 0.37)]),
        (32, 2.0, [(-12.5, 0.0), (0.0, 0.37), (13.75, 0.37)]),
    ],
)
@pytest.mark.parametrize("overlap", [0.0, 0.5])
def test_bolts_drawn_on_their_holes_leave(facets, diameter, places, overlap):
    """Hole and bolt share their corners up to rounding: of holes drawn so, or cut by the bolt.

    Where edges coincide, rounding dents the clipped polygons; a line may cross them four times.
    """
    block = box((60, 60, 20), (-30, -30, -20))
    for x, y in places:
        block -= rod(diameter - overlap, -5, 5, facets).translate([x, y, 0])
    mesh = to_trimesh(rod(diameter, -5, 6, facets) + rod(1.8 * diameter, 5, 8, 32))
    parts = dict(product_of({"block": block}).parts)
    for k, (x, y) in enumerate(places):
        X_AP = RigidTransform([1e-3 * x, 1e-3 * y, 0.0])
        parts[f"bolt_{k}"] = Part(f"bolt_{k}", mesh, 1e-3, X_AP)
    matrices = matrices_of(Product("tiny", parts), TOLERANCE)
    assert len(matrices.threads) == (len(places) if overlap else 0)
    for bolt in range(1, 1 + len(places)):
        assert [j for j in DIRECTIONS if matrices.interference.free[j][bolt, 0]] == ["+z"]


TOLERANCES = (1e-6, 1e-5, 2e-5, 4.6e-5, 5e-5, 7e-5, 1e-4, 2e-4, 3e-4)

BLOCK = box((30, 30, 20), (-15, -15, -20))
DRILLED = (
    BLOCK
    - rod(5, -12, 1, 32)
    - Manifold.cylinder(1.5, 0, 2.5, 32).translate([0, 0, -13.5])  # The cone that a drill leaves.
)


def m6(tip: float) -> Manifold:
    return rod(6, tip, 6, 48) + rod(10, 6, 10, 6)


def locknut(lip: float, length: float, bore: float = 5.0) -> Manifold:
    """Nut from z = 8 to 12, with a collar of the lip's bore at its end.

    The nut's facets are turned by half of one against the bolt's: films lie between them.
    """
    nut = rod(10, 8, 12, 6) - rod(bore, 7, 13).rotate([0, 0, 180 / 64])
    return nut + (rod(10, 12, 12 + length, 6) - rod(lip, 11, 14, 32))


@pytest.mark.parametrize(
    ("nut", "bolt", "height", "length"),
    [
        (locknut(4.25, 0.4), rod(5, -4, 20), 0.375, 0.4),
        (locknut(4.5, 0.4), rod(5, -4, 20), 0.25, 0.4),
        (locknut(4.0, 0.5, bore=4.2), rod(5, -4, 20), 0.4, 4.5),
        (DRILLED, m6(-11), 0.5, 11),
        (DRILLED, m6(-12.5), 0.5, 12.5),
        (BLOCK - rod(5, -21, 1, 32) - Manifold.cylinder(2, 2.5, 4.5, 32).translate([0, 0, -1.99]),
         m6(-11), 0.5, 9.4),
        (BLOCK - rod(5, -21, 1, 32),
         m6(-13) + Manifold.cylinder(1, 2.2, 3, 48).translate([0, 0, -14]), 0.5, 13.5),
    ],
    ids=["lip", "flat lip", "tapped with a lip", "blind", "tip in the cone", "countersunk",
         "chamfered"],
)  # fmt: skip
@pytest.mark.parametrize("turn", [(0, 0, 0), (30, 20, 10)], ids=["upright", "slanted"])
def test_a_thread_is_one_at_every_tolerance(nut, bolt, height, length, turn):
    """Films between facets, a lip, a cone: what goes all around the axis decides."""
    parts = [solid(shape.rotate(list(turn)), name) for shape, name in ((nut, "n"), (bolt, "b"))]
    for tolerance in TOLERANCES:
        found = find_thread(parts[0], parts[1], tolerance)
        assert found is not None and (found.bolt, found.nut) == ("b", "n")
        assert found.height == pytest.approx(1e-3 * height, rel=0.05)
        assert found.length == pytest.approx(1e-3 * length, rel=0.02)
        assert found.pitch is None
        assert find_press_fit(parts[0], parts[1], tolerance) is None


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (rod(40, -0.3, 8) - rod(10, -2, 10), rod(10, -5, 30) + rod(11, -20, 0)),
        (rod(40, -0.3, 8) - rod(10, -2, 10), rod(10, -5, 30) + rod(12.6, -20, 0)),
        (rod(40, -0.3, 8) - rod(10, -2, 10), rod(10, -5, 30) + rod(16, -20, 0)),
        (rod(40, -0.3, 8) - rod(10.2, -2, 10), rod(10, -5, 30) + rod(16, -20, 0)),
        (box((20, 20, 5), (-10, -10, 0)), rod(8, -9.7, 0.3)),
        (DRILLED, m6(-17)),
    ],
    ids=["low shoulder", "shoulder", "high shoulder", "loose on its shaft", "disc in a plate",
         "tip beyond the hole"],
)  # fmt: skip
def test_a_part_driven_into_a_shoulder_is_no_thread(a, b):
    parts = solid(a, "a"), solid(b, "b")
    for tolerance in TOLERANCES:
        assert find_thread(*parts, tolerance) is None
        assert find_press_fit(*parts, tolerance) is None


@pytest.mark.parametrize(
    ("diameter", "interference"), [(6, 0.04), (6, 0.1), (10, 0.04), (10, 0.1), (3, 0.05)]
)
def test_a_press_fit_is_told_from_a_thread(diameter, interference):
    """Far shallower than the finest thread of its diameter; it is reported with its depth."""
    block = BLOCK - rod(diameter, -10, 1, 48)
    pin = rod(diameter + 2 * interference, -10, 5)
    parts = solid(block, "block"), solid(pin, "pin")
    for tolerance in TOLERANCES:
        assert find_thread(*parts, tolerance) is None
        found = find_press_fit(*parts, tolerance)
        if 1e3 * tolerance < interference:
            assert found is not None and (found.pin, found.hole) == ("pin", "block")
            assert found.interference == pytest.approx(1e-3 * interference, abs=6e-6)
            assert found.length == pytest.approx(10e-3, rel=0.01)
            assert abs(found.axis[2]) == pytest.approx(1.0, abs=1e-9)
        elif 1e3 * tolerance > 1.2 * interference:
            assert found is None


def test_a_sunk_head_is_an_overlap_until_it_is_within_the_tolerance():
    """What the two share beyond the thread counts; once it does not, it never does again."""
    bolt = rod(6, -11, -0.03, 48) + rod(10, -0.03, 4, 6)
    parts = solid(DRILLED, "nut"), solid(bolt, "bolt")
    found = [find_thread(*parts, tolerance) is not None for tolerance in TOLERANCES]
    assert found == sorted(found) and not found[0] and found[-1]
