"""Proof that no order exists: items that lock each other, alone and in sub-assemblies.

Two facts make it exact without trying orders:

What leaves a set leaves every subset that contains it. So removing single items until none can be
removed ends in the same core whatever was removed first. If the core has more than one item, no
order of single items exists: whichever of the core is added last would have to leave the others.

A sub-assembly leaves the rest along j exactly if none of its items hits one of the rest. In the
blocking graph (Wilson and Latombe), with an edge from each item to those it hits along j, such a
sub-assembly exists if and only if the graph is not strongly connected. The graph along -j is that
along +j with its edges reversed: three axes suffice.

Considered are single straight translations to infinity: along the six directions, and along those
slanted ones that the items' contacts suggested and that were tried (``further``). No rotations, no
paths with turns; a thread counts as a straight way along its axis. So what is proved is proved of
these motions. Contact is not required: it could only forbid more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from planning.ordering.items import Items, as_set, members


@dataclass(frozen=True)
class Interlock:
    """Items of which none can be added last.

    Attributes:
        items: Names of the core: none of them leaves the others along any direction.
        subassembly: Names of a sub-assembly of the core that leaves the rest of it, or none.
        direction: Along which it does, or "".
        stuck: Names of items that cannot be assembled from sub-assemblies either; none if the whole
            product can.
        slanted: Number of slanted directions that were tried beside the six.
    """

    items: tuple[str, ...]
    subassembly: tuple[str, ...]
    direction: str
    stuck: tuple[str, ...]
    slanted: int = 0


def locked_core(items: Items, kept: int = 0, within: int | None = None) -> int:
    """Remove single items until none leaves; return the set that remains.

    Args:
        items: The items.
        kept: Set of items that are not removed.
        within: Set to begin with; None for all.
    """
    core, before = items.everything if within is None else within, 0
    while core != before:
        before = core
        for i in members(before & ~kept):
            if core != 1 << i and items.leaves(i, core ^ (1 << i)):
                core ^= 1 << i
    return core


def find_interlock(items: Items, slanted: int = 0) -> Interlock | None:
    """Return why no order of single items exists, or None if blocking does not rule it out.

    Args:
        items: With all directions that free something.
        slanted: Number of slanted directions that were tried to find those.
    """
    core = locked_core(items)
    if not core & (core - 1):
        return None
    moving, direction = split(items, core)
    stuck = inseparable(items, core)
    moved, left = items.listed(moving), items.listed(stuck)
    return Interlock(items.listed(core), moved, direction, left, slanted)


def split(items: Items, core: int) -> tuple[int, str]:
    """Return a sub-assembly that leaves the rest of a set, and the direction; 0 if there is none.

    Of several, one that is connected and whose rest is, and of those the smallest.
    """
    choices = []
    for j, hits in items.hits.items():
        for part in _closed_parts(core, hits):
            loose = not (items.connected(part) and items.connected(core ^ part))
            choices.append((loose, part.bit_count(), part, j))
    return min(choices)[2:] if choices else (0, "")


def _closed_parts(core: int, hits: tuple[int, ...]) -> list[int]:
    """Return the strongly connected parts of the blocking graph that hit nothing outside."""
    numbers = list(members(core))
    graph = np.array([[hits[i] >> k & 1 for k in numbers] for i in numbers])
    count, labels = connected_components(graph, directed=True, connection="strong")
    if count == 1:
        return []
    parts = [as_set(n for n, own in zip(numbers, labels, strict=True) if own == label)
             for label in range(count)]  # fmt: skip
    return [p for p in parts if not any(hits[i] & core & ~p for i in members(p))]


def inseparable(items: Items, core: int) -> int:
    """Split a set recursively as far as possible; return the first inseparable set, or 0.

    Subsets of a separable set are separable, so any split will do.
    """
    waiting = [core]
    while waiting:
        whole = waiting.pop()
        if not whole & (whole - 1):
            continue
        moving, _ = split(items, whole)
        if not moving:
            return whole
        waiting += [moving, whole ^ moving]
    return 0
