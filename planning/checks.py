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
from planning.solids import Solid, boxes_apart

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


def cut_threads(product: Product, solids: Mapping[str, Solid]) -> dict[str, Solid]:
    """Return the solids with each declared bolt's thread cut out of the part it is driven into."""
    cut = dict(solids)
    for fastener in product.fasteners.values():
        bolt, nut = cut[fastener.part], cut[fastener.into]
        depth = overlap_depth(bolt, nut)
        thread_height = THREAD_HEIGHT_PER_PITCH * fastener.pitch
        if product.contact_tolerance < depth <= thread_height + product.contact_tolerance:
            cut[fastener.into] = nut.without(bolt)
    return cut


def check_overlaps(product: Product, solids: Mapping[str, Solid]) -> None:
    """Refuse two parts that share a layer thicker than the contact tolerance."""
    for a, b in combinations(solids.values(), 2):
        depth = overlap_depth(a, b)
        if depth > product.contact_tolerance:
            raise CellError(
                f"Parts '{a.name}' and '{b.name}' overlap by {1e3 * depth:.3g} mm, more than the "
                f"contact tolerance of {1e3 * product.contact_tolerance:.3g} mm: correct their "
                "poses or shapes, declare a fastener if it is a thread, or raise the tolerance."
            )
