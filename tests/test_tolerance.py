"""Tolerances of a product: derived from sizes and clearances, or from what holds it together."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_products import box, peg_in_hole, product_of, rod

from cell.products.product import Product
from planning import plan
from planning.feasibility.evidence_format import evidence_text
from planning.feasibility.matrices import matrices_of


def printed(clearance: float) -> dict:
    """A shaft in a block, with a clearance all round [mm]."""
    block = box((40, 40, 20), (-20, -20, 0)) - rod(10 + 2 * clearance, -1, 21, 128)
    return {"block": block, "shaft": rod(10, -10, 50, 128)}


@pytest.mark.parametrize("clearance", [0.1, 0.2, 0.25, 0.3, 0.4])
def test_a_print_hangs_together_at_its_clearance(clearance):
    fixing = plan(product_of(printed(clearance)))
    assert fixing.feasible and fixing.evidence
    tolerances = fixing.evidence.tolerances
    assert 1e3 * tolerances.contact == pytest.approx(1.25 * clearance, rel=0.02)
    assert tolerances.overlap == 5e-5
    text = evidence_text(fixing.evidence)
    assert "hangs together only at a clearance of" in text and "(block, shaft)" in text


@pytest.mark.parametrize("clearance", [0.6, 2.0])
def test_a_gap_too_wide_for_a_fit_is_no_contact(clearance):
    fixing = plan(product_of(printed(clearance)))
    assert not fixing.feasible
    assert not fixing.contact.any()


def test_a_connected_product_keeps_its_clearances():
    """A peg on the bottom of a wider hole does not touch the wall, 0.2 mm away."""
    matrices = matrices_of(peg_in_hole(hole=10.4))
    assert matrices.tolerances.contact == matrices.tolerances.overlap == 5e-5


@pytest.mark.parametrize(
    ("peg", "expected"), [(10.0, 0.05), (9.9, 0.05 * 2 / 3), (9.7, 0.05), (9.996, 0.05)]
)
def test_contact_is_below_the_smallest_clearance(peg, expected):
    """Play of 0, 0.05, 0.15 and 0.002 mm between two parts on a plate; the last is rounding."""
    shapes = {"plate": rod(40, -5, 0, 96), "peg": rod(peg, 0, 15, 96)}
    shapes["ring"] = rod(30, 0, 10, 96) - rod(10, -5, 15, 96)
    tolerances = matrices_of(product_of(shapes)).tolerances
    assert tolerances.contact == pytest.approx(1e-3 * expected, rel=0.02)
    assert tolerances.overlap == 5e-5


@pytest.mark.parametrize(("scale", "expected"), [(1.0, 5e-5), (10.0, 5e-5), (0.1, 2.5e-5)])
def test_small_parts_have_smaller_tolerances(scale, expected):
    size = 50 * scale
    cubes = {"low": box((size,) * 3, (0, 0, 0)), "high": box((size,) * 3, (0, 0, size))}
    assert matrices_of(product_of(cubes)).tolerance == pytest.approx(expected)


def test_a_small_part_has_no_say_for_others():
    """A cube of 2 mm on the plate asks for a fifth of the tolerance, a stray one likewise."""
    blocks = {"plate": box((40, 40, 5), (-20, -20, 0)), "block": box((10, 10, 10), (-5, -5, 5))}
    small = {"cube": box((2, 2, 2), (10, 0, 5)), "stray": box((2, 2, 2), (100, 0, 0))}
    tolerances = matrices_of(product_of(blocks | small)).tolerances
    assert tolerances.overlap_of("plate", "block") == 5e-5
    assert tolerances.overlap_of("plate", "cube") == tolerances.small["stray"]
    assert 5e-6 < tolerances.small["stray"] <= 1e-5


@pytest.mark.parametrize("thickness", [0.06, 0.1])
def test_thin_parts_block_edge_on(thickness):
    """A foil in a tray stays between its walls, though it is thinner than two usual tolerances."""
    tray = box((40, 40, 5), (-20, -20, 0)) - box((30, 30, 5), (-15, -15, 2))
    foil = box((30, 30, thickness), (-15, -15, 2))
    free = matrices_of(product_of({"tray": tray, "foil": foil})).interference.free
    assert [j for j in free if free[j][1, 0]] == ["+z"]


def test_a_thin_wire_blocks():
    """A locking wire of 0.06 mm through a pin and its housing."""
    wire = rod(0.06, -20, 20, 12).rotate([0, 90, 0])
    block = box((30, 30, 20), (-15, -15, -10)) - rod(10, -11, 11, 64) - wire
    shapes = {"block": block, "pin": rod(10, -9, 9, 64) - wire, "wire": wire}
    free = matrices_of(product_of(shapes)).interference.free
    assert not free["+z"][1, 2] and not free["+z"][2, 0]


def test_the_loosest_joint_decides():
    """Three shells in each other, 0.1 and 0.3 mm apart: only 0.3 mm connects all."""
    tubes = {
        "outer": rod(40, 0, 20, 96) - rod(30, -1, 21, 96),
        "middle": rod(29.8, 0, 20, 96) - rod(20, -1, 21, 96),
        "inner": rod(19.4, 0, 20, 96),
    }
    fixing = plan(product_of(tubes))
    assert fixing.feasible and fixing.evidence
    assert 1e3 * fixing.evidence.tolerances.contact == pytest.approx(1.25 * 0.3, rel=0.05)
    assert np.array_equal(fixing.contact, [[0, 1, 0], [0, 0, 1], [0, 0, 0]])


@pytest.mark.parametrize(
    ("declared", "given", "source"),
    [(None, 3e-5, "as given"), (2e-5, None, "declared by the product"), (2e-5, 2e-5, "as given"),
     (None, None, "by default")],
)  # fmt: skip
def test_the_source_of_a_tolerance_is_said(declared, given, source):
    product: Product = product_of(printed(0.0), contact_tolerance=declared)
    fixing = plan(product, tolerance=given)
    assert fixing.evidence and fixing.evidence.tolerances.source == source


def test_a_given_tolerance_is_not_raised():
    fixing = plan(product_of(printed(0.25)), tolerance=5e-5)
    assert not fixing.feasible
    assert fixing.evidence and fixing.evidence.tolerances.contact == 5e-5
