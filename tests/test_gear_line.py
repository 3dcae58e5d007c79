"""The generated machine of the planner's benchmark: what is known of it by how it is made."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_products import product_of

from experiments.plan.gear_line import gear_line
from planning import plan
from planning.feasibility import coarse
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.interference import interference
from planning.feasibility.matrices import matrices_of
from planning.feasibility.solids import solids_of


def test_everything_leaves_upwards_in_the_order_in_which_it_is_made():
    """Each part leaves those before it upwards; the 4 screws of a station hold in the base."""
    shapes = gear_line(2, fineness=0.3)
    assert len(shapes) == 9 * 2 + 4
    fixing = plan(product_of(shapes), tuple(shapes))
    assert fixing.feasible
    assert np.all(np.tril(fixing.free["+z"], -1) == np.tril(np.ones_like(fixing.contact), -1))
    assert fixing.matrices is not None
    threads = fixing.matrices.threads
    assert {thread.nut for thread in threads} == {"base"} and len(threads) == 8
    names = list(shapes)
    gears = [names.index(f"gear_{k}") for k in (1, 2)]
    assert not (fixing.contact + fixing.contact.T)[np.ix_(gears, gears)].any()
    assert fixing.free["+x"][gears[0], gears[1]] == 0  # Their teeth mesh.


def test_a_cover_in_its_pillars_is_an_error():
    shapes = gear_line(1, fineness=0.3, overlap=0.3)
    errors = matrices_of(product_of(shapes)).errors
    pillars = [name for name in shapes if name.startswith("pillar")]
    assert {(one.part, one.other) for one in errors} == {(pillar, "cover") for pillar in pillars}
    assert [one.depth for one in errors] == pytest.approx([3e-4] * len(pillars), rel=1e-3)


def test_simplified_surfaces_decide_like_the_parts_own(monkeypatch):
    """Parts are simplified first where the tolerance is far wider than their facets."""
    solids = list(solids_of(product_of(gear_line(1, fineness=0.5))).values())
    simplified = [s.name for s in solids if coarse.coarsened(s, 1e-3) is not s]
    assert len(simplified) > 2
    quick = interference(solids, 1e-3)
    monkeypatch.setattr(coarse, "MANY", 10**9)
    thorough = interference(solids, 1e-3)
    for j in DIRECTIONS:
        np.testing.assert_array_equal(quick.free[j], thorough.free[j])
    assert 0 < np.count_nonzero(quick.free["+z"]) < len(solids) ** 2 - len(solids)
