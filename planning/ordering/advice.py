"""What the planner says about orders: the best ones, what comes before what, or why none."""

from __future__ import annotations

import time
from dataclasses import dataclass

from cell.products.product import Product
from planning.feasibility.algorithm import Geometry
from planning.feasibility.solids import Solid
from planning.ordering.items import Items, as_set, items_of
from planning.ordering.objective import HEIGHT_UNIT, Objective
from planning.ordering.precedence import Precedence, precedences
from planning.ordering.search import Cost, Partial, Undecided, best_orders
from planning.ordering.separation import Interlock, find_interlock, locked_core

KEPT = 5  # Orders that are listed.
OBJECTIVE = (
    "fewest unstable stages, then fewest re-fixings, then the lowest mean height of the centre of "
    "gravity over all stages"
)


@dataclass(frozen=True)
class RankedOrder:
    """One feasible order.

    Attributes:
        order: Its items.
        unstable_stages: Stages that would not stand, or would lose a part.
        refixings: Steps in which the jig has to take another part.
        mean_cog_height: Of all stages, above the lowest point [m].
    """

    order: tuple[str, ...]
    unstable_stages: int
    refixings: int
    mean_cog_height: float


@dataclass(frozen=True)
class OrderAdvice:
    """Which orders there are.

    Attributes:
        ranked: Feasible orders, best first; empty if there is none.
        exact: Whether none is better than the first of them, or, if there are none, whether that
            is proved.
        precedence: Arrows that hold in every feasible order that begins like the first one.
        nearest: Of the orders found, that with the fewest pairs of items exchanged against the one
            that was asked for; empty if that was feasible, or nothing was asked for.
        exchanged: How many pairs.
        interlock: Items that lock each other, if that is why there is no order.
        reason: Why there is no order; "" if there is one.
        seconds: Time that this took [s].
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
    product: Product, geometry: Geometry, asked: tuple[str, ...] | None = None
) -> OrderAdvice:
    """Find the best orders of a product, and the one nearest to an order that is not feasible.

    Args:
        product: Items are its groups and the parts outside them.
        geometry: Contact and interference of its parts.
        asked: An order to come near to; its items are taken instead of the product's.
    """
    started = time.perf_counter()
    names = product.items() if asked is None else asked
    items = product_items(product, names, geometry)
    interlock = find_interlock(items)
    if interlock:
        reason = interlock_text(interlock)
        seconds = time.perf_counter() - started
        return OrderAdvice((), True, (), (), 0, interlock, reason, seconds)
    objective = Objective(items, geometry.solids, [product.members(n) for n in names], product.up)
    try:
        found = best_orders(items, objective.cost, KEPT)
        nearest = best_orders(items, inversions) if asked and found.orders else None
    except Undecided:
        reason = "no order was found, and there are too many to try them all"
        return OrderAdvice((), False, (), (), 0, None, reason, time.perf_counter() - started)
    exchanged, near = nearest.orders[0] if nearest else ((0,), ())
    return OrderAdvice(
        tuple(_ranked(items, order) for order in found.orders),
        found.exact,
        precedences(items, found.orders[0][1][0]) if found.orders else (),
        tuple(items.names[i] for i in near),
        exchanged[0],
        None,
        "" if found.orders else _no_order(items),
        time.perf_counter() - started,
    )


def product_items(product: Product, names: tuple[str, ...], geometry: Geometry) -> Items:
    """Return the items of a product, in the order of the names."""
    parts = [geometry.indices(product.members(name)) for name in names]
    solids = list(geometry.solids.values())
    shapes = [tuple(_shape(solids[i]) for i in indices) for indices in parts]
    kinds = [shapes.index(shape) for shape in shapes]
    return items_of(names, parts, geometry.contact, geometry.interference.free, kinds)


def inversions(rest: int, item: int) -> Cost:
    """Return how many items come after this one that were asked for before it.

    Items are numbered as asked for: those before it that are not in the set yet.
    """
    return ((~rest & ((1 << item) - 1)).bit_count(),)


def fallback_order(product: Product, geometry: Geometry) -> tuple[str, ...]:
    """Return an order that stops at what cannot be assembled, for a product that has no order.

    The items that lock each other come first, by contact, so that the step where Algorithm 1 stops
    is one of theirs and its evidence names them.
    """
    names = product.items()
    items = product_items(product, names, geometry)
    core = locked_core(items)
    return tuple(names[i] for i in (*_by_contact(items, core), *_by_contact(items, ~core)))


def _by_contact(items: Items, chosen: int) -> list[int]:
    waiting = [i for i in range(len(items.names)) if chosen >> i & 1]
    ordered: list[int] = []
    while waiting:
        near = as_set(ordered)
        following = next((i for i in waiting if items.touching[i] & near), waiting[0])
        waiting.remove(following)
        ordered.append(following)
    return ordered


def _touches(items: Items, item: int, others: list[int]) -> bool:
    return bool(items.touching[item] & as_set(others))


def _shape(solid: Solid) -> tuple[float, ...]:
    """Return what equal parts have in common, to a micrometre and a milligram."""
    size = sorted(round(float(edge), 6) for edge in solid.upper - solid.lower)
    return (*size, round(solid.mass, 6), len(solid.faces))


def _ranked(items: Items, found: Partial) -> RankedOrder:
    (unstable, refixings, heights), order = found
    mean = heights * HEIGHT_UNIT / len(order)
    return RankedOrder(tuple(items.names[i] for i in order), unstable, refixings, mean)


def interlock_text(interlock: Interlock) -> str:
    """Return the proof that no order of single items exists, and what holds for sub-assemblies."""
    listed = ", ".join(interlock.items)
    text = (
        f"none of {listed} can leave the others along any of the six directions, so whichever of "
        "them comes last cannot come in"
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
    """Return why there is no order although nothing is locked."""
    if not items.connected(items.everything):
        near = _by_contact(items, items.everything)
        number = next(n for n in range(1, len(near)) if not _touches(items, near[n], near[:n]))
        island, first = items.names[near[number]], items.names[near[0]]
        return f"{island} is not connected with {first} by any contacts"
    if not any(items.whole):
        return "the parts of every item are loose, so none can be fixed first"
    return (
        "in every order some item comes in while it is blocked, or touches nothing that is there; "
        "all sets that can be reached by taking the product apart were tried"
    )
