"""Support against gravity: which parts of a body would drop in a posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse.csgraph import connected_components

from cell.products.product import Product
from planning.feasibility.directions import opposite
from planning.feasibility.matrices import AssemblyMatrices
from planning.fixture_analysis.footprint import USUAL_DEPTH


@dataclass(frozen=True, eq=False)
class SupportAnalysis:
    """Connected pieces and unsupported parts of a product, from its matrices.

    Attributes:
        product: For its screws.
        matrices: Contact, interference and shapes.
        pieces: Cache of ``components``: every posture of a step needs those of the same sets.
    """

    product: Product
    matrices: AssemblyMatrices
    pieces: dict[tuple[str, ...], list[tuple[str, ...]]] = field(default_factory=dict)

    def components(self, parts: Sequence[str]) -> list[tuple[str, ...]]:
        """Return the connected components of a set of parts, by contact."""
        key = tuple(parts)
        if key not in self.pieces:
            at = self.matrices.indices(key)
            contact = self.matrices.contact[np.ix_(at, at)]
            count, labels = connected_components(contact, directed=False)
            self.pieces[key] = [
                tuple(name for name, own in zip(key, labels, strict=True) if own == label)
                for label in range(count)
            ]
        return self.pieces[key]

    def falling(self, body: Sequence[str], up: str) -> list[str]:
        """Return the parts of a body on the jig that would fall off it, with ``up`` up.

        A part stays if it reaches down into the bed, is fastened to a part that stays, or has a
        part that stays in its way down.
        """
        low = np.array([self.matrices.solids[name].lowest(up) for name in body])
        return self._unsupported(body, up, low <= low.min() + USUAL_DEPTH)

    def dropped(self, carried: Sequence[str], up: str) -> list[str]:
        """Return the parts that would drop from a hand that holds the heaviest of each piece."""
        found: list[str] = []
        for piece in self.components(carried):
            mass = np.array([self.matrices.solids[name].mass for name in piece])
            held = np.arange(len(piece)) == mass.argmax()
            found += self._unsupported(piece, up, held)
        return found

    def _unsupported(self, body: Sequence[str], up: str, stays: np.ndarray) -> list[str]:
        """Return the parts that no chain of parts connects to one that stays (n,) bool."""
        at = self.matrices.indices(tuple(body))
        blocked = self.matrices.interference.free[opposite(up)][np.ix_(at, at)] == 0
        np.fill_diagonal(blocked, False)
        rests_on = blocked | self._fastened(body)
        while (more := rests_on[:, stays].any(axis=1) & ~stays).any():
            stays = stays | more
        return [name for name, kept in zip(body, stays, strict=True) if not kept]

    def _fastened(self, body: Sequence[str]) -> np.ndarray:
        """Return (n, n) bool: each bolt with both of its sides, if all three are in the body."""
        place = {name: number for number, name in enumerate(body)}
        joined = np.zeros((len(body), len(body)), bool)
        for bolt in body:
            screw = self.product.screws.get(bolt)
            if screw and screw.into in place and screw.clamps in place:
                joined[place[bolt], [place[screw.into], place[screw.clamps]]] = True
        return joined | joined.T
