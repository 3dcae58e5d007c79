"""Checks of a product before planning: its parts must not share volume.

Solid parts cannot overlap, so an overlap is a modelling error: except in a thread, which CAD often
draws with the hole at the tap drill's diameter and the bolt at the nominal one. For a declared
fastener that overlap is cut out of the threaded part, so that the bolt touches it line to line and
can leave along its axis.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

from cell.errors import CellError
from cell.product import Product
from planning.fixing.solids import Solid, boxes_apart

THREAD_HEIGHT_PER_PITCH = 0.5413  # [S] ISO 68-1: 5/8 H = 0.5413 P from major to minor diameter.


def overlap_depth(a: Solid, b: Solid) -> float:
    """Return how thick the thickest piece of common volume is [m].

    Thickness is taken as 2 V / A: exact for a thin layer, which is what matters near the tolerance,
    and of the right size (2/3 of the radius for a ball) for a gross overlap.
    """
    if boxes_apart(a, b, 0.0):
        return 0.0
    pieces = (a.manifold ^ b.manifold).decompose()
    return max((2.0 * p.volume() / p.surface_area() for p in pieces if p.volume() > 0.0), default=0)


def without_overlaps(product: Product, solids: Mapping[str, Solid]) -> dict[str, Solid]:
    """Return the solids with each declared bolt's thread cut out of the part it is driven into.

    Raises:
        CellError: Two parts share a layer thicker than the contact tolerance, and it is no thread.
    """
    fitted = dict(solids)
    for a, b in combinations(solids, 2):
        depth = overlap_depth(solids[a], solids[b])
        if depth <= product.contact_tolerance:
            continue
        bolt, nut = (a, b) if a in product.fasteners else (b, a)
        if depth > _thread_height(product, bolt, nut) + product.contact_tolerance:
            raise CellError(
                f"Parts '{a}' and '{b}' overlap by {1e3 * depth:.3g} mm, more than the "
                f"contact tolerance of {1e3 * product.contact_tolerance:.3g} mm: correct their "
                "poses or shapes, declare a fastener if it is a thread, or raise the tolerance."
            )
        fitted[nut] = fitted[nut].without(solids[bolt])
    return fitted


def _thread_height(product: Product, bolt: str, nut: str) -> float:
    """Return how deep a bolt's thread reaches into a part [m]; 0 if it is not driven into it."""
    fastener = product.fasteners.get(bolt)
    if fastener is None or fastener.into != nut:
        return 0.0
    return THREAD_HEIGHT_PER_PITCH * fastener.pitch
