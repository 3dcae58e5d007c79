"""An assembly order: checked against the product, and what is there of it as words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from cell.errors import BadOrder
from cell.products.product import Product

MOST_NAMED = 6  # More would hide the sentence that they are in.


def together(names: Sequence[str]) -> str:
    """Return a sub-assembly as words: all of its names, or the first and how many more."""
    if len(names) <= MOST_NAMED:
        return " + ".join(names)
    return f"{names[0]} + {len(names) - 1} others"


def check_order(product: Product, order: tuple[str, ...]) -> None:
    """Refuse an order with an unknown part or group, or that does not list each part once.

    A group may be given by its name or, in its place, by all its parts.
    """
    if not all(order) or not order:
        raise BadOrder(f"Order '{','.join(order)}' has an empty item; write it like a,b,c.")
    listed = Counter(part for item in order for part in product.members(item))
    repeated = [part for part, count in listed.items() if count > 1]
    missing = [part for part in product.parts if part not in listed]
    if repeated or missing:
        raise BadOrder(_complaint(product, order, repeated, missing))


def _complaint(
    product: Product, order: tuple[str, ...], repeated: list[str], missing: list[str]
) -> str:
    faults = [f"repeats {', '.join(_as_items(product, repeated))}"] if repeated else []
    faults += [f"lacks {', '.join(_as_items(product, missing))}"] if missing else []
    needed = ", ".join(product.items())
    return f"Order '{','.join(order)}' {' and '.join(faults)}. It must list once each: {needed}."


def _as_items(product: Product, parts: list[str]) -> list[str]:
    """Name whole groups by the group, so that six bolts read as one item."""
    names = list(parts)
    for group, members in product.groups.items():
        if set(members) <= set(names):
            names[names.index(members[0])] = group
            names = [name for name in names if name not in members]
    return names
