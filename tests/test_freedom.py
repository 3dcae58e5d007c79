"""Directions out of contact normals, and freedom to move some way, apart from leaving."""

from __future__ import annotations

import json

import numpy as np
import pytest
from test_matrices import solid
from tiny_products import box, interlocked_links, peg_in_hole, product_of, rod

from planning import plan
from planning.feasibility.evidence_format import evidence_from_dict, evidence_text, evidence_to_dict
from planning.feasibility.freedom import Freedom, contact_normals, freedom_along, freedoms
from planning.feasibility.solids import solids_of

TOLERANCE = 5e-5


def leaving(found: list[Freedom]) -> np.ndarray:
    return np.array([freedom.direction for freedom in found if freedom.leaves]).reshape(-1, 3)


@pytest.mark.parametrize("tilt", [15.0, 30.0, 45.0, 60.0])
def test_a_peg_in_a_slanted_hole_leaves_along_it_only(tilt):
    """No one of the six directions is free, one at an angle is."""
    block = box((60, 60, 40), (-30, -30, -40)) - rod(8, -20, 60).rotate([0, tilt, 0])
    peg = rod(8, -20, 40).rotate([0, tilt, 0])
    (found,) = leaving(freedoms([solid(peg, "peg")], [solid(block, "block")], TOLERANCE))
    axis = [np.sin(np.deg2rad(tilt)), 0.0, np.cos(np.deg2rad(tilt))]
    np.testing.assert_allclose(found, axis, atol=0.02)


def test_a_wedge_leaves_its_groove_along_all_that_the_faces_allow():
    """A 90 degree groove: up, along it both ways, and along either flank."""
    groove = box((60, 40, 20), (-30, -20, -20)) - box((20, 60, 20), (-10, -30, -10)).rotate(
        [0, 45, 0]
    ).translate([0, 0, 0])
    wedge = box((20, 30, 20), (-10, -15, -10)).rotate([0, 45, 0])
    found = leaving(freedoms([solid(wedge, "wedge")], [solid(groove, "groove")], TOLERANCE))
    for expected in ([0, 0, 1], [0, 1, 0], [0, -1, 0], [0.7071, 0, 0.7071], [-0.7071, 0, 0.7071]):
        assert (found @ np.array(expected)).max() > 0.999
    assert (found[:, 2] > -1e-6).all()


def test_local_freedom_is_the_clearance_ahead():
    """A cube in a closed box with 5, 3 and 1 mm of clearance on its sides."""
    cage = box((40, 40, 40), (-20, -20, -20)) - box((20, 20, 20), (-10, -10, -10))
    cube = box((12, 14, 19), (-7, -7, -10))
    found = freedoms([solid(cube, "cube")], [solid(cage, "cage")], TOLERANCE)
    travel = {tuple(np.round(f.direction).astype(int)): f.travel for f in found}
    expected = {(1, 0, 0): 5, (-1, 0, 0): 3, (0, 1, 0): 3, (0, -1, 0): 3, (0, 0, 1): 1}
    assert travel == {key: pytest.approx(1e-3 * mm, abs=1e-9) for key, mm in expected.items()}
    assert all(f.hits == "cage" and not f.leaves for f in found)


def test_links_of_a_chain_move_but_do_not_leave():
    """Ten millimetres from touching on one face to touching on the other; never apart."""
    first, second = solids_of(interlocked_links()).values()
    found = freedoms([second], [first], TOLERANCE)
    assert found and not any(freedom.leaves for freedom in found)
    assert all(0.0 < freedom.travel < 20e-3 for freedom in found)


def test_removal_to_infinity_agrees_with_the_matrices():
    block, peg = solids_of(peg_in_hole()).values()
    found = freedoms([peg], [block], TOLERANCE)
    np.testing.assert_allclose(leaving(found)[0], [0, 0, 1])
    assert freedom_along([peg], [block], np.array([0.0, 0, -1]), TOLERANCE).travel == 0.0


def test_contact_normals_point_out_of_the_target():
    low = solid(box((20, 20, 20), (0, 0, 0)), "low")
    high = solid(box((20, 20, 20), (3, 4, 20)), "high")
    np.testing.assert_allclose(contact_normals([high], [low], TOLERANCE), [[0, 0, 1]])
    np.testing.assert_allclose(contact_normals([low], [high], TOLERANCE), [[0, 0, -1]])


def test_a_plan_reports_them_where_asked():
    """The plan uses the way out at an angle anyhow; the report of all motions is for the asking."""
    block = box((60, 60, 40), (-30, -30, -40)) - rod(8, -20, 60).rotate([0, 30, 0])
    peg = rod(8, -20, 40).rotate([0, 30, 0])
    product = product_of({"block": block, "peg": peg})
    plain, asked = (plan(product, ("block", "peg"), slanted=way) for way in (False, True))
    assert plain.feasible and asked.feasible
    assert plain.evidence is not None and asked.evidence is not None
    assert plain.evidence.motions == ()
    assert "Free: peg along (0.5, 0, 0.866) to infinity." in evidence_text(asked.evidence)
    assert evidence_from_dict(json.loads(json.dumps(evidence_to_dict(asked.evidence)))) == (
        asked.evidence
    )
