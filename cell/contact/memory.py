"""What is remembered of contact links: one value in the Context, copied along with it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cell.contact.link import Link
from cell.contact.plant_side import Pair

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Intent:
    """What a phase means to happen between bodies.

    Attributes:
        mating: Names of each pair that is being mated, or whose hold is tested: their contact stays
            full.
        riding: Names of loose bolts that nothing but the part in which they lie touches.
    """

    mating: frozenset[frozenset[str]] = frozenset()
    riding: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Installed:
    """A link in the plant.

    Attributes:
        link: Which one.
        slots: (6,) numbers of the springs that it uses.
        hidden: (k, 2) numbers of the geometries of A and B that it has taken out of contact.
        until: It ends when the policy says something else than this.
        sleepers: Numbers of those of the two bodies that sleep without contact to the other one:
            while there is any, the springs are off.
    """

    link: Link
    slots: tuple[int, ...]
    hidden: Array
    until: object
    sleepers: frozenset[int] = frozenset()


@dataclass
class LinksMemory:
    """What is remembered of links in a Context.

    Attributes:
        installed: By pair of bodies.
        watched: Contacts that may be linked: relative pose (3, 4) and step since when it holds.
        returns: How often each pair has got its full contact back by a check.
        intent: Of the present phase.
        steps: Since the beginning.
        time: Since the beginning [s].
        linked: For how long each pair has been linked [s].
        made: Links made so far.
        ended: By reason, links that ended.
    """

    installed: dict[Pair, Installed] = field(default_factory=dict)
    watched: dict[Pair, tuple[Array, int]] = field(default_factory=dict)
    returns: dict[Pair, int] = field(default_factory=dict)
    intent: Intent = Intent()
    steps: int = 0
    time: float = 0.0
    linked: dict[Pair, float] = field(default_factory=dict)
    made: int = 0
    ended: Counter[str] = field(default_factory=Counter)

    def __deepcopy__(self, memo: dict[int, Any]) -> LinksMemory:
        """Copy what is changed in place."""
        installed = {p: replace(own, link=replace(own.link)) for p, own in self.installed.items()}
        return replace(
            self,
            installed=installed,
            watched=dict(self.watched),
            returns=dict(self.returns),
            linked=dict(self.linked),
            ended=Counter(self.ended),
        )
