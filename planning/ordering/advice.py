"""Advice on orders: the best ones, which item has to precede which, or why there is none."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from cell.products.product import Product
from planning.feasibility.matrices import AssemblyMatrices
from planning.feasibility.slanted import Slanted
from planning.feasibility.solids import Solid
from planning.fixture_analysis.candidate import FixtureSetup
from planning.fixture_analysis.support import SupportAnalysis
from planning.ordering.further import FurtherWays, with_slanted
from planning.ordering.items import Items, as_set, items_of
from planning.ordering.objective import HEIGHT_UNIT, Objective
from planning.ordering.precedence import Precedence, precedences
from planning.ordering.search import Cost, SearchResult, Undecided, best_orders
from planning.ordering.separation import Interlock, find_interlock, locked_core
from planning.ordering.subassemblies import Body, Division

LISTED = 5  # Orders.
NO_WAYS = FurtherWays()


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
class Built:
    """A sub-assembly that an order contains as one item, and how it is built before.

    Attributes:
        name: Its item of the order: the names of its items, joined by "+".
        parts: Names of its parts.
        order: Its items in the order of assembly, some of them sub-assemblies themselves.
    """

    name: str
    parts: tuple[str, ...]
    order: tuple[str, ...]


@dataclass(frozen=True)
class OrderAdvice:
    """The feasible orders of a product, or why there is none.

    Attributes:
        ranked: Feasible orders, best first; empty if there is none. They contain sub-assemblies
            where single items lock each other.
        exact: Whether no order is better than the first of them or, if there is none, whether that
            is proved.
        precedence: Constraints that hold in every feasible order with the same first item.
        nearest: Feasible order with the fewest pairs of items exchanged against the requested one;
            empty if that is feasible, or none was requested.
        exchanged: Number of these pairs.
        interlock: Items that lock each other, if that is why there is no order of single items.
        reason: Why there is no order; "" if there is one.
        seconds: Computing time [s].
        subassemblies: What the orders contain as one item, each after those it is built of.
        slanted: Number of slanted directions that were considered beside the six.
    """

    ranked: tuple[RankedOrder, ...]
    exact: bool
    precedence: tuple[Precedence, ...]
    nearest: tuple[str, ...]
    exchanged: int
    interlock: Interlock | None
    reason: str
    seconds: float
    subassemblies: tuple[Built, ...] = ()
    slanted: int = 0


def advise(
    product: Product,
    matrices: AssemblyMatrices,
    setup: FixtureSetup,
    names: tuple[str, ...] | None = None,
    *,
    requested: bool = False,
    ways: FurtherWays = NO_WAYS,
) -> OrderAdvice:
    """Find the best orders of some items, and the one nearest to a requested, infeasible order.

    Args:
        product: Items are its groups and the parts outside them.
        matrices: Contact and interference of its parts.
        setup: The cell's jig and press force, which decide whether a stage stands in the bed.
        names: Items to order; None for all of the product's.
        requested: Whether the names are an infeasible order that was asked for.
        ways: Slanted directions that free something.
    """
    started = time.perf_counter()
    names = product.items() if names is None else names
    items = product_items(product, names, matrices, ways.slanted)
    interlock = find_interlock(items, ways.tried)
    built: tuple[Built, ...] = ()
    if interlock:
        divided = None if interlock.stuck else _divided(product, names, matrices, setup, ways)
        if divided is None:
            reason = interlock_text(interlock)
            seconds = time.perf_counter() - started
            return OrderAdvice((), True, (), (), 0, interlock, reason, seconds)
        names, built = divided
        product = with_groups(product, built)
        items = product_items(product, names, matrices, ways.slanted)
    try:
        found = _best_orders(product, names, items, matrices, setup, ways, LISTED)
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
        # Other sub-assemblies, or slanted directions that were not needed, might do better.
        found.exact and not built and not ways.slanted,
        precedences(items, found.orders[0][1][0]) if found.orders else (),
        tuple(items.names[i] for i in near),
        exchanged[0],
        interlock,
        "" if found.orders else _no_order(items),
        time.perf_counter() - started,
        built,
        len(ways.slanted),
    )


def _best_orders(
    product: Product,
    names: tuple[str, ...],
    items: Items,
    matrices: AssemblyMatrices,
    setup: FixtureSetup,
    ways: FurtherWays,
    keep: int,
) -> SearchResult:
    parts = [product.members(name) for name in names]
    objective = Objective(items, matrices.solids, parts, product.up, setup, ways.slanted)
    return best_orders(items, objective.cost, keep)


def _divided(
    product: Product,
    names: tuple[str, ...],
    matrices: AssemblyMatrices,
    setup: FixtureSetup,
    ways: FurtherWays,
) -> tuple[tuple[str, ...], tuple[Built, ...]] | None:
    """Return items of which an order exists, and the sub-assemblies among them; None if none do."""
    support = SupportAnalysis(product, matrices)

    def items_of_bodies(bodies: Sequence[Body]) -> Items:
        parts = [matrices.indices(body.parts) for body in bodies]
        free = with_slanted(matrices.interference.free, ways.slanted)
        return items_of([body.name for body in bodies], parts, matrices.contact, free)

    bodies = [Body(name, product.members(name)) for name in names]
    division = Division(items_of_bodies, lambda parts: len(support.dropped(parts, product.up)))
    found = division.divided(bodies)
    if found is None:
        return None
    built: list[Built] = []
    for body in (part for whole in found for part in whole.subassemblies()):
        own = tuple(part.name for part in body.built_of)
        product = with_groups(product, built)
        items = product_items(product, own, matrices, ways.slanted)
        try:
            best = _best_orders(product, own, items, matrices, setup, ways, 1).orders
        except Undecided:
            return None
        order = tuple(own[i] for i in best[0][1])
        built.append(Built(body.name, body.parts, order))
    return tuple(body.name for body in found), tuple(built)


def with_groups(product: Product, built: Sequence[Built]) -> Product:
    """Return a product of which sub-assemblies are groups as well, which may overlap."""
    groups = {**product.groups, **{whole.name: whole.parts for whole in built}}
    return replace(product, groups=groups)


def product_items(
    product: Product,
    names: tuple[str, ...],
    matrices: AssemblyMatrices,
    slanted: Sequence[Slanted] = (),
) -> Items:
    """Return the items of a product, in the order of the names."""

    def signature(solid: Solid) -> tuple[float, ...]:
        """What equal parts have in common, to a micrometre and a milligram."""
        size = sorted(round(float(edge), 6) for edge in solid.upper - solid.lower)
        return (*size, round(solid.mass, 6), len(solid.faces))

    parts = [matrices.indices(product.members(name)) for name in names]
    solids = list(matrices.solids.values())
    shapes = [tuple(signature(solids[i]) for i in indices) for indices in parts]
    kinds = [shapes.index(shape) for shape in shapes]
    free = with_slanted(matrices.interference.free, slanted)
    return items_of(names, parts, matrices.contact, free, kinds)


def inversions(rest: int, item: int) -> Cost:
    """Return how many items are added after this one although they were requested before it.

    Items are numbered as requested, so these are the lower numbers that are not in the set yet.
    """
    return ((~rest & ((1 << item) - 1)).bit_count(),)


def fallback_order(
    product: Product,
    names: tuple[str, ...],
    matrices: AssemblyMatrices,
    slanted: Sequence[Slanted] = (),
) -> tuple[str, ...]:
    """Return an infeasible order of items that shows why, where there is no feasible one.

    The items that lock each other come first, by contact, so that the step where Algorithm 1 stops
    is one of theirs and its evidence names them.
    """
    items = product_items(product, names, matrices, slanted)
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
        f"none of {listed} can leave the others along any of the directions considered, so "
        "whichever of them is added last is blocked"
    )
    if interlock.stuck:
        stuck = "them" if interlock.stuck == interlock.items else ", ".join(interlock.stuck)
        text += f"; no sub-assembly of {stuck} can leave the rest either"
    elif interlock.subassembly:
        together = " + ".join(interlock.subassembly)
        text += (
            f"; {together} together can leave the rest along {interlock.direction}, but no "
            "sub-assemblies were found that hang together by contact and can be built themselves"
        )
    return f"{text}. {considered_text(interlock)}"


def considered_text(interlock: Interlock) -> str:
    """Return which motions a proof is about, in a sentence."""
    slanted = f", {interlock.slanted} slanted ones from contacts" if interlock.slanted else ""
    return (
        f"Considered are straight translations of rigid parts to infinity along the six directions"
        f"{slanted} and the axes of recognised threads, which turning frees; no rotations "
        "otherwise, no paths with turns, no bending"
    )


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
