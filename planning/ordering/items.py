"""The items of an order as bit sets: which touch, and which hit which when they leave.

A set of items is an integer whose bit i stands for item i, so that "does i leave this set along j"
is one AND. Everything here follows from C and the M_j; no geometry is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components


@dataclass(frozen=True)
class Items:
    """What decides whether an item can be added: contact and blocking between items.

    Attributes:
        names: Items of the order: groups, and parts outside any group.
        touching: Per item, the set of items that it touches.
        hits: Per direction and item, the set of items it hits when it moves along it to infinity:
            the six, then slanted ones by their labels.
        whole: Per item, whether its parts are connected: loose bolts cannot be held as one body.
        kinds: Per item a number, equal for items of the same shape and mass.
    """

    names: tuple[str, ...]
    touching: tuple[int, ...]
    hits: Mapping[str, tuple[int, ...]]
    whole: tuple[bool, ...]
    kinds: tuple[int, ...]

    @property
    def everything(self) -> int:
        """The set of all items."""
        return (1 << len(self.names)) - 1

    def directions(self, item: int, rest: int) -> list[str]:
        """Return the directions along which an item leaves the rest of a set."""
        return [j for j, hits in self.hits.items() if not hits[item] & rest]

    def leaves(self, item: int, rest: int) -> bool:
        """Return whether an item leaves the rest of a set along any direction."""
        return any(not hits[item] & rest for hits in self.hits.values())

    def connected(self, items: int) -> bool:
        """Return whether a set is connected by contacts."""
        return self._linked(items, items)

    def connected_without(self, item: int, rest: int) -> bool:
        """Return whether the rest of a connected set stays connected without an item."""
        return self._linked(self.touching[item] & rest, rest)

    def _linked(self, some: int, items: int) -> bool:
        """Return whether contacts within a set link some of its items with each other."""
        reached = grown = some & -some
        while grown and some & ~reached:
            near = 0
            for item in members(grown):
                near |= self.touching[item]
            grown = near & items & ~reached
            reached |= grown
        return not some & ~reached

    def listed(self, items: int) -> tuple[str, ...]:
        """Return the names of the items in a set."""
        return tuple(self.names[item] for item in members(items))


def members(items: int) -> Iterator[int]:
    """Yield the numbers of the items in a set."""
    while items:
        lowest = items & -items
        yield lowest.bit_length() - 1
        items ^= lowest


def as_set(numbers: Iterable[int]) -> int:
    """Return a set of item numbers."""
    return sum(1 << number for number in set(numbers))


def items_of(
    names: Sequence[str],
    parts: Sequence[Sequence[int]],
    contact: np.ndarray,
    free: Mapping[str, np.ndarray],
    kinds: Sequence[int] = (),
) -> Items:
    """Combine parts into items, which touch or block if any of their parts do.

    Args:
        names: Of the items.
        parts: Per item the matrix indices of its parts.
        contact: (n, n) strictly upper triangular C.
        free: Per direction, by label, the (n, n) matrix M_j.
        kinds: Per item a number, equal for items of the same shape; () if all differ.
    """
    touches = (contact + contact.T).astype(bool)
    member = np.zeros((len(names), len(contact)), bool)
    for item, indices in enumerate(parts):
        member[item, list(indices)] = True
    return Items(
        tuple(names),
        _rows(member, touches),
        {j: _rows(member, matrix == 0) for j, matrix in free.items()},
        tuple(
            connected_components(touches[np.ix_(indices, indices)], directed=False)[0] == 1
            for indices in map(list, parts)
        ),
        tuple(kinds) or tuple(range(len(names))),
    )


def _rows(member: np.ndarray, relation: np.ndarray) -> tuple[int, ...]:
    """Return, per item, the set of other items that any of its parts is related to."""
    chosen = member.astype(float)  # Exact for whole numbers, and far faster to multiply than int.
    related = chosen @ relation.astype(float) @ chosen.T > 0
    np.fill_diagonal(related, False)
    return tuple(as_set(np.flatnonzero(row).tolist()) for row in related)
