"""What a user vouches for where the planner's rule for rigid bodies would refuse it.

Real CAD holds overlaps that are meant: a pin drawn larger than the hole that it is pressed into, a
gasket drawn uncompressed, a thread nobody modelled. And it holds parts that are mounted by bending:
snap hooks, belts. Neither follows from the shapes alone, so it is declared, per pair or part, and
the plan reports what was declared and what the shapes say about it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from cell.errors import InputError
from cell.products.joints import PartNames

Pair = frozenset[str]

EVERY_OVERLAP = "all"
"""Written instead of a pair, it accepts every overlap that nothing else explains."""


@dataclass(frozen=True)
class Declared:
    """Pairs and parts, by name.

    Attributes:
        accept: Pairs whose overlap is to be ignored: they count as touching where they overlap.
        press: Pairs with interference, one pressed into the other.
        snap: Pairs of which one springs over an undercut of the other.
        flexible: Parts that stretch or bend over what they fit round, such as belts.
        accept_all: Whether every overlap is accepted that nothing else explains.
    """

    accept: frozenset[Pair] = field(default_factory=frozenset)
    press: frozenset[Pair] = field(default_factory=frozenset)
    snap: frozenset[Pair] = field(default_factory=frozenset)
    flexible: frozenset[str] = field(default_factory=frozenset)
    accept_all: bool = False

    def overlap_kind(self, part: str, other: str) -> str:
        """Return what the overlap of a pair is declared to be: "press", "accept", or ""."""
        pair = frozenset((part, other))
        if pair in self.press:
            return "press"
        return "accept" if pair in self.accept else ""


def declared_from(
    product: PartNames,
    *,
    accept: Iterable[str] = (),
    press: Iterable[str] = (),
    snap: Iterable[str] = (),
    flexible: Iterable[str] = (),
) -> Declared:
    """Return declarations written as on the command line.

    Args:
        product: Its parts and groups are referred to by name.
        accept: Pairs "a,b" of parts or groups, or ``EVERY_OVERLAP``.
        press: Pairs "a,b".
        snap: Pairs "a,b".
        flexible: Parts or groups.

    Raises:
        UnknownName: A part or group that does not exist.
        InputError: Not a pair of different parts.
    """
    accept = list(accept)
    return Declared(
        accept=frozenset(_pairs(product, "accept", (p for p in accept if p != EVERY_OVERLAP))),
        press=frozenset(_pairs(product, "press", press)),
        snap=frozenset(_pairs(product, "snap", snap)),
        flexible=frozenset(part for name in flexible for part in product.members(name)),
        accept_all=EVERY_OVERLAP in accept,
    )


def _pairs(product: PartNames, option: str, texts: Iterable[str]) -> Iterator[Pair]:
    for text in texts:
        names = [name.strip() for name in text.split(",")]
        if len(names) != 2 or names[0] == names[1]:
            raise InputError(f"'{option} {text}': write two different parts, like a,b.")
        first, second = (product.members(name) for name in names)
        yield from (frozenset((a, b)) for a in first for b in second if a != b)
