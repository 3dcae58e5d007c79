"""Orders with sub-assemblies that leave as one, where single items lock each other."""

from __future__ import annotations

import json

import numpy as np
import pytest
from large_products import reciprocal_ring
from manifold3d import Manifold
from tiny_products import box, product_of

from cell import CellConfig
from cell.errors import CellError
from cell.products.product import Product
from planning import FixingPlan, load_plan, plan, save_plan
from planning.assembly_plan.order_search import named_subassemblies
from planning.assembly_plan.plan_file import plan_to_dict
from planning.feasibility.directions import DIRECTIONS
from planning.fixture_analysis.candidate import FixtureSetup
from planning.fixture_analysis.rule import general_rule
from planning.operations.operation import NoOperation
from planning.operations.sequence import steps
from planning.ordering.advice_format import advice_text, precedence_text
from planning.ordering.items import Items, items_of, members
from planning.ordering.separation import locked_core
from planning.ordering.subassemblies import Body, Division, leaving_groups


def two_pairs() -> dict[str, Manifold]:
    """Two halves of a slide, a above b, in two halves of a channel, c above d.

    Keys hold the halves of each along x and y, tongues in grooves hold a in c and b in d along z:
    no part leaves the others, but a + b can be drawn out of c + d along x, and a + c lifted off.
    """

    def tongue(z: float) -> Manifold:
        return box((40, 30, 2), (0, -15, z))

    key = box((10, 6, 4), (15, -3, -4))
    pegs = box((6, 6, 4), (17, -23, -4)) + box((6, 6, 4), (17, 17, -4))
    upper = box((60, 20, 10), (-10, -10, 0)) + box((60, 30, 2), (-10, -15, 4))
    lower = box((60, 20, 10), (-10, -10, -10)) + box((60, 30, 2), (-10, -15, -6))
    return {
        "a": box((40, 20, 10), (0, -10, 0)) + tongue(4) + key,
        "b": box((40, 20, 10), (0, -10, -10)) + tongue(-6) - key,
        "c": box((40, 50, 20), (0, -25, 0)) - upper + pegs,
        "d": box((40, 50, 20), (0, -25, -20)) - lower - pegs,
    }


def check(product: Product, fixing: FixingPlan) -> None:
    """Every step of every line is one that its parts' matrices allow, and nothing is left out."""
    place = {name: number for number, name in enumerate(fixing.parts)}
    free = {**fixing.free, **{way.label: way.free for way in fixing.slanted}}
    touching = fixing.contact + fixing.contact.T
    members_of = {name: (name,) for name in product.parts} | dict(product.groups)
    members_of |= {built.name: built.parts for built in fixing.subassemblies}
    built_before: set[str] = set()
    lines = [(b.name, b.order, b.steps) for b in fixing.subassemblies]
    for name, order, line in [*lines, ("", fixing.order, fixing.steps)]:
        assert {item for item in order if "+" in item} <= built_before
        built_before.add(name)
        assert [step.item for step in line] == list(order[1:])
        for number, step in enumerate(line, start=1):
            inside = {part for item in order[:number] for part in members_of[item]}
            assert set(step.target) == inside and set(step.incoming) == set(members_of[step.item])
            pairs = np.ix_([place[n] for n in step.incoming], [place[n] for n in step.target])
            assert touching[pairs].any()
            assert any(matrix[pairs].all() for matrix in free.values())
            for j in DIRECTIONS:
                assert step.directions[j] == int(fixing.free[j][pairs].all())
    everything = [part for item in fixing.order for part in members_of[item]]
    assert sorted(everything) == sorted(fixing.parts)


def test_a_plan_contains_the_subassembly_as_one_item():
    product = product_of(two_pairs())
    fixing = plan(product)
    assert fixing.feasible and fixing.stop is None and len(fixing.order) == 3
    (built,) = fixing.subassemblies
    assert built.name in fixing.order and built.name == "+".join(sorted(built.parts))
    assert len(built.steps) == 1
    check(product, fixing)
    assert fixing.orders is not None and fixing.orders.interlock is not None
    assert not fixing.orders.exact  # Other sub-assemblies may be better.
    text = advice_text(fixing.orders)
    assert (
        "a, b, c, d lock each other" in text and f"Built first, as one item: {built.name}" in text
    )
    assert "contains these sub-assemblies" in precedence_text(fixing.orders)


def test_what_lies_on_it_comes_later():
    product = product_of(two_pairs() | {"lid": box((20, 20, 5), (10, -10, 20))})
    fixing = plan(product)
    assert fixing.feasible and fixing.order[-1] == "lid"
    check(product, fixing)


def test_a_turned_one_needs_slanted_directions_as_well():
    product = product_of({n: s.rotate([10, 20, 30]) for n, s in two_pairs().items()})
    fixing = plan(product)
    assert fixing.feasible and fixing.slanted and len(fixing.subassemblies) == 1
    check(product, fixing)


def two_slides_on_a_base() -> Product:
    parts = {"base": box((200, 60, 10), (-90, -30, -30))}
    for side, shift in (("l", -60), ("r", 60)):
        shapes = {n: s.translate([shift, 0, 0]) for n, s in two_pairs().items()}
        parts |= {f"{name}_{side}": shape for name, shape in shapes.items()}
    return product_of(parts)


def test_several_subassemblies_in_one_order():
    product = two_slides_on_a_base()
    fixing = plan(product)
    assert fixing.feasible and [len(built.parts) for built in fixing.subassemblies] == [2, 2]
    check(product, fixing)


def test_subassemblies_of_subassemblies():
    """Each slide as one item, which is itself built of a sub-assembly and single parts."""
    product = two_slides_on_a_base()
    order = ("base", "a_l+b_l+c_l+d_l", "a_r+b_r+c_r+d_r")
    fixing = plan(product, order)
    assert fixing.feasible and fixing.order == order
    assert sorted(len(built.parts) for built in fixing.subassemblies) == [2, 2, 4, 4]
    check(product, fixing)


def test_an_order_that_was_asked_for_stays():
    """It stops, and the advice names one with a sub-assembly."""
    product = product_of(two_pairs())
    fixing = plan(product, ("a", "b", "c", "d"))
    assert fixing.order == ("a", "b", "c", "d") and not fixing.feasible
    assert fixing.stop is not None and fixing.stop.item == "d" and fixing.subassemblies == ()
    assert fixing.orders is not None and fixing.orders.subassemblies
    nearest = fixing.orders.nearest
    assert nearest and plan(product, nearest).feasible  # It can be asked for in turn.


@pytest.mark.parametrize("order", [("c", "d", "a+b"), ("a+b", "c+d"), ("b+d", "a+c")])
def test_an_order_may_name_subassemblies(order):
    product = product_of(two_pairs())
    fixing = plan(product, order)
    assert fixing.feasible and fixing.order == order
    assert [built.name for built in fixing.subassemblies] == [n for n in order if "+" in n]
    check(product, fixing)


def test_named_subassemblies_have_to_be_possible_and_complete():
    product = product_of(two_pairs())
    apart = product_of(
        {"x": box((9, 9, 9), (0, 0, 0)), "y": box((9, 9, 9), (50, 0, 0))}
        | {"z": box((70, 9, 9), (0, 0, -9))}
    )
    fixing = plan(apart, ("z", "x+y"))
    assert not fixing.feasible and fixing.stop is not None
    assert fixing.stop.item == "x+y" and fixing.steps == ()
    assert "cannot be built: x touches no part" in fixing.stop.reason
    with pytest.raises(CellError, match="a\\+q"):
        plan(product, ("a+q", "b", "c", "d"))
    with pytest.raises(CellError, match="lacks d"):
        plan(product, ("a+b", "c"))
    assert named_subassemblies(product, ("a", "b", "c+d"))[0].order == ("c", "d")


def test_a_ring_of_bars_stays_infeasible():
    """Not even two bars together leave: no sub-assembly is invented."""
    fixing = plan(reciprocal_ring())
    assert not fixing.feasible and fixing.subassemblies == ()


def test_plan_file_holds_the_subassemblies(tmp_path):
    fixing = plan(product_of(two_pairs()))
    save_plan(fixing, tmp_path / "plan.json")
    (built,) = json.loads((tmp_path / "plan.json").read_text())["subassemblies"]
    assert set(built) == {"name", "parts", "order", "steps"}
    assert built["steps"][0]["posture"] in DIRECTIONS
    after = load_plan(tmp_path / "plan.json")
    assert plan_to_dict(after) == plan_to_dict(fixing)
    assert after.subassemblies == fixing.subassemblies and after.orders == fixing.orders


def test_the_general_rule_looks_at_both_lines():
    product = product_of(two_pairs())
    fixing = plan(product)
    assert fixing.matrices is not None
    setup = FixtureSetup.of(CellConfig())
    for order, line in [(fixing.order, fixing.steps)] + [
        (built.order, built.steps) for built in fixing.subassemblies
    ]:
        choices = general_rule(product, order, line, fixing.matrices, setup)
        assert [choice.item for choice in choices] == list(order[1:])


def test_the_twin_refuses_subassemblies():
    product = product_of(two_pairs())
    with pytest.raises(NoOperation, match="builds a sub-assembly"):
        steps(product, plan(product))


def random_locked(rng: np.random.Generator, n: int) -> Items:
    contact = np.triu(rng.random((n, n)) < 0.8, 1).astype(int)
    free = {}
    for j in DIRECTIONS[::2]:
        free[j] = (rng.random((n, n)) < 0.55).astype(int)
        free["-" + j[1]] = free[j].T
    return items_of([f"p{i}" for i in range(n)], [[i] for i in range(n)], contact, free)


def test_groups_leave_and_divisions_come_apart():
    """On random blocking: groups leave the rest, divisions have an order at each level."""
    rng = np.random.default_rng(3)
    divided = 0
    for _ in range(200):
        items = random_locked(rng, 6)
        core = locked_core(items)
        if not core & (core - 1):
            continue
        for group in leaving_groups(items, core):
            rest = core & ~group
            assert rest and any(
                all(not hits[i] & rest for i in members(group)) for hits in items.hits.values()
            )

        def items_of_bodies(bodies, items=items):
            sets = [sum(1 << int(part[1:]) for part in body.parts) for body in bodies]
            return Items(
                tuple(body.name for body in bodies),
                combined(sets, items.touching),
                {j: combined(sets, hits) for j, hits in items.hits.items()},
                tuple(items.connected(own) for own in sets),
                tuple(range(len(bodies))),
            )

        bodies = [Body(name, (name,)) for name in items.names]
        found = Division(items_of_bodies, lambda _: 0).divided(bodies)
        if found is None:
            continue
        divided += 1
        assert sorted(part for body in found for part in body.parts) == sorted(items.names)
        for whole in [tuple(found), *(b.built_of for body in found for b in body.subassemblies())]:
            core = locked_core(items_of_bodies(whole))
            assert not core & (core - 1)
    assert divided > 3


def combined(sets: list[int], relation: tuple[int, ...]) -> tuple[int, ...]:
    """Return, per set, the numbers of the other sets that any of its items is related to."""
    rows = []
    for number, own in enumerate(sets):
        near = 0
        for i in members(own):
            near |= relation[i]
        rows.append(sum(1 << k for k, other in enumerate(sets) if k != number and near & other))
    return tuple(rows)
