"""The planner's answers on 200 random assemblies are those that follow from how each was made."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from random_assemblies import Assembly, Known, assemblies, cube_maps, mapped, turned

from cell.errors import InputError
from cell.products.declared import Declared
from planning.assembly_plan.planner import FixingPlan, plan
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.matrices import AssemblyMatrices, matrices_of

LATER: dict[str, str] = {}

TOLERANCES = (2e-5, 5e-5, 1e-4, 2e-4)  # [m] Below every clearance of a cover, above every facet.
DEPTH = 0.2  # Of a depth of overlap.
MOST = [1, pytest.param(None, marks=pytest.mark.slow)]  # Of a kind whose laws are tested.


@cache
def everything() -> dict[str, list[Assembly]]:
    """Return the assemblies by kind."""
    kinds: dict[str, list[Assembly]] = {}
    for one in assemblies():
        kinds.setdefault(one.known.kind, []).append(one)
    return kinds


def kinds(later: dict[str, str]) -> list:
    """Return the kinds as parameters; those that come out wrong are expected to fail."""
    return [
        pytest.param(kind, marks=[pytest.mark.xfail(reason=later[kind], strict=True)])
        if kind in later
        else kind
        for kind in everything()
    ]


def disagreements(one: Assembly) -> list[str]:
    """Return in what the plan of an assembly differs from what is known of it."""
    known = one.known
    try:
        made = plan(one.product)
    except InputError as error:
        return [str(error)]
    assert made.matrices is not None
    success = known.feasible and not known.press and not known.snap
    found = [] if made.feasible == success else [f"feasible: {made.feasible}"]
    if known.press or known.snap:
        declared = Declared(press=known.press, snap=known.snap)
        feasible_then = plan(replace(one.product, declared=declared)).feasible
        found += [] if feasible_then == known.feasible else [f"as declared: {feasible_then}"]
    strays = {item.name for item in made.unplanned if "touches no part" in item.reason}
    return [
        *found,
        *(f"stray: {name}" for name in strays ^ known.strays),
        *wrong_contacts(made, known),
        *wrong_motions(made, known),
        *wrong_threads(made.matrices, known),
        *wrong_overlaps(made.matrices, known),
    ]


def wrong_contacts(made: FixingPlan, known: Known) -> list[str]:
    pairs = {frozenset({made.parts[i], made.parts[k]}) for i, k in np.argwhere(made.contact)}
    return [f"contact of {sorted(pair)}" for pair in pairs ^ known.touching]


def wrong_motions(made: FixingPlan, known: Known) -> list[str]:
    return [
        f"{moving} leaves {staying} along {j}: {j not in ways}"
        for (moving, staying), ways in known.leaves.items()
        for j in DIRECTIONS
        if made.free[j][made.parts.index(moving), made.parts.index(staying)] != (j in ways)
    ]


def wrong_threads(matrices: AssemblyMatrices, known: Known) -> list[str]:
    found = {(thread.bolt, thread.nut) for thread in matrices.threads}
    return [f"thread of {pair}" for pair in found ^ known.threads]


def wrong_overlaps(matrices: AssemblyMatrices, known: Known) -> list[str]:
    found = {frozenset({one.part, one.other}): one.depth for one in matrices.errors}
    wrong = [f"overlap of {sorted(pair)}" for pair in found.keys() ^ known.overlaps.keys()]
    return wrong + [
        f"{sorted(pair)} overlap by {found[pair]}, not {depth}"
        for pair, depth in known.overlaps.items()
        if pair in found and abs(found[pair] - depth) > DEPTH * depth
    ]


def test_there_are_200():
    assert sum(map(len, everything().values())) == 200


@pytest.mark.parametrize("kind", kinds(LATER))
def test_answers_are_those_of_the_construction(kind):
    wrong = {one.product.name: disagreements(one) for one in everything()[kind]}
    assert not {name: list_ for name, list_ in wrong.items() if list_}


@pytest.mark.parametrize("most", MOST)
@pytest.mark.parametrize("kind", list(everything()))
def test_a_mirrored_or_permuted_copy_has_mirrored_and_permuted_answers(kind, most):
    """Each is compared with one of its 48 images."""
    for one in everything()[kind][:most]:
        rng = np.random.default_rng(one.number)
        turn = cube_maps()[int(rng.integers(48))]
        here, there = (answers(p) for p in (one.product, mapped(one.product, turn)))
        if isinstance(here, str) or isinstance(there, str):
            assert here == there
            continue
        assert here.tolerance == pytest.approx(there.tolerance, rel=1e-6)
        assert np.array_equal(here.contact, there.contact)
        assert [(t.bolt, t.nut) for t in here.threads] == [(t.bolt, t.nut) for t in there.threads]
        for j in DIRECTIONS:
            image = there.interference.free[turned(j, turn)]
            assert np.array_equal(here.interference.free[j], image), (one.product.name, j)


def answers(product) -> AssemblyMatrices | str:
    """Return the matrices, or that the product is refused."""
    try:
        return matrices_of(product)
    except InputError:
        return "refused"


@pytest.mark.parametrize("most", MOST)
@pytest.mark.parametrize("kind", list(everything()))
def test_feasibility_is_not_lost_as_the_tolerance_grows(kind, most):
    for one in everything()[kind][:most]:
        before = False
        for tolerance in TOLERANCES:
            now = feasible(one, tolerance)
            assert now or not before, (one.product.name, tolerance)
            before = now


def feasible(one: Assembly, tolerance: float) -> bool:
    """Return whether an assembly can be planned at a tolerance."""
    try:
        return plan(one.product, tolerance=tolerance).feasible
    except InputError:
        return False


def test_an_answer_that_is_wrong_is_noticed():
    """One direction, contact or thread that is not so is found in each kind that is right."""
    for kind in everything().keys() - LATER.keys():
        one = everything()[kind][0]
        known = one.known
        assert not disagreements(one)
        wrong = [replace(known, feasible=not known.feasible)]
        wrong += [
            replace(known, touching=known.touching ^ {frozenset(list(one.product.parts)[:2])})
        ]
        wrong += [replace(known, threads=known.threads ^ {tuple(list(one.product.parts)[:2])})]
        wrong += [
            replace(known, leaves={**known.leaves, pair: ways ^ {"+x"}})
            for pair, ways in list(known.leaves.items())[:1]
        ]
        for other in wrong:
            assert disagreements(replace(one, known=other)), kind
