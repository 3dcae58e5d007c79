"""Interference-free matrices: laws, known answers, and agreement with a boolean sweep."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold
from oracle import is_blocked
from tiny_products import (
    box,
    interlocked_links,
    peg_in_hole,
    product_of,
    rod,
    stack_of_three,
    to_trimesh,
    tube_and_pins,
)

from planning.feasibility.blocking import FRAGILE, decisions
from planning.feasibility.directions import DIRECTIONS, opposite, unit_vector
from planning.feasibility.envelope import envelope
from planning.feasibility.interference import FIT_TOLERANCE, first_hit, interference
from planning.feasibility.solids import Solid, solids_of

PRODUCTS = [peg_in_hole, interlocked_links, stack_of_three, tube_and_pins]


def solid(shape: Manifold, name: str = "shape") -> Solid:
    mesh = to_trimesh(shape)
    return Solid(name, np.array(mesh.vertices), np.array(mesh.faces), 1.0, np.zeros(3))


def leaves(product, part: str, other: str) -> list[str]:
    names = list(product.parts)
    free = interference(list(solids_of(product).values())).free
    return [j for j in DIRECTIONS if free[j][names.index(part), names.index(other)]]


@pytest.mark.parametrize("make", PRODUCTS)
def test_blocking_is_mutual_under_reversal(make):
    """If i moving along j hits k, then k moving against j hits i."""
    free = interference(list(solids_of(make()).values())).free
    for j in DIRECTIONS:
        np.testing.assert_array_equal(free[j], free[opposite(j)].T)
        assert not free[j].diagonal().any()


@pytest.mark.parametrize("make", PRODUCTS)
def test_every_zero_has_its_evidence(make):
    """Blockers and the zeros off the diagonal are the same set."""
    solids = solids_of(make())
    names = list(solids)
    result = interference(list(solids.values()))
    zeros = {
        (names[i], names[k], j)
        for j in DIRECTIONS
        for i, k in np.argwhere(result.free[j] == 0)
        if i != k
    }
    assert zeros == {(b.moving, b.staying, b.direction) for b in result.blockers}
    assert len(result.blockers) == len(zeros)


@pytest.mark.parametrize("make", [peg_in_hole, interlocked_links, stack_of_three])
def test_evidence_lies_on_both_parts_after_the_travel(make):
    """The named point is on the staying part, and the moving part reaches it by its travel."""
    solids = solids_of(make())
    for blocker in interference(list(solids.values())).blockers:
        staying, moving = solids[blocker.staying], solids[blocker.moving]
        p_AoQ = np.array(blocker.p_AoQ)
        start = p_AoQ - blocker.travel * unit_vector(blocker.direction)
        # Coincident tessellated surfaces differ by their sagitta, below the tolerance.
        for part, point in ((staying, p_AoQ), (moving, start)):
            probe = Manifold.sphere(FIT_TOLERANCE, 8).translate(list(point))
            assert (part.manifold ^ probe).volume() > 0.0


def test_peg_leaves_its_blind_hole_only_along_its_axis():
    assert leaves(peg_in_hole(), "peg", "block") == ["+z"]


@pytest.mark.parametrize("hole_facets", [24, 48, 64, 96])
def test_line_to_line_fit_survives_mismatched_tessellation(hole_facets):
    """Facets of peg and hole cross by up to the sagitta (43 um for 24 facets on d 10)."""
    assert leaves(peg_in_hole(hole_facets=hole_facets), "peg", "block") == ["+z"]


@pytest.mark.parametrize("overlap", [0.15, 1.0])
def test_a_real_ring_of_interference_blocks(overlap):
    """A peg 0.15 mm too thick: the ring is 0.075 mm wide, more than the tolerance allows."""
    assert leaves(peg_in_hole(peg=10 + 2 * overlap), "peg", "block") == []


def test_interlocked_links_cannot_leave():
    assert leaves(interlocked_links(), "link_2", "link_1") == []


def test_sliding_faces_do_not_block():
    assert leaves(stack_of_three(), "plate_1", "plate_0") == ["+x", "-x", "+y", "-y", "+z"]
    assert leaves(stack_of_three(), "plate_2", "plate_0") == ["+x", "-x", "+y", "-y", "+z"]


@pytest.mark.parametrize(("depth", "ways"), [(0.04, ["+x", "-x", "+y", "-y", "+z"]), (0.2, [])])
def test_faces_sunk_into_each_other_within_the_tolerance_do_not_block(depth, ways):
    """A cube 0.04 mm deep in a plate is a rounding of CAD; 0.2 mm is an obstacle."""
    plate, cube = box((60, 60, 10), (-30, -30, 0)), box((10, 10, 10), (-5, -5, 10 - depth))
    assert leaves(product_of({"plate": plate, "cube": cube}), "cube", "plate") == ways


SEATS = {
    "ball": lambda facets: Manifold.sphere(8, facets).translate([0, 0, 4]),
    "plug": lambda facets: Manifold.cylinder(13, 3, 9.5, facets).translate([0, 0, -10]),
    "taper of 1 degree": lambda facets: Manifold.cylinder(40, 8, 8.7, facets).translate(
        [0, 0, -20]
    ),
    "o-ring": lambda facets: Manifold.revolve(
        CrossSection.circle(2, facets).translate([9, 0]), facets
    ),
}


@pytest.mark.parametrize("facets", [(64, 50), (48, 100), (64, 64)])
@pytest.mark.parametrize("seat", SEATS)
def test_what_lies_in_a_slanted_seat_leaves_it_however_both_are_tessellated(seat, facets):
    """Facets cross by their sagitta across the seat, which is many times that along the axis."""
    part, hollow = (SEATS[seat](count) for count in facets)
    product = product_of({"block": box((40, 40, 30), (-20, -20, -30)) - hollow, "part": part})
    assert leaves(product, "part", "block") == ["+z"]


@pytest.mark.parametrize("slope", [0.0, 30.0, 60.0, 80.0])
def test_layers_of_overlap_count_across_the_faces(slope):
    """Two slabs on each other, at any slope, sunk into each other by a layer across them."""
    ways = []
    for layer in (0.04, 0.12):
        lower, upper = box((30, 30, 10), (-15, -15, -10)), box((30, 30, 10), (-15, -15, -layer))
        shapes = {n: s.rotate([0, slope, 0]) for n, s in (("lower", lower), ("upper", upper))}
        ways.append("+z" in leaves(product_of(shapes), "upper", "lower"))
    assert ways == [True, False]


def test_a_part_far_away_blocks_too():
    """Motion is to infinity: a wall 1 m away is in the way, and the travel says how far."""
    product = product_of(
        {"cube": box((10, 10, 10), (0, 0, 0)), "wall": box((5, 50, 50), (1000, -20, -20))}
    )
    hit = next(
        b for b in interference(list(solids_of(product).values())).blockers if b.moving == "cube"
    )
    assert (hit.direction, hit.staying) == ("+x", "wall")
    assert hit.travel == pytest.approx(0.99, abs=1e-9)  # Planes from vertices: rounding only.


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_decision_does_not_depend_on_size_or_place(scale):
    """The same shapes from 0.3 mm to 3 m, and 10 m from the origin."""
    bore = box((30, 30, 20), (-15, -15, 0)) - rod(12, -5, 25)
    shift = np.array([10.0, -10.0, 10.0])
    shapes = {"bore": bore, "pin": rod(11, -10, 30)}
    solids = []
    for name, shape in shapes.items():
        plain = solid(shape, name)
        solids.append(Solid(name, scale * plain.vertices + shift, plain.faces, 1.0, shift))
    free = interference(solids, tolerance=scale * FIT_TOLERANCE).free
    assert [j for j in DIRECTIONS if free[j][1, 0]] == ["+z", "-z"]


def random_shape(rng: np.random.Generator) -> Manifold:
    """Two boxes on a 2 mm grid, often with a bore, sometimes tilted; about 20 mm in size."""
    boxes = [
        box(tuple(2.0 * rng.integers(1, 6, 3)), tuple(2.0 * rng.integers(-3, 3, 3)))
        for _ in range(2)
    ]
    shape = boxes[0] + boxes[1]
    if rng.random() < 0.5:
        shape -= rod(float(2 * rng.integers(1, 4)), -20, 20, 24).rotate(
            [90.0 * rng.integers(2), 0, 0]
        )
    if rng.random() < 0.3:
        shape = shape.rotate(list(rng.uniform(-180, 180, 3)))
    return shape


def random_pairs(count: int) -> list[tuple[Manifold, Manifold, int]]:
    """Pairs side by side, touching, nested and overlapping; grid shapes share many planes."""
    rng = np.random.default_rng(0)
    pairs = []
    while len(pairs) < count:
        moving, staying = random_shape(rng), random_shape(rng)
        staying = staying.translate(list(2.0 * rng.integers(-6, 7, 3)))
        axis = int(rng.integers(3))
        if not moving.is_empty() and not staying.is_empty() and shadows_meet(moving, staying, axis):
            pairs.append((moving, staying, axis))
    return pairs


def shadows_meet(a: Manifold, b: Manifold, axis: int) -> bool:
    """Leave out the pairs whose boxes pass each other: both methods call them free at once."""
    low_a, high_a = np.split(np.array(a.bounding_box()), 2)
    low_b, high_b = np.split(np.array(b.bounding_box()), 2)
    overlap = np.minimum(high_a, high_b) - np.maximum(low_a, low_b)
    return bool(np.all(np.delete(overlap, axis) >= 0.0))


CLEARANCES = (-0.6, -0.3, 0.0, 0.02, 0.04, 0.1, 0.3, 1.0)
"""[mm] Of a peg's diameter in its hole; 0 is line to line with facets that need not match."""


def random_fit(rng: np.random.Generator) -> tuple[Manifold, Manifold, int]:
    """A peg in a blind or through hole, off its centre within the clearance, in any direction."""
    diameter, clearance = float(rng.integers(4, 14)), float(rng.choice(CLEARANCES))
    depth = float(rng.choice([-1.0, 4.0]))
    block = box((30, 30, 20), (-15, -15, 0)) - rod(
        diameter, depth, 25, int(rng.choice([32, 48, 64, 96]))
    )
    play = max(0.0, clearance) / 2
    angle, share = rng.uniform(0, 2 * np.pi), float(rng.choice([0.0, 0.5, 1.0]))
    shift = [share * play * np.cos(angle), share * play * np.sin(angle), 0.0]
    peg = rod(diameter - clearance, max(depth, -5), 35, int(rng.choice([32, 48, 64])))
    turn = [(0, 0, 0), (0, 90, 0), (90, 0, 0)][rng.integers(3)]
    pair = [peg.translate(shift).rotate(list(turn)), block.rotate(list(turn))]
    moving, staying = pair if rng.random() < 0.5 else pair[::-1]
    return moving, staying, int(rng.integers(3))


def agreement(pairs: list[tuple[Manifold, Manifold, int]]) -> tuple[int, int, int]:
    """Compare with the oracle; return how many were blocked, touching, and fragile.

    A fragile decision flips within 40 % of the tolerance: the oracle clears the depth by moving
    one part instead of by comparing heights, which differs where walls are steep, and it is not
    asked to agree there.
    """
    blocked, touching, fragile = 0, 0, 0
    for moving, staying, axis in pairs:
        views = [envelope(solid(moving), axis), envelope(solid(staying), axis)]
        found = decisions(views, FIT_TOLERANCE).get((0, 1))
        if found is not None and found.margin < 0.999 * FRAGILE * FIT_TOLERANCE:
            fragile += 1
            continue
        hit = first_hit(views[0], views[1], "+" + "xyz"[axis])
        expected = is_blocked(moving, staying, axis, 1e3 * FIT_TOLERANCE)
        assert (hit is not None) == expected
        blocked += expected
        touching += moving.min_gap(staying, 1.0) == 0.0 and (moving ^ staying).volume() < 1e-9
    return blocked, touching, fragile


def random_fits(count: int) -> list[tuple[Manifold, Manifold, int]]:
    rng = np.random.default_rng(1)
    return [random_fit(rng) for _ in range(count)]


def test_exact_test_agrees_with_boolean_sweeps():
    """120 random pairs, with enough of both answers and of touching pairs to mean something."""
    blocked, touching, fragile = agreement(random_pairs(100) + random_fits(20))
    assert 25 < blocked < 95 and touching > 5 and fragile < 6


@pytest.mark.slow
def test_exact_test_agrees_with_500_boolean_sweeps():
    """300 pairs on a grid, many of them touching, and 200 fits from press to 1 mm of play."""
    blocked, touching, fragile = agreement(random_pairs(300) + random_fits(200))
    assert 100 < blocked < 400 and touching > 15 and fragile < 15
