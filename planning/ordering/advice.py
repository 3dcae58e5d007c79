"""Advice on orders: the best ones, which item has to precede which, or why there is none."""

from __future__ import annotations

import time
from dataclasses import dataclass

from cell.products.product import Product
from planning.feasibility.matrices import AssemblyMatrices
from planning.feasibility.solids import Solid
from planning.fixture_analysis.candidate import FixtureSetup
from planning.ordering.items import Items, as_set, items_of
from planning.ordering.objective import HEIGHT_UNIT, Objective
from planning.ordering.precedence import Precedence, precedences
from planning.ordering.search import Cost, Undecided, best_orders
from planning.ordering.separation import Interlock, find_interlock, locked_core

LISTED = 5  # Orders.


@dataclass(frozen=True)
class RankedOrder:
    """One feasible order.

    Attributes:
        order: Its items.
        unstable_stages: Stages that would tip over, or lose a part.
        refixings: Steps in which the jig has to take another part.
        mean_cog_height: Of all stages, above the lowest point [m].
    """

    order: tuple[str, ...]
    unstable_stages: int
    refixings: int
    mean_cog_height: float


@dataclass(frozen=True)
class OrderAdvice:
    """The feasible orders of a product, or why there is none.

    Attributes:
        ranked: Feasible orders, best first; empty if there is none.
        exact: Whether no order is better than the first of them or, if there is none, whether that
            is proved.
        precedence: Constraints that hold in every feasible order with the same first item.
        nearest: Feasible order with the fewest pairs of items exchanged against the requested one;
            empty if that is feasible, or none was requested.
        exchanged: Number of these pairs.
        interlock: Items that lock each other, if that is why there is no order.
        reason: Why there is no order; "" if there is one.
        seconds: Computing time [s].
    """

    ranked: tuple[RankedOrder, ...]
    exact: bool
    precedence: tuple[Precedence, ...]
    nearest: tuple[str, ...]
    exchanged: int
    interlock: Interlock | None
    reason: str
    seconds: float


def advise(
    product: Product,
    matrices: AssemblyMatrices,
    setup: FixtureSetup,
    requested: tuple[str, ...] | None = None,
) -> OrderAdvice:
    """Find the best orders of a product, and the one nearest to a requested, infeasible order.

    Args:
        product: Items are its groups and the parts outside them.
        matrices: Contact and interference of its parts.
        setup: The cell's jig and press force, which decide whether a stage stands in the bed.
        requested: An infeasible order; its items are used instead of the product's.
    """
    started = time.perf_counter()
    names = product.items() if requested is None else requested
    items = product_items(product, names, matrices)
    interlock = find_interlock(items)
    if interlock:
        reason = interlock_text(interlock)
        seconds = time.perf_counter() - started
        return OrderAdvice((), True, (), (), 0, interlock, reason, seconds)
    parts = [product.members(name) for name in names]
    objective = Objective(items, matrices.solids, parts, product.up, setup)
    try:
        found = best_orders(items, objective.cost, LISTED)
        nearest = best_orders(items, inversions) if requested and found.orders else None
    except Undecided:
        reason = "no order was found, and there are too many to try them all"
        return OrderAdvice((), False, (), (), 0, None, reason, time.perf_counter() - started)
    ranked = [
        RankedOrder(
            tuple(items.names[i] for i in order),
            unstable,
            refixings,
            heights * HEIGHT_UNIT / len(order),
        )
        for (unstable, refixings, heights), order in found.orders
    ]
    exchanged, near = nearest.orders[0] if nearest else ((0,), ())
    return OrderAdvice(
        tuple(ranked),
        found.exact,
        precedences(items, found.orders[0][1][0]) if found.orders else (),
        tuple(items.names[i] for i in near),
        exchanged[0],
        None,
        "" if found.orders else _no_order(items),
        time.perf_counter() - started,
    )


def product_items(product: Product, names: tuple[str, ...], matrices: AssemblyMatrices) -> Items:
    """Return the items of a product, in the order of the names."""

    def signature(solid: Solid) -> tuple[float, ...]:
        """What equal parts have in common, to a micrometre and a milligram."""
        size = sorted(round(float(edge), 6) for edge in solid.upper - solid.lower)
        return (*size, round(solid.mass, 6), len(solid.faces))

    parts = [matrices.indices(product.members(name)) for name in names]
    solids = list(matrices.solids.values())
    shapes = [tuple(signature(solids[i]) for i in indices) for indices in parts]
    kinds = [shapes.index(shape) for shape in shapes]
    return items_of(names, parts, matrices.contact, matrices.interference.free, kinds)


def inversions(rest: int, item: int) -> Cost:
    """Return how many items are added after this one although they were requested before it.

    Items are numbered as requested, so these are the lower numbers that are not in the set yet.
    """
    return ((~rest & ((1 << item) - 1)).bit_count(),)


def fallback_order(product: Product, matrices: AssemblyMatrices) -> tuple[str, ...]:
    """Return an infeasible order that shows why, for a product without a feasible one.

    The items that lock each other come first, by contact, so that the step where Algorithm 1 stops
    is one of theirs and its evidence names them.
    """
    names = product.items()
    items = product_items(product, names, matrices)
    core = locked_core(items)
    return tuple(names[i] for i in (*_by_contact(items, core), *_by_contact(items, ~core)))


def _by_contact(items: Items, chosen: int) -> list[int]:
    """Return the chosen items so that each touches an earlier one as far as possible."""
    waiting = [i for i in range(len(items.names)) if chosen >> i & 1]
    ordered: list[int] = []
    while waiting:
        near = as_set(ordered)
        following = next((i for i in waiting if items.touching[i] & near), waiting[0])
        waiting.remove(following)
        ordered.append(following)
    return ordered


def interlock_text(interlock: Interlock) -> str:
    """Return the proof that no order of single items exists, and what sub-assemblies can do."""
    listed = ", ".join(interlock.items)
    text = (
        f"none of {listed} can leave the others along any of the six directions, so whichever of "
        "them is added last is blocked"
    )
    if interlock.stuck:
        stuck = "them" if interlock.stuck == interlock.items else ", ".join(interlock.stuck)
        text += f"; no sub-assembly of {stuck} can leave the rest either"
    elif interlock.subassembly:
        together = " + ".join(interlock.subassembly)
        text += (
            f"; but {together} together can leave the rest along {interlock.direction}, and all "
            "can be built from such sub-assemblies: put them into a group"
        )
    return text + ". Considered are straight translations to infinity, no rotations, no turns"


def _no_order(items: Items) -> str:
    """Return why there is no order although no items lock each other."""
    if not items.connected(items.everything):
        near = _by_contact(items, items.everything)
        number = next(
            n for n in range(1, len(near)) if not items.touching[near[n]] & as_set(near[:n])
        )
        island, first = items.names[near[number]], items.names[near[0]]
        return f"{island} is not connected with {first} by any contacts"
    if not any(items.whole):
        return "the parts of every item are loose, so none can be fixed first"
    return (
        "in every order some item is blocked, or touches nothing, when it is added; all sets that "
        "can be reached by disassembly were tried"
    )
