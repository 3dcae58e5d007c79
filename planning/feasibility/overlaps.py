"""Common volume of parts: threads, what the user declared, and errors of the CAD.

Rigid parts cannot overlap, but CAD draws some that do. A thread often comes as a hole at the tap
drill's diameter with a bolt at the nominal one: a product declares it, or it is recognised in the
meshes (``cad_threads``). A press fit, or an overlap to be ignored, is declared by the user. In
these cases, and where two curved surfaces overlap by no more than their facets are coarse, the
common volume is cut out of one of the two (``fitting``), so that they touch line to line, before it
is decided how they come apart. Any other overlap deeper than the tolerance is an error of poses or
shapes; all of them are reported, and a plan with one of them is not feasible.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from cell.products.product import Product
from planning.feasibility.cad_threads import (
    THREAD_HEIGHT_PER_PITCH,
    CadThread,
    find_press_fit,
    find_thread,
)
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.facets import sagitta
from planning.feasibility.helical_threads import find_helical_thread
from planning.feasibility.interference import interference
from planning.feasibility.overlap_depth import overlap_of
from planning.feasibility.solids import Solid
from planning.feasibility.tolerance import Tolerances

# [M] Of two parts; above it their common volume, half a second for two long helices, takes longer
# than to look for a helical thread in sections.
MANY_FACES = 100_000


@dataclass(frozen=True)
class Overlap:
    """Two parts that share more volume than the tolerance allows, other than in a thread.

    Attributes:
        part: Name of one part.
        other: Name of the other one.
        depth: Where it is deepest [m]: see ``overlap_depth``.
        p_AoD: That place in A [m].
        volume: Common volume [m3].
        kind: "press" or "accept", as the user declared it; "facets" if it is no deeper than the
            facets of the two are coarse; "" if it is an error.
        press_fit: Whether it has the shape of a pin with interference in its hole.
    """

    part: str
    other: str
    depth: float
    p_AoD: tuple[float, float, float]
    volume: float
    kind: str = ""
    press_fit: bool = False


@dataclass(frozen=True)
class Overlaps:
    """Every overlap of a product, by what it is.

    Attributes:
        threads: Recognised in the meshes.
        screws: (bolt, nut) of the declared screws whose thread is drawn as an overlap.
        others: Declared ones, coarse facets, and errors.
    """

    threads: tuple[CadThread, ...] = ()
    screws: tuple[tuple[str, str], ...] = ()
    others: tuple[Overlap, ...] = ()


def find_overlaps(
    product: Product,
    solids: Mapping[str, Solid],
    tolerances: Tolerances,
    suspects: Iterable[tuple[str, str]],
) -> Overlaps:
    """Return the overlaps among pairs of parts that may have one.

    Args:
        product: For its screws and for what was declared.
        solids: Parts by name.
        tolerances: Of the product.
        suspects: The pairs. Two parts of which one can leave the other along some direction do not
            overlap.
    """
    threads: list[CadThread] = []
    screws: list[tuple[str, str]] = []
    others: list[Overlap] = []
    for a, b in suspects:
        tolerance = tolerances.overlap_of(a, b)
        declared = product.declared.overlap_kind(a, b)
        pair = solids[a], solids[b]
        thread = None
        if not declared:
            finders = [find_thread, find_helical_thread]
            if sum(len(solid.faces) for solid in pair) > MANY_FACES:
                finders.reverse()  # No pair is a thread of both kinds: only the time differs.
            thread = next(filter(None, (find(*pair, tolerance) for find in finders)), None)
        if thread:
            threads.append(thread)
            continue
        found = overlap_of(*pair)
        if found.depth <= tolerance:
            continue
        screw = _declared_screw(product, a, b, found.depth, tolerance)
        if screw:
            screws.append(screw)
            continue
        kind = declared or ("accept" if product.declared.accept_all else "")
        if not declared and found.depth <= _coarseness(*pair, found.depth):
            kind = "facets"
        press_fit = find_press_fit(*pair, tolerance) is not None
        others.append(Overlap(a, b, found.depth, found.p_AoD, found.volume, kind, press_fit))
    return Overlaps(tuple(threads), tuple(screws), tuple(others))


def _declared_screw(
    product: Product, a: str, b: str, depth: float, tolerance: float
) -> tuple[str, str] | None:
    """Return (bolt, nut) if the product says that one of two parts is driven into the other."""
    for bolt, nut in ((a, b), (b, a)):
        screw = product.screws.get(bolt)
        if screw is not None and screw.into == nut:
            deepest = THREAD_HEIGHT_PER_PITCH * screw.pitch + tolerance
            return (bolt, nut) if depth <= deepest else None
    return None


def _coarseness(a: Solid, b: Solid, depth: float) -> float:
    """Return how far the facets of two parts may overlap where they fit line to line [m]."""
    low = np.maximum(a.lower, b.lower) - depth
    high = np.minimum(a.upper, b.upper) + depth
    return sagitta(a, low, high) + sagitta(b, low, high)


def fitted_pair(part: Solid, other: Solid, tolerance: float) -> tuple[Solid, Solid]:
    """Return two overlapping parts with their common volume cut out of one of them.

    It is cut out of the one that then holds the other more tightly, as a hole holds a pin, but
    does not lock it in; if that does not tell them apart, out of the larger one.

    Args:
        part: One part.
        other: The other one.
        tolerance: Largest overlap that does not block [m].
    """
    choices = []
    for cut, pair in (
        (part, (part.without(other), other)),
        (other, (part, other.without(part))),
    ):
        if any(len(solid.faces) == 0 for solid in pair):  # It lay within the other altogether.
            continue
        free = interference(pair, tolerance).free
        ways = sum(int(free[j][0, 1]) for j in DIRECTIONS)
        choices.append((ways or len(DIRECTIONS), -cut.manifold.volume(), pair))
    return min(choices, key=lambda one: one[:2])[2] if choices else (part, other)
