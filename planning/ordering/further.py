"""Further ways out: slanted directions, searched only where the six do not suffice.

Given items that lock each other, axes from their contacts are tried: first against the contact
normals, then exactly on the whole shapes, between the parts of these items. What a direction frees
is taken away, and the search goes on with what remains, until nothing more comes apart. Directions
that free something are then computed for all parts of the product: an order may place any item
before or after the freed one, and its steps have to know what is in the way.

The effort is bounded by numbers of axes and of triangles, not by time, so that the same product
always gets the same plan.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse.csgraph import connected_components

from planning.feasibility.candidate_axes import body_normals, candidate_axes, local_hits
from planning.feasibility.slanted import Decided, Slanted, axis_matrix, decided_along, slanted_pair
from planning.feasibility.solids import Solid
from planning.ordering.items import Items, items_of, members
from planning.ordering.separation import locked_core, split

MOST_TESTED = 60  # [A] Axes tested exactly.
MOST_TRIANGLES = 10_000_000  # [M] Times axes tested exactly: some seconds.
EXTRA = 4  # [A] Axes that are kept beside those needed: they may hold a part in a better posture.
EXTRA_TRIANGLES = 400_000  # [M] Times axes: extra ones only as far as they take no second.


@dataclass(frozen=True)
class FurtherWays:
    """Slanted directions that free something, and how many were tried.

    Attributes:
        slanted: Two per axis, a direction and its opposite.
        tried: Slanted directions that were tried: on contact normals, and exactly if those allow.
    """

    slanted: tuple[Slanted, ...] = ()
    tried: int = 0


def further_ways(
    items: Items,
    parts: Sequence[Sequence[int]],
    solids: Sequence[Solid],
    tolerance: float,
    axes: Sequence[Sequence[float]] = (),
) -> FurtherWays:
    """Return slanted directions that take the locked core of some items apart, as far as possible.

    Args:
        items: With what is known of them so far.
        parts: Per item the matrix indices of its parts.
        solids: All n parts in matrix order, threads cut out.
        tolerance: As for the six directions [m].
        axes: Further axes to try, (3,) each, for example of threads.
    """
    core = locked_core(items)
    if not core & (core - 1):
        return FurtherWays()
    search = _Search(items, parts, solids, tolerance, core)
    search.propose(axes)
    search.take_apart()
    return search.result()


@dataclass
class _Search:
    """The axes proposed for a locked core, and what has been found out about them."""

    items: Items
    parts: Sequence[Sequence[int]]
    solids: Sequence[Solid]
    tolerance: float
    core: int
    axes: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    tested: dict[int, Mapping[str, tuple[int, ...]]] = field(default_factory=dict)
    needed: list[int] = field(default_factory=list)
    refused: set[int] = field(default_factory=set)
    decided: dict[int, Decided] = field(default_factory=dict)

    def propose(self, axes: Sequence[Sequence[float]]) -> None:
        """Collect candidate axes from the contacts in the core."""
        self.numbers = list(members(self.core))
        bodies = [[self.solids[p] for p in self.parts[i]] for i in self.numbers]
        touching = [self.items.touching[i] for i in self.numbers]
        pairs = [
            (a, b)
            for a in range(len(bodies))
            for b in range(a)
            if touching[a] >> self.numbers[b] & 1
        ]
        normals = body_normals(bodies, pairs, self.tolerance)
        own = [solid for body in bodies for solid in body]
        self.axes = candidate_axes(own, normals, axes)
        self.local = local_hits(self.axes, normals, len(bodies))
        self.triangles = sum(len(solid.faces) for solid in own)

    def take_apart(self) -> None:
        """Free single items, then sub-assemblies, until what remains is locked for good."""
        waiting = [self.core]
        while waiting:
            whole = locked_core(self._known(self.needed), within=waiting.pop())
            if not whole & (whole - 1):
                continue
            if self._accept(whole, self._may_free_one, self._frees_one):
                waiting.append(whole)
            elif (moving := split(self._known(self.needed), whole)[0]) or (
                self._accept(whole, self._may_split, self._splits)
                and (moving := split(self._known(self.needed), whole)[0])
            ):
                waiting += [moving, whole ^ moving]

    def result(self) -> FurtherWays:
        """Return the needed directions, and some more that free something, for all parts."""
        kept = list(self.needed)
        all_triangles = sum(len(solid.faces) for solid in self.solids)
        extra = min(EXTRA, EXTRA_TRIANGLES // max(1, all_triangles)) if kept else 0
        more = (k for k in range(len(self.axes)) if k not in kept)
        useful = [k for k in more if extra and self._may_split(k, self.core)][:extra]
        kept += [k for k in useful if self._test(k) and self._splits(k, self.core)]
        slanted = [
            way
            for k in kept
            for way in slanted_pair(self.solids, self.axes[k], self.tolerance, self.decided.get(k))
        ]
        return FurtherWays(tuple(slanted), 2 * (len(self.axes) - len(self.refused)))

    def _accept(
        self, whole: int, may: Callable[[int, int], bool], does: Callable[[int, int], bool]
    ) -> bool:
        """Accept the first axis that frees something of a set; return whether there is one."""
        for k in range(len(self.axes)):
            if k not in self.needed and may(k, whole) and self._test(k) and does(k, whole):
                self.needed.append(k)
                return True
        return False

    def _test(self, k: int) -> bool:
        """Test an axis exactly between the parts of the core; return False if it costs too much."""
        if k not in self.tested:
            number = len(self.tested) + 1
            if number > MOST_TESTED or number * self.triangles > MOST_TRIANGLES:
                self.refused.add(k)
                return False
            self.tested[k] = self._exact(k)
        return True

    def _exact(self, k: int) -> Mapping[str, tuple[int, ...]]:
        """Return which items of the core hit which along an axis and against it."""
        at = sorted(p for i in self.numbers for p in self.parts[i])
        decided = decided_along([self.solids[p] for p in at], self.axes[k], self.tolerance)
        if at == list(range(len(self.solids))):  # All parts: the same will be asked for again.
            self.decided[k] = decided
        among, _ = axis_matrix(decided, len(at), self.tolerance)
        free = np.ones((len(self.solids), len(self.solids)), int)
        free[np.ix_(at, at)] = among
        both = {f"+{k}": free, f"-{k}": free.T}
        return items_of(self.items.names, self.parts, np.zeros_like(free), both).hits

    def _known(self, chosen: Sequence[int]) -> Items:
        """Return the items with the six directions, and the chosen axes of the core."""
        hits = dict(self.items.hits)
        for k in chosen:
            hits |= self.tested[k]
        return replace(self.items, hits=hits)

    def _may_free_one(self, k: int, whole: int) -> bool:
        """Return whether contact normals let a single item of a set start along an axis."""
        hits = self._local(k, whole)
        return not (hits.any(axis=1).all() and hits.any(axis=0).all())

    def _may_split(self, k: int, whole: int) -> bool:
        """Return whether contact normals let a part of a set start along an axis."""
        return connected_components(self._local(k, whole), connection="strong")[0] > 1

    def _frees_one(self, k: int, whole: int) -> bool:
        there = self.tested[k].values()
        return any(not hits[i] & whole & ~(1 << i) for hits in there for i in members(whole))

    def _splits(self, k: int, whole: int) -> bool:
        return bool(split(replace(self.items, hits=self.tested[k]), whole)[0])

    def _local(self, k: int, whole: int) -> np.ndarray:
        at = [a for a, i in enumerate(self.numbers) if whole >> i & 1]
        return self.local[k][np.ix_(at, at)]


def step_ways(
    incoming: Sequence[int],
    target: Sequence[int],
    free: Mapping[str, np.ndarray],
    contact: np.ndarray,
    solids: Sequence[Solid],
    tolerance: float,
    axes: Sequence[Sequence[float]] = (),
) -> FurtherWays:
    """Return slanted directions along which incoming parts leave a target as a whole.

    Args:
        incoming: Matrix indices of the parts that are added.
        target: Matrix indices of the parts that they are added to.
        free: Per direction, six and further ones, the (n, n) matrix M.
        contact: (n, n) strictly upper triangular C.
        solids: As in ``further_ways``.
        tolerance: As in ``further_ways`` [m].
        axes: As in ``further_ways``.
    """
    parts = [list(target), list(incoming)]
    items = items_of(("target", "incoming"), parts, contact, free)
    return further_ways(items, parts, solids, tolerance, axes)


def with_slanted(
    free: Mapping[str, np.ndarray], slanted: Sequence[Slanted]
) -> dict[str, np.ndarray]:
    """Return the matrices M of the six directions, then of slanted ones by their labels."""
    return {**free, **{way.label: way.free for way in slanted}}
