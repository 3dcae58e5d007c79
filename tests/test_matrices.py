"""Laws of C and M_j, their margins, the tolerance, and the cache; the paper's table under noise."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold
from pydrake.math import RigidTransform, RotationMatrix
from test_interference import random_shape
from tiny_products import bolted, box, peg_in_hole, product_of, rod, stack_of_three, to_trimesh

import cell.cad.motor_unit as cad
from cell.cad import shapes
from cell.products.loading import load_product
from cell.products.product import Product
from planning import FixingPlan, plan
from planning.feasibility.cache import cached_matrices, key_of
from planning.feasibility.contact import contact_matrix, gap_matrix
from planning.feasibility.directions import DIRECTIONS, axis_index, opposite, unit_vector
from planning.feasibility.evidence import evidence_text
from planning.feasibility.interference import Interference, interference
from planning.feasibility.matrices import AssemblyMatrices, matrices_of
from planning.feasibility.solids import Solid, solids_of

PAPER_TABLE = {
    ("motor", "plate", "bolts"): [("+z", "motor"), ("+z", "motor")],
    ("plate", "bolts", "motor"): [("+z", "plate"), ("-z", "motor")],
}
TOLERANCE = 5e-5


def random_solids(seed: int, count: int = 5) -> list[Solid]:
    """Shapes on a 2 mm grid, touching, nested and crossing each other."""
    rng = np.random.default_rng(seed)
    found: list[Solid] = []
    while len(found) < count:
        shape = random_shape(rng).translate(list(2.0 * rng.integers(-6, 7, 3)))
        if not shape.is_empty():
            found.append(solid(shape, f"part_{len(found)}"))
    return found


def solid(shape: Manifold, name: str) -> Solid:
    mesh = to_trimesh(shape)
    return Solid(name, np.array(mesh.vertices), np.array(mesh.faces), 1.0, np.zeros(3))


def contact(solids: list[Solid]) -> np.ndarray:
    triangle = contact_matrix(gap_matrix(solids, 1e-4), TOLERANCE)
    return triangle + triangle.T


def axis_rotations() -> list[np.ndarray]:
    """The 24 rotations that permute the axes."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            R = np.zeros((3, 3))
            R[range(3), order] = signs
            if np.linalg.det(R) > 0:
                found.append(R)
    return found


def turned(direction: str, R: np.ndarray) -> str:
    vector = R @ unit_vector(direction)
    return next(j for j in DIRECTIONS if vector @ unit_vector(j) > 0.5)


@pytest.mark.parametrize("seed", range(6))
def test_blocking_reverses_with_the_direction(seed):
    free = interference(random_solids(seed)).free
    for j in DIRECTIONS:
        np.testing.assert_array_equal(free[j], free[opposite(j)].T)


@pytest.mark.parametrize("seed", range(6))
def test_matrices_do_not_depend_on_the_order_of_parts(seed):
    solids = random_solids(seed)
    order = np.random.default_rng(seed).permutation(len(solids))
    mixed = [solids[k] for k in order]
    before, after = interference(solids), interference(mixed)
    for j in DIRECTIONS:
        np.testing.assert_array_equal(before.free[j][np.ix_(order, order)], after.free[j])
        np.testing.assert_allclose(before.margin[j][np.ix_(order, order)], after.margin[j])
    np.testing.assert_array_equal(contact(solids)[np.ix_(order, order)], contact(mixed))


@pytest.mark.parametrize("seed", range(3))
def test_matrices_turn_with_the_product(seed):
    """A rigid transform that permutes the axes permutes the M_j and leaves C."""
    solids = random_solids(seed)
    before = interference(solids).free
    for R in axis_rotations()[:: 1 + seed]:
        moved = [replace(s, vertices=s.vertices @ R.T + [0.1, -0.2, 0.3]) for s in solids]
        after = interference(moved).free
        for j in DIRECTIONS:
            np.testing.assert_array_equal(before[j], after[turned(j, R)])
        np.testing.assert_array_equal(contact(solids), contact(moved))


@pytest.mark.parametrize("seed", range(6))
def test_a_combined_part_blocks_at_least_what_its_members_block(seed):
    """Its union may close a gap between them, never open one."""
    solids = random_solids(seed, 4)
    joined = solids[0].manifold + solids[1].manifold
    mesh = joined.to_mesh64()
    union = replace(
        solids[0],
        vertices=np.array(mesh.vert_properties)[:, :3],
        faces=np.array(mesh.tri_verts, int),
    )
    apart, together = interference(solids).free, interference([union, *solids[2:]]).free
    for j in DIRECTIONS:
        for other in (2, 3):
            assert together[j][0, other - 1] <= min(apart[j][0, other], apart[j][1, other])
            assert together[j][other - 1, 0] <= min(apart[j][other, 0], apart[j][other, 1])


def flips(result: Interference, solids: list[Solid], change: float) -> set[tuple[str, int, int]]:
    """Decisions that differ at another tolerance."""
    other = interference(solids, TOLERANCE + change).free
    return {
        (j, int(i), int(k)) for j in DIRECTIONS for i, k in np.argwhere(result.free[j] != other[j])
    }


@pytest.mark.parametrize("sink", [0.032, 0.045, 0.049, 0.051, 0.055, 0.068])
def test_margin_is_the_distance_to_the_flip(sink):
    """A cube sunk into a plate by a depth near the tolerance: margin |depth - tolerance|."""
    plate, cube = box((60, 60, 10), (-30, -30, 0)), box((10, 10, 10), (-5, -5, 10 - sink))
    solids = [solid(plate, "plate"), solid(cube, "cube")]
    result = interference(solids, TOLERANCE)
    margin = result.margin["+z"][1, 0]
    distance = abs(1e-3 * sink - TOLERANCE)
    assert result.free["+z"][1, 0] == (1e-3 * sink < TOLERANCE)
    assert distance - 1.5e-6 <= margin <= distance + 1e-9
    sign = 1.0 if 1e-3 * sink > TOLERANCE else -1.0
    assert ("+z", 1, 0) not in flips(result, solids, sign * margin * 0.999)
    assert ("+z", 1, 0) in flips(result, solids, sign * (distance + 2e-6))


@pytest.mark.parametrize("gap", [0.032, 0.049, 0.051, 0.06])
def test_contact_margin_is_the_distance_of_the_gap_to_the_tolerance(gap):
    low, high = box((20, 20, 20), (0, 0, 0)), box((20, 20, 20), (3, 4, 20 + gap))
    matrices = matrices_of(product_of({"low": low, "high": high}), TOLERANCE)
    assert matrices.contact_margin[0, 1] == pytest.approx(abs(1e-3 * gap - TOLERANCE), abs=1e-9)


def test_a_plan_that_depends_on_the_tolerance_says_so():
    """The lid rests 0.045 mm above the base: whether they touch decides whether it can be added."""
    low, high = box((20, 20, 20), (0, 0, 0)), box((20, 20, 20), (0, 0, 20.045))
    fixing = plan(product_of({"low": low, "high": high}), ("low", "high"), tolerance=TOLERANCE)
    assert fixing.evidence is not None
    (fragile,) = fixing.evidence.fragile
    assert (fragile.direction, fragile.value, fragile.decides) == ("contact", 1, True)
    assert "depends on 0.005 mm of tolerance: low and high touch" in evidence_text(fixing.evidence)


def test_a_plan_with_margins_reports_no_fragile_decision():
    evidence = plan(stack_of_three(), ("plate_0", "plate_1", "plate_2")).evidence
    assert evidence is not None and evidence.fragile == ()
    assert evidence_text(evidence) == "Tolerance 0.05 mm, by default."


@pytest.mark.parametrize(
    ("peg", "expected"), [(10.0, 0.05), (9.9, 0.05 * 2 / 3), (9.7, 0.05), (9.996, 0.05)]
)
def test_default_tolerance_is_below_the_smallest_clearance(peg, expected):
    """A hanging peg with 0, 0.05, 0.15 and 0.002 mm of play; the last is rounding, not play."""
    ring = rod(30, 0, 10, 96) - rod(10, -5, 15, 96)
    matrices = matrices_of(product_of({"ring": ring, "peg": rod(peg, -5, 15, 96)}))
    assert matrices.tolerance == pytest.approx(1e-3 * expected, rel=0.02)


@pytest.mark.parametrize(("scale", "expected"), [(1.0, 5e-5), (10.0, 5e-5), (0.1, 2.5e-5)])
def test_default_tolerance_follows_small_parts(scale, expected):
    cubes = {
        "low": box((50 * scale,) * 3, (0, 0, 0)),
        "high": box((50 * scale,) * 3, (0, 0, 50 * scale)),
    }
    assert matrices_of(product_of(cubes)).tolerance == pytest.approx(expected)


def choices(fixing: FixingPlan) -> list[tuple[str, str]]:
    return [(step.posture, step.fixed_part) for step in fixing.steps]


@pytest.fixture(scope="module")
def motor_unit() -> Product:
    return load_product("motor_unit")


def shaken(product: Product, rng: np.random.Generator, most: float) -> Product:
    """Every part displaced by up to so much along each axis [m]."""
    parts = {
        name: replace(part, X_AP=RigidTransform(rng.uniform(-most, most, 3)) @ part.X_AP)
        for name, part in product.parts.items()
    }
    return replace(product, parts=parts)


@pytest.mark.parametrize("order", PAPER_TABLE, ids="-".join)
def test_the_papers_table_survives_displaced_parts(motor_unit, order):
    """Five draws of 0.02 mm; the slow test has 20."""
    rng = np.random.default_rng(5)
    for _ in range(5):
        assert choices(plan(shaken(motor_unit, rng, 2e-5), order)) == PAPER_TABLE[order]


@pytest.mark.slow
def test_the_papers_table_survives_twenty_draws(motor_unit):
    rng = np.random.default_rng(0)
    for _ in range(20):
        moved = shaken(motor_unit, rng, 2e-5)
        for order, table in PAPER_TABLE.items():
            assert choices(plan(moved, order)) == table


def drawn_with(monkeypatch: pytest.MonkeyPatch, factors: tuple[float, float, float]) -> Product:
    """The motor unit drawn with other numbers of facets on motor, plate and bolts."""
    product, parts = load_product("motor_unit"), {}
    names = {"motor": factors[0], "plate": factors[1], "bolt": factors[2]}
    for name, factor in names.items():
        with monkeypatch.context() as patch:
            for function in ("cylinder", "cone", "boss", "shank"):
                patch.setattr(cad, function, finer(getattr(shapes, function), factor))
            parts[name] = to_trimesh(drawing(name))
    meshes = {n: parts["bolt" if n.startswith("bolt") else n] for n in product.parts}
    return replace(product, parts={n: replace(p, mesh=meshes[n]) for n, p in product.parts.items()})


def drawing(name: str) -> Manifold:
    if name == "motor":
        return Manifold.batch_boolean(list(cad.motor_solids().values()), cad_add())
    return cad.plate_solid() if name == "plate" else cad.bolt_solid()


def cad_add():
    from manifold3d import OpType

    return OpType.Add


def finer(function, factor: float):
    """The same drawing function with its facets multiplied; 96 are the default of all."""

    def drawn(*arguments):
        known = 5 if function is not shapes.cylinder else 4
        if function is shapes.boss:
            facets = arguments[4] if len(arguments) == 5 else 96
            return function(*arguments[:4], round(facets * factor))
        if function is shapes.shank:
            return function(*arguments[:4], round(arguments[4] * factor))
        count = known - 1
        facets = arguments[count] if len(arguments) == known else 96
        return function(*arguments[:count], round(facets * factor))

    return drawn


@pytest.mark.parametrize("factors", [(0.5, 0.5, 0.5), (2, 2, 2), (0.5, 1, 2), (2, 0.5, 1)])
def test_the_papers_table_survives_other_tessellations(monkeypatch, factors):
    """Facets halved or doubled, on all parts or so that they no longer match."""
    product = drawn_with(monkeypatch, factors)
    for order, table in PAPER_TABLE.items():
        assert choices(plan(product, order)) == table


def test_half_a_tessellation_is_another_mesh(monkeypatch):
    """So that the test above tests something."""
    product, coarse = load_product("motor_unit"), drawn_with(monkeypatch, (0.5, 0.5, 0.5))
    for name in product.parts:
        assert len(coarse.parts[name].mesh.faces) < 0.75 * len(product.parts[name].mesh.faces)


def same(a: AssemblyMatrices, b: AssemblyMatrices) -> bool:
    equal = [np.array_equal(a.interference.free[j], b.interference.free[j]) for j in DIRECTIONS]
    equal += [
        np.array_equal(a.interference.margin[j], b.interference.margin[j]) for j in DIRECTIONS
    ]
    equal += [
        np.array_equal(a.contact, b.contact),
        a.interference.blockers == b.interference.blockers,
    ]
    return all(equal) and a.threads == b.threads and a.tolerance == b.tolerance


def test_the_cache_returns_what_was_computed(tmp_path: Path):
    product = bolted(2.5)
    first = cached_matrices(product, None, tmp_path)
    (file,) = tmp_path.iterdir()
    written = file.stat().st_mtime_ns
    second = cached_matrices(product, None, tmp_path)
    assert same(first, second) and same(first, matrices_of(product)) and first.threads
    assert [f.stat().st_mtime_ns for f in tmp_path.iterdir()] == [written]


def test_the_cache_goes_by_content(tmp_path: Path):
    """A moved part, another tolerance and another name each have a key of their own."""
    product = peg_in_hole()
    moved = replace(
        product,
        parts=dict(product.parts)
        | {"peg": replace(product.parts["peg"], X_AP=RigidTransform([0, 0, 1e-6]))},
    )
    keys = {
        key_of(product, solids_of(product), None),
        key_of(product, solids_of(product), 1e-5),
        key_of(moved, solids_of(moved), None),
    }
    assert len(keys) == 3
    assert key_of(product, solids_of(product), None) == key_of(
        peg_in_hole(), solids_of(peg_in_hole()), None
    )


def test_a_broken_cache_file_counts_as_absent(tmp_path: Path):
    product = peg_in_hole()
    cached_matrices(product, None, tmp_path)
    (file,) = tmp_path.iterdir()
    file.write_bytes(b"rubbish")
    assert same(cached_matrices(product, None, tmp_path), matrices_of(product))
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert same(cached_matrices(product, None, blocked), matrices_of(product))


def test_rotations_are_the_24():
    """The generator of the law above: proper, distinct."""
    rotations = axis_rotations()
    assert len({R.tobytes() for R in rotations}) == 24
    assert all(RotationMatrix(R).IsValid() for R in rotations)
    assert axis_index(turned("+x", rotations[0])) == 0


def test_progress_counts_every_comparison_of_two_parts():
    """Four a pair; the count only grows, and each call states the same total."""
    told: list[tuple[int, int]] = []
    product = stack_of_three()
    matrices_of(product, progress=lambda done, total: told.append((done, total)))
    assert told and {total for _, total in told} == {4 * 3}
    counts = [done for done, _ in told]
    assert counts == sorted(counts) and counts[0] >= 0 and counts[-1] < 4 * 3
