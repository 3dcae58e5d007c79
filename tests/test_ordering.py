"""Orders: known answers, agreement with trying everything, proofs that there is none."""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from large_products import reciprocal_ring, star, tray_of_plates
from tiny_products import (
    bolted,
    box,
    interlocked_links,
    peg_in_hole,
    product_of,
    stack_of_three,
    tube_and_pins,
)

from cell import CellConfig
from cell.products.loading import load_product
from cell.products.product import Product
from planning import plan
from planning.feasibility.directions import DIRECTIONS
from planning.ordering.items import Items, items_of
from planning.ordering.precedence import precedences
from planning.ordering.search import any_order, best_orders
from planning.ordering.separation import find_interlock, inseparable, locked_core


def feasible(items: Items, order: tuple[int, ...]) -> bool:
    """What Algorithm 1 asks of every step, written down directly."""
    placed = 1 << order[0]
    for item in order[1:]:
        if not items.touching[item] & placed or not items.leaves(item, placed):
            return False
        placed |= 1 << item
    return items.whole[order[0]]


def random_items(rng: np.random.Generator, n: int) -> Items:
    """Contacts and blocking at random; M_-j is the transpose of M_+j."""
    contact = np.triu(rng.random((n, n)) < 0.5, 1).astype(int)
    free = {}
    for j in DIRECTIONS[::2]:
        free[j] = (rng.random((n, n)) < 0.45).astype(int)
        free["-" + j[1]] = free[j].T
    return items_of([f"p{i}" for i in range(n)], [[i] for i in range(n)], contact, free)


@pytest.fixture(scope="module")
def samples() -> list[Items]:
    rng = np.random.default_rng(1)
    return [random_items(rng, 5) for _ in range(120)]


def test_search_agrees_with_trying_every_order(samples):
    """Feasible or not, and the cheapest for a cost that depends on set and item."""
    found_some = 0
    for items in samples:

        def cost(rest: int, item: int) -> tuple[int, ...]:
            return ((rest * 7 + item * 13) % 11, (rest + 3 * item) % 5)

        def total(order: tuple[int, ...], cost=cost) -> tuple[int, ...]:
            sets = [sum(1 << i for i in order[:k]) for k in range(len(order))]
            return tuple(np.sum([cost(s, i) for s, i in zip(sets, order, strict=True)], axis=0))

        orders = [order for order in permutations(range(5)) if feasible(items, order)]
        found = best_orders(items, cost)
        assert found.exact
        assert bool(found.orders) == bool(orders) == (any_order(items) is not None)
        if orders:
            found_some += 1
            assert found.orders[0][0] == min(total(order) for order in orders)
            assert feasible(items, found.orders[0][1])
    assert 20 < found_some < 100  # Both answers have been asked for.


def test_precedence_holds_in_every_feasible_order(samples):
    for items in samples:
        orders = [order for order in permutations(range(5)) if feasible(items, order)]
        for first in range(5):
            arrows = precedences(items, first)
            for order in (order for order in orders if order[0] == first):
                place = {items.names[i]: k for k, i in enumerate(order)}
                assert all(place[a.before] < place[a.after] for a in arrows)


def test_a_locked_core_leaves_no_order(samples):
    """Necessary: whichever of the core comes last is blocked. Found in some of the samples."""
    locked = [items for items in samples if find_interlock(items)]
    assert len(locked) > 10
    for items in locked:
        assert not any(feasible(items, order) for order in permutations(range(5)))


def subsets(items: int) -> list[int]:
    """All proper, non-empty subsets of a set."""
    return [s for s in range(1, items) if s & items == s]


def test_no_subassembly_leaves_an_inseparable_set(samples):
    """Against all subsets and directions, one by one."""
    proved = 0
    for items in samples:
        stuck = inseparable(items, items.everything)
        for moving in subsets(stuck) if stuck else []:
            for hits in items.hits.values():
                rest = stuck & ~moving
                assert any(hits[i] & rest for i in range(5) if moving >> i & 1)
        proved += bool(stuck)
    assert proved > 5


def test_core_does_not_depend_on_what_is_removed_first(samples):
    rng = np.random.default_rng(2)
    for items in samples:
        core = items.everything
        while True:
            free = [i for i in range(5) if core >> i & 1 and items.leaves(i, core ^ (1 << i))]
            if not free or core.bit_count() == 1:
                break
            core ^= 1 << int(rng.choice(free))
        if core.bit_count() > 1:
            assert core == locked_core(items)
        else:
            assert locked_core(items).bit_count() == 1


def test_twenty_parts_in_a_tray():
    """0 re-fixings leave one order. The second best turns the tray over the stack: 1 re-fixing."""
    started = time.process_time()
    product = tray_of_plates(18)
    fixing = plan(product)
    assert fixing.orders is not None and fixing.feasible
    best, second = fixing.orders.ranked[:2]
    assert fixing.order == best.order == tuple(product.parts) and len(product.parts) == 20
    assert (best.unstable_stages, best.refixings) == (0, 0)
    assert (second.unstable_stages, second.refixings) == (0, 1)
    assert fixing.orders.exact
    assert {step.fixed_part for step in fixing.steps} == {"tray"}
    assert time.process_time() - started < 5.0  # 0.4 s; ten times that is a mistake.


def test_fifty_parts_in_a_tray_with_pins():
    """Each plate waits for the one below it, each pin for its plate, the lid for the last plate."""
    started = time.process_time()
    fixing = plan(tray_of_plates(24, pinned=True))
    assert len(fixing.parts) == 50 and fixing.feasible and fixing.orders is not None
    best = fixing.orders.ranked[0]
    assert (best.unstable_stages, best.refixings) == (0, 0)
    arrows = {(arrow.before, arrow.after) for arrow in fixing.orders.precedence}
    plates = {(f"plate_{k}", f"plate_{k + 1}") for k in range(23)} | {("plate_23", "lid")}
    assert arrows == plates | {(f"plate_{k}", f"pin_{k}") for k in range(24)}
    place = {name: k for k, name in enumerate(fixing.order)}
    assert fixing.order[0] == "tray"
    assert all(place[before] < place[after] for before, after in arrows)
    assert time.process_time() - started < 20.0  # 2.2 s; ten times that is a mistake.


def test_parts_in_any_order_have_no_precedence():
    fixing = plan(star(19))
    assert fixing.orders is not None and fixing.orders.precedence == ()
    assert fixing.order[0] == "base" and len(fixing.order) == 20


def test_equal_parts_are_not_listed_in_every_permutation():
    """Five orders that differ in kind; 5! permutations of the pegs are one of them."""
    orders = plan(star(5)).orders
    assert orders is not None
    kinds = [tuple(name[:3] for name in ranked.order) for ranked in orders.ranked]
    assert len(set(kinds)) == len(kinds)


def test_interlocked_ring_is_proved_infeasible():
    """Any two bars come apart, the ring does not: neither a bar nor two together."""
    product = reciprocal_ring()
    fixing = plan(product)
    assert all(any(fixing.free[j][i, k] for j in DIRECTIONS) for i in range(4) for k in range(i))
    assert not fixing.feasible and fixing.stop is not None and fixing.orders is not None
    assert fixing.orders.ranked == () and fixing.orders.exact
    interlock = fixing.orders.interlock
    assert interlock is not None
    assert interlock.items == interlock.stuck == tuple(product.parts)
    assert interlock.subassembly == ()
    assert "no sub-assembly of them" in fixing.orders.reason
    assert "no rotations" in fixing.orders.reason
    assert fixing.stop.blockers  # The step's evidence: the last bar against the others.


def test_a_ring_with_a_gap_has_an_order():
    assert plan(reciprocal_ring(3)).feasible


def test_subassemblies_that_go_together_are_named():
    """Two pairs that come apart along z only: a + b can be drawn out of c + d along +x, as one."""
    pairs = {"ab", "ba", "cd", "dc"}
    across = {m + s for m in "abcd" for s in "abcd" if m != s} - pairs
    blocked = {"+x": pairs | {"ca", "da"}, "+y": pairs | across, "+z": across}
    free = {}
    for j, hits in blocked.items():
        free[j] = np.array([[int(m + s not in hits) for s in "abcd"] for m in "abcd"])
        free["-" + j[1]] = free[j].T
    contact = np.triu(np.ones((4, 4), int), 1)
    items = items_of(list("abcd"), [[i] for i in range(4)], contact, free)
    interlock = find_interlock(items)
    assert interlock is not None and any_order(items) is None
    assert interlock.items == ("a", "b", "c", "d")
    assert (interlock.subassembly, interlock.direction) in {(("a", "b"), "+x"), (("c", "d"), "-x")}
    assert interlock.stuck == ()


def test_motor_unit_orders():
    """The paper's two orders and the one more that there is; its default is the best."""
    product = load_product("motor_unit")
    orders = plan(product).orders
    assert orders is not None and orders.exact
    assert orders.ranked[0].order == product.orders[0]
    assert {ranked.order for ranked in orders.ranked} == {
        ("motor", "plate", "bolts"),
        ("plate", "bolts", "motor"),
        ("plate", "motor", "bolts"),
    }
    assert [ranked.refixings for ranked in orders.ranked] == [0, 1, 1]
    assert all(ranked.unstable_stages == 0 for ranked in orders.ranked)


def test_nearest_order_exchanges_as_few_pairs_as_possible():
    product = load_product("motor_unit")
    orders = plan(product, ("motor", "bolts", "plate")).orders
    assert orders is not None
    assert (orders.nearest, orders.exchanged) == (("motor", "plate", "bolts"), 1)


def test_no_advice_where_none_is_needed():
    product = load_product("motor_unit")
    assert plan(product, product.orders[0]).orders is None


def test_re_fixings_and_heights_are_those_of_algorithm_1():
    """The search counts what the steps then show, whatever order it is."""
    for product in (stack_of_three(), bolted(), tube_and_pins(), peg_in_hole()):
        orders = plan(product).orders
        assert orders is not None
        for ranked in orders.ranked:
            steps = plan(product, ranked.order).steps
            fixed = [ranked.order[0], *(step.fixed_part for step in steps)]
            changes = sum(a != b for a, b in zip(fixed, fixed[1:], strict=False))
            assert changes == ranked.refixings
            heights = [step.cog_height for step in steps]
            first = plan(product, ranked.order).steps[0].target
            low = min(product.parts[n].mesh.bounds[0, 2] for n in first)
            mass = sum(product.parts[n].mass for n in first)
            cog = sum(product.parts[n].mass * product.parts[n].mesh.center_mass[2] for n in first)
            mean = np.mean([cog / mass - low, *heights])
            assert ranked.mean_cog_height == pytest.approx(mean, abs=2e-6)


def test_a_peg_that_overhangs_is_unstable():
    """A long beam on a post taller than the bag: the centre of gravity is beside the post."""
    post = box((20, 20, 60), (0, 0, 0))
    beam = box((120, 20, 20), (0, 0, 60))
    orders = plan(product_of({"post": post, "beam": beam})).orders
    assert orders is not None
    ranked = {r.order: r.unstable_stages for r in orders.ranked}
    assert ranked[("post", "beam")] == 1


def on_a_foot() -> Product:
    """A plate on an eccentric foot of 10 mm: it is stable once the plate itself lies in the bed."""
    base = box((10, 10, 10), (-5, -5, 0)) + box((60, 40, 10), (-5, -20, 10))
    return product_of({"base": base, "lid": box((20, 20, 5), (10, -10, 20))})


def configured(**changes: float) -> CellConfig:
    """The default cell with another press force, or another floor of the bag."""
    config = CellConfig()
    if "press_force" in changes:
        return replace(config, placement=replace(config.placement, **changes))
    return replace(config, jig=replace(config.jig, bag=replace(config.jig.bag, **changes)))


@pytest.mark.parametrize("changes", [{"press_force": 1.0}, {"floor": 0.037}])
def test_the_search_uses_the_configured_jig_and_press_force(changes):
    """The plate reaches the bed neither under 1 N nor in a bag of 9 mm: the base is unstable."""
    default, changed = plan(on_a_foot()), plan(on_a_foot(), config=configured(**changes))
    assert default.orders is not None and changed.orders is not None
    assert default.order == ("base", "lid") and changed.order == ("lid", "base")
    assert [r.unstable_stages for r in default.orders.ranked] == [0, 0]
    assert [r.unstable_stages for r in changed.orders.ranked] == [1, 2]


def test_parts_that_touch_nothing_are_named():
    apart = product_of({"a": box((5, 5, 5), (0, 0, 0)), "b": box((5, 5, 5), (20, 0, 0))})
    fixing = plan(apart)
    assert fixing.orders is not None and not fixing.feasible
    assert "b is not connected with a" in fixing.orders.reason


def test_two_links_are_locked():
    orders = plan(interlocked_links()).orders
    assert orders is not None and orders.interlock is not None
    assert orders.interlock.items == ("link_1", "link_2")
