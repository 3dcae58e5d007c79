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


def test_a_stray_part_has_no_say():
    """A tiny cube far away would ask for 0.01 mm."""
    blocks = {"plate": box((40, 40, 5), (-20, -20, 0)), "block": box((10, 10, 10), (-5, -5, 5))}
    stray = blocks | {"stray": box((2, 2, 2), (100, 0, 0))}
    assert matrices_of(product_of(stray)).tolerances == matrices_of(product_of(blocks)).tolerances


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
