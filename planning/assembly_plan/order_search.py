"""From items to the order of their assembly: with slanted directions, with sub-assemblies.

Directions and sub-assemblies beyond the plain case are searched for only where it fails: slanted
directions where items lock each other along the six, or where a requested order stops for lack of a
direction; sub-assemblies where single items still lock each other. An order that was asked for
stays as it is; the advice names one with sub-assemblies. It may name them itself, by their items:
"a+b".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cell.products.product import Product
from planning.feasibility.algorithm import FixingStep, Stop, Vector, configure_fixing
from planning.feasibility.fitting import fitted_solids
from planning.feasibility.matrices import AssemblyMatrices
from planning.feasibility.solids import Solid
from planning.fixture_analysis.candidate import FixtureSetup
from planning.ordering.advice import (
    NO_WAYS,
    Built,
    OrderAdvice,
    advise,
    fallback_order,
    product_items,
    with_groups,
)
from planning.ordering.further import FurtherWays, further_ways, step_ways, with_slanted
from planning.ordering.separation import locked_core

Result = tuple[tuple[str, ...], tuple[FixingStep, ...], Stop | None]
"""Order, steps up to where Algorithm 1 stopped, and why it stopped."""


@dataclass(frozen=True)
class AssemblyLine:
    """How a product is built, or a sub-assembly before it is added to the rest as one item.

    Attributes:
        name: Of the product; of a sub-assembly, its item of the main order or of another one's.
        parts: Names of its parts, in matrix order.
        order: Its items in the order of assembly.
        steps: One per incoming item.
    """

    name: str
    parts: tuple[str, ...]
    order: tuple[str, ...]
    steps: tuple[FixingStep, ...]


class OrderSearch:
    """The order of some items and its steps, with as many directions as it takes."""

    def __init__(
        self,
        product: Product,
        matrices: AssemblyMatrices,
        setup: FixtureSetup,
        named: Sequence[Built] = (),
        ways: FurtherWays = NO_WAYS,
    ) -> None:
        """Begin a search.

        Args:
            product: With named sub-assemblies among its groups.
            matrices: Of its parts.
            setup: Of the cell, for the stability of stages.
            named: Sub-assemblies that an order names.
            ways: Slanted directions that are known already.
        """
        self.product, self.matrices, self.setup, self.named = product, matrices, setup, named
        self.ways = ways
        self.advice: OrderAdvice | None = None
        self.built: list[AssemblyLine] = []

    def given(self, order: tuple[str, ...], others: tuple[str, ...] = ()) -> Result:
        """Follow an order that was asked for; advise on others if it stops.

        Args:
            order: Its items.
            others: Items to advise on even if it does not stop; none for no such advice.
        """
        steps, stop = self._configured(self.product, order)
        while stop is not None and stop.blockers and self._step_freed(stop):
            steps, stop = self._configured(self.product, order)
        if stop is not None:
            self._free_core(order)
            self.advice = advise(
                self.product, self.matrices, self.setup, order, requested=True, ways=self.ways
            )
            steps, stop = self._configured(self.product, order)
        elif others:
            self.advice = advise(self.product, self.matrices, self.setup, others, ways=self.ways)
        for number, name in enumerate(order):
            items = next((whole.order for whole in self.named if whole.name == name), None)
            unbuilt = self._build(name, items) if items else None
            if unbuilt is not None and number <= len(steps):
                steps, stop = steps[: max(0, number - 1)], unbuilt
        return order, steps, stop

    def free(self, names: tuple[str, ...]) -> Result:
        """Take the best order of some items, with sub-assemblies if single items lock."""
        self._free_core(names)
        advice = advise(self.product, self.matrices, self.setup, names, ways=self.ways)
        self.advice = advice
        if advice.ranked:
            chosen = advice.ranked[0].order
        else:
            chosen = fallback_order(self.product, names, self.matrices, self.ways.slanted)
        product = with_groups(self.product, advice.subassemblies)
        self.built = [
            AssemblyLine(
                whole.name,
                tuple(name for name in product.parts if name in whole.parts),
                whole.order,
                self._configured(product, whole.order)[0],
            )
            for whole in advice.subassemblies
        ]
        return chosen, *self._configured(product, chosen)

    def _build(self, name: str, items: tuple[str, ...]) -> Stop | None:
        """Plan a sub-assembly that an order names; return why it cannot be built, if it cannot."""
        inner = OrderSearch(self.product, self.matrices, self.setup, ways=self.ways)
        order, steps, stop = inner.free(items)
        self.ways = inner.ways
        members = self.product.members(name)
        parts = tuple(part for part in self.product.parts if part in members)
        self.built += [*inner.built, AssemblyLine(name, parts, order, steps)]
        if stop is None:
            return None
        reason = f"it cannot be built: {stop.reason}"
        return Stop(name, stop.target, stop.incoming, reason, stop.blockers)

    def _configured(
        self, product: Product, order: tuple[str, ...]
    ) -> tuple[tuple[FixingStep, ...], Stop | None]:
        ways = self.ways
        return configure_fixing(product, order, self.matrices, ways.slanted, ways.tried)

    def _free_core(self, names: tuple[str, ...]) -> None:
        """Search for slanted directions if the items lock each other."""
        parts = [self.matrices.indices(self.product.members(name)) for name in names]
        items = product_items(self.product, names, self.matrices, self.ways.slanted)
        if (core := locked_core(items)) & (core - 1):
            self._add(further_ways(items, parts, *self._shapes()))

    def _step_freed(self, stop: Stop) -> bool:
        """Search for slanted directions of one step; return whether there are any."""
        indices = self.matrices.indices(stop.incoming), self.matrices.indices(stop.target)
        free = with_slanted(self.matrices.interference.free, self.ways.slanted)
        found = step_ways(*indices, free, self.matrices.contact, *self._shapes())
        return self._add(found)

    def _shapes(self) -> tuple[list[Solid], float, list[Vector]]:
        matrices = self.matrices
        axes = [thread.axis for thread in matrices.threads]
        solids, _ = fitted_solids(matrices.solids, matrices.overlaps, matrices.tolerances)
        return list(solids.values()), matrices.tolerance, axes

    def _add(self, found: FurtherWays) -> bool:
        """Add directions to those known; return whether any are new."""
        known = {way.label for way in self.ways.slanted}
        new = tuple(way for way in found.slanted if way.label not in known)
        self.ways = FurtherWays(self.ways.slanted + new, max(self.ways.tried, found.tried))
        return bool(new)


def named_subassemblies(product: Product, order: Sequence[str]) -> tuple[Built, ...]:
    """Return the sub-assemblies that an order names by their items, such as "a+b"."""
    known = {*product.parts, *product.groups}
    found = []
    for name in order:
        items = tuple(name.split("+"))
        if name not in known and len(items) > 1 and known.issuperset(items):
            parts = tuple(part for item in items for part in product.members(item))
            found.append(Built(name, parts, items))
    return tuple(found)
