"""What has to come before what, whatever the rest of the order: the precedence graph.

With the first item given, k has to wait for i if one of two tests says so:

- Blocking: take off everything that can be taken off while k stays. What remains cannot leave while
  k is there, so it has to be there before k is.
- Contact: k must touch something when it comes. If every chain of contacts from the first item to k
  leads through i, then i comes before k.

Both are necessary, so every arrow holds in every feasible order that begins with that item. They
are not sufficient where one of several items would do as a neighbour: the search decides that.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from planning.ordering.items import Items, as_set, members
from planning.ordering.separation import locked_core


@dataclass(frozen=True)
class Precedence:
    """One arrow of the graph.

    Attributes:
        before: Name of the item that comes first.
        after: Name of the item that waits for it.
        reason: "blocking": it could not come in later. "contact": nothing else carries the chain.
    """

    before: str
    after: str
    reason: str


def precedences(items: Items, first: int) -> tuple[Precedence, ...]:
    """Return the arrows that do not follow from others, for orders that begin with an item."""
    blocked, unreached = {}, {}
    for k in range(len(items.names)):
        if k != first:
            blocked[k] = locked_core(items, kept=1 << k | 1 << first) & ~(1 << k | 1 << first)
            unreached[k] = _only_through(items, first, k)
    before = {k: blocked[k] | unreached[k] for k in blocked}
    return tuple(
        Precedence(items.names[i], items.names[k], "blocking" if blocked[k] >> i & 1 else "contact")
        for k in before
        for i in members(_direct(k, _closure(before)))
    )


def _only_through(items: Items, first: int, last: int) -> int:
    """Return the items that lie on every chain of contacts between two items."""
    return as_set(
        i
        for i in range(len(items.names))
        if i not in (first, last) and not _reaches(items, first, last, without=i)
    )


def _reaches(items: Items, first: int, last: int, without: int) -> bool:
    reached = grown = 1 << first
    while grown and not reached >> last & 1:
        near = _union(items.touching[i] for i in members(grown))
        grown = near & ~reached & ~(1 << without)
        reached |= grown
    return bool(reached >> last & 1)


def _closure(before: dict[int, int]) -> dict[int, int]:
    """Return, per item, all that come before it through any chain."""
    full = dict(before)
    changed = True
    while changed:
        changed = False
        for k, earlier in full.items():
            more = earlier | _union(full.get(i, 0) for i in members(earlier))
            changed |= more != earlier
            full[k] = more
    return full


def _direct(k: int, full: dict[int, int]) -> int:
    """Return what comes before an item and not before something else that does."""
    return full[k] & ~_union(full.get(i, 0) for i in members(full[k]))


def _union(sets: Iterable[int]) -> int:
    union = 0
    for items in sets:
        union |= items
    return union
