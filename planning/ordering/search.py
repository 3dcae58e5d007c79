"""The best orders of assembly, found by disassembly.

From the end to the beginning: an item may be removed from a set if it leaves the rest along one of
the six directions and the rest stays connected, which is what Algorithm 1 requires of the step that
adds it. What can be removed from a set can be removed from every smaller set that contains it, so
disassembly hardly ever reaches a dead end, which assembly does all the time.

The cost of a step depends only on the set and the item. So two ways to the same set are equivalent
from then on, and only the ``keep`` cheapest are stored: dynamic programming over sets, layer by
layer. That is exact as long as the layers are small (``layer_width``); beyond that only the
cheapest sets of a layer are expanded (beam search), and the result is marked as not proved best.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from planning.ordering.items import Items, members

EFFORT = 80_000  # [D] Steps that are examined, about: a second.
MOST_SETS = 100_000  # [D] Sets that `any_order` examines: some seconds.

Cost = tuple[int, ...]  # Compared from left to right; whole numbers, so that sums are exact.
StepCost = Callable[[int, int], Cost]  # Of adding an item to a set; to none for the first.
PartialOrder = tuple[Cost, tuple[int, ...]]  # Cost and items removed, in the order of assembly.


class Undecided(Exception):
    """The search reached its limit before it could decide whether an order exists."""


@dataclass(frozen=True)
class SearchResult:
    """Result of a search.

    Attributes:
        orders: Cost and items, cheapest first; empty if there is no order.
        exact: Whether no order of lower cost exists.
        sets: How many sets of items were examined.
    """

    orders: tuple[PartialOrder, ...]
    exact: bool
    sets: int


def layer_width(items: Items) -> int:
    """Return how many sets of a layer are expanded: 200 for 20 items, 32 for 50."""
    return max(10, EFFORT // len(items.names) ** 2)


def best_orders(items: Items, cost: StepCost, keep: int = 1) -> SearchResult:
    """Return the cheapest orders that differ by more than an exchange of equal parts.

    Raises:
        Undecided: No order was found among the sets kept, and there are too many to try all.
    """
    if not items.connected(items.everything):
        return SearchResult((), True, 1)
    layer: dict[int, list[PartialOrder]] = {items.everything: [((), ())]}
    exact, sets, width = True, 1, layer_width(items)
    for _ in items.names[1:]:
        steps = _removals(items, layer, cost)
        sets += len(steps)
        exact = exact and len(steps) <= width
        lowest = {
            rest: min(_sum(spent, layer[rest | 1 << item][0][0]) for spent, item in ways)
            for rest, ways in steps.items()
        }
        cheapest = sorted(steps, key=lambda rest: (lowest[rest], rest))
        layer = {
            rest: _distinct(
                items,
                [
                    (_sum(spent, before), (item, *order))
                    for spent, item in steps[rest]
                    for before, order in layer[rest | 1 << item]
                ],
                keep,
            )
            for rest in cheapest[:width]
        }
    finished = [
        (_sum(cost(0, item), spent), (item, *order))
        for rest, ways in layer.items()
        for item in members(rest)
        for spent, order in ways
        if items.whole[item]
    ]
    if finished or exact:
        return SearchResult(tuple(_distinct(items, finished, keep)), exact, sets)
    order = any_order(items)
    if order is None:
        return SearchResult((), True, sets)
    total, placed = cost(0, order[0]), 1 << order[0]
    for item in order[1:]:
        total = _sum(total, cost(placed, item))
        placed |= 1 << item
    return SearchResult(((total, order),), False, sets)


def _removals(
    items: Items, layer: Mapping[int, list[PartialOrder]], cost: StepCost
) -> dict[int, list[tuple[Cost, int]]]:
    """Return the sets that remain when an item is removed, with the step's cost and item."""
    found: dict[int, list[tuple[Cost, int]]] = {}
    for whole in layer:
        for item in members(whole):
            rest = whole ^ (1 << item)
            if not items.leaves(item, rest):
                continue
            if not (rest in found or items.connected_without(item, rest)):
                continue
            found.setdefault(rest, []).append((cost(rest, item), item))
    return found


def _distinct(items: Items, ways: list[PartialOrder], keep: int) -> list[PartialOrder]:
    """Return the cheapest ways, one for each sequence of kinds."""
    chosen: dict[tuple[int, ...], PartialOrder] = {}
    for way in sorted(ways):
        chosen.setdefault(tuple(items.kinds[item] for item in way[1]), way)
        if len(chosen) == keep:
            break
    return list(chosen.values())


def any_order(items: Items) -> tuple[int, ...] | None:
    """Return some feasible order, or None if there is none; every set is tried at most once.

    Raises:
        Undecided: After ``MOST_SETS`` sets.
    """
    if not items.connected(items.everything):
        return None
    tried: set[int] = set()
    taken: list[int] = []
    stack = [(items.everything, members(items.everything))]
    while stack:
        whole, choices = stack[-1]
        item = next(choices, None)
        if item is None:
            stack.pop()
            del taken[max(0, len(stack) - 1) :]
            continue
        rest = whole ^ (1 << item)
        if rest == 0 and items.whole[item]:
            return (item, *reversed(taken))
        if rest in tried or not rest or not items.leaves(item, rest):
            continue
        if not items.connected_without(item, rest):
            continue
        tried.add(rest)
        if len(tried) > MOST_SETS:
            raise Undecided
        taken.append(item)
        stack.append((rest, members(rest)))
    return None


def _sum(a: Cost, b: Cost) -> Cost:
    return tuple(x + y for x, y in zip(a, b, strict=True)) if b else a
