"""Which items of a product are put in order, and at which contact tolerance.

Items that overlap others, or touch nothing of the rest, are left out and named. Where an order
fails for lack of contact alone, gaps that are plausible as the clearance of a fit are counted as
contact, smallest first, until there is one.
"""

from __future__ import annotations

from dataclasses import dataclass

from cell.products.product import Product
from planning.assembly_plan.order_search import OrderSearch, Result
from planning.feasibility.matrices import AssemblyMatrices, looser_contact
from planning.fixture_analysis.candidate import FixtureSetup
from planning.ordering.advice import Built
from planning.ordering.unplanned import Unplanned, overlapping_items, stray_items


@dataclass(frozen=True, eq=False)
class Ordered:
    """The order of a product's items, as far as its matrices allow one.

    Attributes:
        matrices: With the contact tolerance at which it was found.
        search: What was found on the way: advice, slanted directions, sub-assemblies.
        unplanned: Items that are left out of it.
        result: The order, its steps, and why Algorithm 1 stopped, if it did.
    """

    matrices: AssemblyMatrices
    search: OrderSearch
    unplanned: tuple[Unplanned, ...]
    result: Result

    @property
    def lacks_contact(self) -> bool:
        """Whether it fails although nothing blocks: some item touches nothing when it is added."""
        _, _, stop = self.result
        if stop is None:
            return False
        advice = self.search.advice
        return not stop.blockers or bool(advice and not advice.ranked and not advice.interlock)


@dataclass(frozen=True, eq=False)
class OrderTask:
    """What is to be ordered, and for which cell.

    Attributes:
        product: With the sub-assemblies that an order names among its groups.
        asked: The order that was asked for, or that the product states; None for the best one.
        items: Of the product, without those sub-assemblies.
        advised: Whether to advise on orders even if the one that was asked for is feasible.
        setup: Of the cell.
        named: The sub-assemblies.
    """

    product: Product
    asked: tuple[str, ...] | None
    items: tuple[str, ...]
    advised: bool
    setup: FixtureSetup
    named: tuple[Built, ...]

    def ordered(self, matrices: AssemblyMatrices) -> Ordered:
        """Follow the order that was asked for, or find the best one."""
        unplanned = _unplanned(self.product, self.asked or self.items, matrices)
        left_out = {item.name for item in unplanned}
        items = tuple(name for name in self.items if name not in left_out)
        search = OrderSearch(self.product, matrices, self.setup, self.named)
        if self.asked is None:
            result = search.free(items)
        else:
            asked = tuple(name for name in self.asked if name not in left_out)
            result = search.given(asked, items if self.advised else ())
        return Ordered(matrices, search, unplanned, result)

    def with_play(self, found: Ordered) -> Ordered:
        """Count larger and larger gaps as contact, as far as plausible, until there is an order.

        A pin may join two parts that have play between them: they touch each other only through it.
        """
        now = found
        while now.lacks_contact:
            looser = looser_contact(now.matrices)
            if looser is None:
                return found
            now = self.ordered(looser)
        return now


def _unplanned(
    product: Product, names: tuple[str, ...], matrices: AssemblyMatrices
) -> tuple[Unplanned, ...]:
    """Return the items that cannot be planned: they overlap others, or touch none of the rest."""
    item_of = {part: name for name in names for part in product.members(name)}
    mass = {name: sum(product.parts[p].mass for p in product.members(name)) for name in names}
    errors = [(one.part, one.other, one.depth) for one in matrices.errors]
    overlapping = overlapping_items(errors, item_of, mass)
    refused = {item.name for item in overlapping}
    rest = [name for name in names if name not in refused]
    return (*overlapping, *stray_items(product, rest, matrices))
