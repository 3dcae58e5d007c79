"""Input check before planning: parts of a product must not share volume.

Solid parts cannot overlap, so an overlap is a modelling error, except in a thread: CAD often draws
the hole at the tap drill's diameter and the bolt at the nominal one. That overlap is cut out of the
part with the inner thread, so that the bolt touches it line to line and can leave along its axis. A
thread is one that the product declares, or one that is recognised in the meshes (``cad_threads``).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import combinations

from cell.errors import InputError
from cell.products.product import Product
from planning.feasibility.cad_threads import (
    THREAD_HEIGHT_PER_PITCH,
    CadThread,
    find_thread,
    thickness,
)
from planning.feasibility.solids import Solid, boxes_apart


def overlap_depth(a: Solid, b: Solid) -> float:
    """Return how thick the thickest piece of common volume is [m].

    Thickness is taken as 2 V / A: exact for a thin layer, which is what matters near the tolerance,
    and of the right order (2/3 of the radius for a ball) for a gross overlap.
    """
    if boxes_apart(a, b, 0.0):
        return 0.0
    pieces = (a.manifold ^ b.manifold).decompose()
    return max((thickness(piece) for piece in pieces if piece.volume() > 0.0), default=0.0)


def without_overlaps(
    product: Product,
    solids: Mapping[str, Solid],
    tolerance: float,
    suspects: Iterable[tuple[str, str]] | None = None,
) -> tuple[dict[str, Solid], tuple[CadThread, ...]]:
    """Return the solids with each bolt's thread cut out of the part it is driven into.

    Args:
        product: For its declared screws.
        solids: Parts by name.
        tolerance: Thickness of overlap that does not count [m].
        suspects: Pairs to check; all of them by default. Two parts of which one can leave the other
            along some direction do not overlap.

    Returns:
        The solids, and the threads that were recognised.

    Raises:
        InputError: Two parts share a layer thicker than the tolerance, and it is not a thread.
    """
    fitted = dict(solids)
    threads: list[CadThread] = []
    for a, b in combinations(solids, 2) if suspects is None else suspects:
        depth = overlap_depth(solids[a], solids[b])
        # A pair that nothing separates may be held by a thread thinner on average than it is deep.
        thread = find_thread(solids[a], solids[b], tolerance) if depth > 0.0 else None
        if depth <= tolerance and thread is None:
            continue
        recognised = (thread.bolt, thread.nut) if thread else None
        bolt_and_nut = _declared(product, a, b, depth, tolerance) or recognised
        if bolt_and_nut is None:
            raise InputError(
                f"Parts '{a}' and '{b}' overlap by about {1e3 * depth:.3g} mm, more than the "
                f"contact tolerance of {1e3 * tolerance:.3g} mm, and not as a bolt does in its "
                "thread: correct their poses or shapes, or raise the tolerance."
            )
        threads += [thread] if thread else []
        bolt, nut = bolt_and_nut
        fitted[nut] = fitted[nut].without(solids[bolt])
    return fitted, tuple(threads)


def _declared(
    product: Product, a: str, b: str, depth: float, tolerance: float
) -> tuple[str, str] | None:
    """Return (bolt, nut) if the product says that one of two parts is driven into the other."""
    for bolt, nut in ((a, b), (b, a)):
        screw = product.screws.get(bolt)
        if screw is not None and screw.into == nut:
            deepest = THREAD_HEIGHT_PER_PITCH * screw.pitch + tolerance
            return (bolt, nut) if depth <= deepest else None
    return None
