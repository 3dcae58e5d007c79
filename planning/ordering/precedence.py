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
    others = [k for k in range(len(items.names)) if k != first]
    blocked = {k: _has_to_be_there(items, first, k) for k in others}
    cut_off = {i: items.everything & ~_reached(items, first, without=i) for i in others}
    before = {
        k: blocked[k] | as_set(i for i in others if i != k and cut_off[i] >> k & 1) for k in others
    }
    full = _closure(before)
    return tuple(
        Precedence(items.names[i], items.names[k], "blocking" if blocked[k] >> i & 1 else "contact")
        for k in before
        for i in members(_direct(k, full))
    )


def _has_to_be_there(items: Items, first: int, k: int) -> int:
    """Return the items that cannot leave while the first one and k are there."""
    both = 1 << k | 1 << first
    return locked_core(items, kept=both) & ~both


def _reached(items: Items, first: int, without: int) -> int:
    """Return the items that chains of contacts from the first one lead to, past one of them."""
    reached = grown = 1 << first
    while grown:
        near = _union(items.touching[i] for i in members(grown))
        grown = near & ~reached & ~(1 << without)
        reached |= grown
    return reached


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
