"""Items that are left out of an order, with the reason: the rest is planned without them.

Parts that touch nothing, or only each other, cannot be added to anything, and a part whose overlap
with another nobody declared has no assembled place. Neither is a reason to tell nothing about the
others. The largest island of items connected by contacts is planned.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from cell.products.product import Product
from planning.feasibility.contact import surface_gap
from planning.feasibility.matrices import AssemblyMatrices
from planning.feasibility.solids import Solid


@dataclass(frozen=True)
class Unplanned:
    """An item that is in the product but not in the order.

    Attributes:
        name: Of the item: a part or a group.
        reason: Why, in words that follow the name.
    """

    name: str
    reason: str


def stray_items(
    product: Product, names: Sequence[str], matrices: AssemblyMatrices
) -> tuple[Unplanned, ...]:
    """Return the items outside the largest island; none if that island is a single item.

    Args:
        product: For its groups.
        names: Items that are to be planned.
        matrices: Of all parts.
    """
    parts = [matrices.indices(product.members(name)) for name in names]
    member = np.zeros((len(names), len(matrices.solids)))
    for item, own in enumerate(parts):
        member[item, own] = 1.0
    touching = matrices.contact + matrices.contact.T + np.eye(len(matrices.contact))
    count, labels = connected_components(member @ touching @ member.T > 0.0, directed=False)
    if count <= 1:
        return ()
    islands = [np.flatnonzero(labels == label).tolist() for label in range(count)]
    solids = list(matrices.solids.values())
    mass = [sum(solids[p].mass for i in island for p in parts[i]) for island in islands]
    largest = max(range(count), key=lambda n: (len(islands[n]), mass[n]))
    if len(islands[largest]) == 1:
        return ()
    rest = [solids[p] for i in islands[largest] for p in parts[i]]
    wanted = {p for own in parts for p in own}
    found = {}
    for island in (island for n, island in enumerate(islands) if n != largest):
        for i in island:
            others = [names[k] for k in island if k != i]
            beside = np.flatnonzero(touching[parts[i]].any(axis=0))
            others += [solids[p].name for p in beside if p not in wanted]
            own = [solids[p] for p in parts[i]]
            found[i] = Unplanned(names[i], _stray_reason(others, *nearest(own, rest)))
    return tuple(found[i] for i in sorted(found))


def _stray_reason(others: Sequence[str], neighbour: str, gap: float) -> str:
    away = f"{neighbour}, {1e3 * gap:.3g} mm away"
    if others:
        return f"touches {', '.join(others)} only, not the rest; nearest of that is {away}"
    return f"touches no part; nearest is {away}"


def nearest(own: Sequence[Solid], others: Sequence[Solid]) -> tuple[str, float]:
    """Return the name of the nearest of other parts, and its distance [m]."""
    pairs = [(_box_gap(a, b), n, a, b) for n, b in enumerate(others) for a in own]
    best, name = np.inf, ""
    for bound, _, a, b in sorted(pairs, key=lambda pair: pair[:2]):
        if bound >= best:
            break
        gap = surface_gap(a, b)
        if gap < best:
            best, name = gap, b.name
    return name, best


def _box_gap(a: Solid, b: Solid) -> float:
    """Return the distance between two bounding boxes [m], at most that of the parts."""
    apart = np.maximum(np.maximum(a.lower - b.upper, b.lower - a.upper), 0.0)
    return float(np.linalg.norm(apart))


def overlapping_items(
    overlaps: Iterable[tuple[str, str, float]],
    item_of: Mapping[str, str],
    mass: Mapping[str, float],
) -> tuple[Unplanned, ...]:
    """Return the fewest items, nearly, without which no undeclared overlap is left.

    Args:
        overlaps: Names of two parts and the depth of their overlap [m], for each undeclared one.
        item_of: Item of each part.
        mass: Of each item [kg]; of two that overlap with as many others, the lighter is left out.
    """
    waiting = [(item_of[a], item_of[b], depth) for a, b, depth in overlaps]
    waiting = [entry for entry in waiting if entry[0] != entry[1]]
    found = []
    while waiting:
        names = [name for a, b, _ in waiting for name in (a, b)]
        chosen = min(dict.fromkeys(names), key=lambda name: (-names.count(name), mass[name]))
        own = [entry for entry in waiting if chosen in entry[:2]]
        listed = ", ".join(
            f"{b if a == chosen else a} by {1e3 * depth:.3g} mm" for a, b, depth in own
        )
        found.append(Unplanned(chosen, f"overlaps {listed}, which is not declared"))
        waiting = [entry for entry in waiting if chosen not in entry[:2]]
    return tuple(found)
