"""Sub-assemblies that leave as one: how items that lock each other are put together after all.

Where no single item leaves the others, a group of them may, moved as one. Such a group is built
first, on its own, and then added to the rest like one item. Both halves have to hang together by
contact, since each is held as one body. What is still locked is divided again, within the group as
well as beside it.

A group leaves along a direction if its items hit only each other. The smallest such groups are the
sets that can be reached in the blocking graph from each strongly connected part of it; they and
their complements, which leave the other way, are tried. A group of which nothing would drop while
it is carried comes first, then the smaller one. There may be divisions that this does not try:
a product without one is not proved to have none, unless it is inseparable (``separation``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from planning.ordering.items import Items, members
from planning.ordering.search import Undecided, any_order
from planning.ordering.separation import locked_core

MOST_DIVISIONS = 60  # [A] Divisions that are tried altogether: a second or so.

Parts = tuple[str, ...]


@dataclass(frozen=True)
class Body:
    """What moves as one: an item of the product, or a sub-assembly of several.

    Attributes:
        name: Of the item, or those of its items, joined by "+".
        parts: Names of its parts.
        built_of: Bodies that it is assembled from; none for an item of the product.
    """

    name: str
    parts: Parts
    built_of: tuple[Body, ...] = ()

    def subassemblies(self) -> Iterator[Body]:
        """Yield the sub-assemblies that are built for it, each after those it consists of."""
        for body in self.built_of:
            yield from body.subassemblies()
        if self.built_of:
            yield self


@dataclass
class Division:
    """Divides items that lock each other into sub-assemblies.

    Attributes:
        items_of: Contact and blocking of some bodies.
        drops: Number of parts that would drop from a body while it is carried.
        left: Divisions that may still be tried.
    """

    items_of: Callable[[Sequence[Body]], Items]
    drops: Callable[[Parts], int]
    left: int = MOST_DIVISIONS

    def divided(self, bodies: Sequence[Body]) -> list[Body] | None:
        """Return bodies of which an order exists, some of them sub-assemblies; None if none do."""
        items = self.items_of(bodies)
        core = locked_core(items)
        if not core & (core - 1):
            return list(bodies) if _has_order(items) else None
        for moving in self._choices(items, core, bodies):
            if self.left <= 0:
                return None
            self.left -= 1
            own = self.divided([bodies[i] for i in members(moving)])
            if own is None:
                continue
            name = "+".join(bodies[i].name for i in members(moving))
            parts = tuple(part for i in members(moving) for part in bodies[i].parts)
            body = Body(name, parts, tuple(own))
            first, *others = members(moving)
            rest = [
                body if i == first else bodies[i] for i in range(len(bodies)) if i not in others
            ]
            found = self.divided(rest)
            if found is not None:
                return found
        return None

    def _choices(self, items: Items, core: int, bodies: Sequence[Body]) -> list[int]:
        """Return groups of the core that leave the rest of it, the best first."""

        def rank(group: int) -> tuple[int, int, int]:
            parts = tuple(part for i in members(group) for part in bodies[i].parts)
            return self.drops(parts), group.bit_count(), group

        found = {side for part in leaving_groups(items, core) for side in (part, core ^ part)}
        others = items.everything ^ core  # They may connect the rest of the core.
        whole = (
            g
            for g in found
            if items.connected(g)
            and (items.connected(core ^ g) or items.connected(core ^ g | others))
        )
        return sorted(whole, key=rank)


def leaving_groups(items: Items, core: int) -> set[int]:
    """Return groups of a set, each of which leaves the rest along some direction.

    They are those reached in the blocking graph from each of its strongly connected parts.
    """
    numbers = list(members(core))
    found: set[int] = set()
    for hits in items.hits.values():
        graph = np.array([[hits[i] >> k & 1 for k in numbers] for i in numbers])
        count, labels = connected_components(graph, directed=True, connection="strong")
        for label in range(count if count > 1 else 0):
            found.add(_reached(numbers[int(np.argmax(labels == label))], hits, core))
    return found - {core}


def _reached(item: int, hits: Sequence[int], core: int) -> int:
    """Return all items of a set that an item pushes ahead of it, itself included."""
    reached = grown = 1 << item
    while grown:
        near = 0
        for i in members(grown):
            near |= hits[i]
        grown = near & core & ~reached
        reached |= grown
    return reached


def _has_order(items: Items) -> bool:
    try:
        return any_order(items) is not None
    except Undecided:
        return False
