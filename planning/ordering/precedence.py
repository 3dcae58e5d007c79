"""Precedence constraints: which item has to be added before which, in every feasible order.

Given the first item, i has to precede k if one of two tests says so:

- Blocking: remove everything that can be removed while k stays. What remains cannot leave while k
  is present, so it has to be present before k is added.
- Contact: k must touch something when it is added. If every chain of contacts from the first item
  to k leads through i, then i precedes k.

Both are necessary conditions, so every constraint holds in every feasible order that begins with
that item. They are not sufficient if any one of several items would do as a neighbour: the search
decides that.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from planning.ordering.items import Items, as_set, members
from planning.ordering.separation import locked_core


@dataclass(frozen=True)
class Precedence:
    """One edge of the precedence graph.

    Attributes:
        before: Name of the item that is added first.
        after: Name of the item that has to wait for it.
        reason: "blocking": it would be blocked later. "contact": nothing else connects the other.
    """

    before: str
    after: str
    reason: str


def precedences(items: Items, first: int) -> tuple[Precedence, ...]:
    """Return the constraints that do not follow from others, for a given first item."""
    others = [k for k in range(len(items.names)) if k != first]
    both = {k: 1 << k | 1 << first for k in others}
    # Those that cannot leave while the first item and k are present.
    blocked = {k: locked_core(items, kept=both[k]) & ~both[k] for k in others}
    cut_off = {i: items.everything & ~_reached(items, first, without=i) for i in others}
    before = {
        k: blocked[k] | as_set(i for i in others if i != k and cut_off[i] >> k & 1) for k in others
    }
    full = _closure(before)
    direct = {k: full[k] & ~_union(full.get(i, 0) for i in members(full[k])) for k in before}
    return tuple(
        Precedence(items.names[i], items.names[k], "blocking" if blocked[k] >> i & 1 else "contact")
        for k in before
        for i in members(direct[k])
    )


def _reached(items: Items, first: int, without: int) -> int:
    """Return the items that chains of contacts connect to the first one without a given item."""
    reached = grown = 1 << first
    while grown:
        near = _union(items.touching[i] for i in members(grown))
        grown = near & ~reached & ~(1 << without)
        reached |= grown
    return reached


def _closure(before: dict[int, int]) -> dict[int, int]:
    """Return, per item, all that precede it directly or indirectly."""
    full = dict(before)
    changed = True
    while changed:
        changed = False
        for k, earlier in full.items():
            more = earlier | _union(full.get(i, 0) for i in members(earlier))
            changed |= more != earlier
            full[k] = more
    return full


def _union(sets: Iterable[int]) -> int:
    union = 0
    for items in sets:
        union |= items
    return union
