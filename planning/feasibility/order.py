"""Input validation of an assembly order, and the name of a sub-assembly."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from cell.errors import BadOrder
from cell.products.product import Product

MOST_NAMED = 6  # More names would obscure the sentence around them.


def subassembly_name(names: Sequence[str]) -> str:
    """Return the names of a sub-assembly's items: all, or the first and how many more."""
    if len(names) <= MOST_NAMED:
        return " + ".join(names)
    return f"{names[0]} + {len(names) - 1} others"


def check_order(product: Product, order: tuple[str, ...]) -> None:
    """Check that an order lists each part of a product exactly once.

    A group may be given by its name or by all its parts.

    Raises:
        UnknownName: The order names a part or group that does not exist.
        BadOrder: It has an empty item, repeats a part or lacks one.
    """
    if not all(order) or not order:
        raise BadOrder(f"Order '{','.join(order)}' has an empty item; write it like a,b,c.")
    listed = Counter(part for item in order for part in product.members(item))
    repeated = [part for part, count in listed.items() if count > 1]
    missing = [part for part in product.parts if part not in listed]
    if repeated or missing:
        faults = [f"repeats {', '.join(_as_items(product, repeated))}"] if repeated else []
        faults += [f"lacks {', '.join(_as_items(product, missing))}"] if missing else []
        needed = ", ".join(product.items())
        raise BadOrder(
            f"Order '{','.join(order)}' {' and '.join(faults)}. It must list once each: {needed}."
        )


def _as_items(product: Product, parts: list[str]) -> list[str]:
    """Name whole groups by the group, so that six bolts read as one item."""
    names = list(parts)
    for group, members in product.groups.items():
        if set(members) <= set(names):
            names[names.index(members[0])] = group
            names = [name for name in names if name not in members]
    return names
