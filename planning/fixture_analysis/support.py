"""What would fall: parts that nothing of their body keeps from dropping in a posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse.csgraph import connected_components

from cell.products.product import Product
from planning.feasibility.algorithm import Geometry
from planning.feasibility.directions import opposite, unit_vector
from planning.fixture_analysis.footprint import USUAL_DEPTH


@dataclass(frozen=True, eq=False)
class Gravity:
    """Loose parts of a product, from its matrices.

    Attributes:
        product: For its fasteners.
        geometry: Contact, interference and shapes.
        pieces: What ``components`` has found: every posture of a step asks for the same sets.
    """

    product: Product
    geometry: Geometry
    pieces: dict[tuple[str, ...], list[tuple[str, ...]]] = field(default_factory=dict)

    def components(self, parts: Sequence[str]) -> list[tuple[str, ...]]:
        """Return the pieces of a set of parts that hang together through contacts."""
        key = tuple(parts)
        if key not in self.pieces:
            at = self.geometry.indices(key)
            self.pieces[key] = _grouped(parts, self.geometry.contact[np.ix_(at, at)])
        return self.pieces[key]

    def falling(self, body: Sequence[str], up: str) -> list[str]:
        """Return the parts of a body on the jig that would fall, with ``up`` up.

        A part stays if it reaches down into the bed, if it is fastened to one that stays, or if one
        that stays is in its way down.
        """
        axis = unit_vector(up)
        low = np.array([(self.geometry.solids[name].vertices @ axis).min() for name in body])
        return self._without_support(body, up, low <= low.min() + USUAL_DEPTH)

    def dropped(self, carried: Sequence[str], up: str) -> list[str]:
        """Return the parts that would fall from a hand that holds the heaviest of each piece."""
        found: list[str] = []
        for piece in self.components(carried):
            mass = np.array([self.geometry.solids[name].mass for name in piece])
            held = np.arange(len(piece)) == mass.argmax()
            found += self._without_support(piece, up, held)
        return found

    def _without_support(self, body: Sequence[str], up: str, stays: np.ndarray) -> list[str]:
        """Return the parts of which no chain of parts below ends in one that stays (n,) bool."""
        at = self.geometry.indices(tuple(body))
        blocked = self.geometry.interference.free[opposite(up)][np.ix_(at, at)] == 0
        np.fill_diagonal(blocked, False)
        rests_on = blocked | self._fastened(body)
        while (more := rests_on[:, stays].any(axis=1) & ~stays).any():
            stays = stays | more
        return [name for name, kept in zip(body, stays, strict=True) if not kept]

    def _fastened(self, body: Sequence[str]) -> np.ndarray:
        """Return (n, n) bool: fasteners in place with both sides, which carry each other."""
        place = {name: number for number, name in enumerate(body)}
        joined = np.zeros((len(body), len(body)), bool)
        for bolt in body:
            fastener = self.product.fasteners.get(bolt)
            if fastener and fastener.into in place and fastener.clamps in place:
                joined[place[bolt], [place[fastener.into], place[fastener.clamps]]] = True
        return joined | joined.T


def _grouped(names: Sequence[str], related: np.ndarray) -> list[tuple[str, ...]]:
    """Return the connected groups of a relation (n, n), in the order of the names."""
    count, labels = connected_components(related, directed=False)
    groups: list[list[str]] = [[] for _ in range(count)]
    for name, label in zip(names, labels, strict=True):
        groups[label].append(name)
    return [tuple(group) for group in groups]
