"""From a product and an order to its fixing plan: the planner's stages in a row."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cell.errors import CellError, UnknownName
from cell.products.product import Product
from planning.feasibility.algorithm import FixingStep, Geometry, Stop, configure_fixing
from planning.feasibility.cache import cached_matrices
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.evidence import Evidence, evidence_of
from planning.feasibility.interference import Blocker
from planning.feasibility.matrices import matrices_of
from planning.feasibility.order import check_order
from planning.feasibility.reachability import reachable_matrices
from planning.ordering.advice import OrderAdvice, advise, fallback_order


@dataclass(frozen=True, eq=False)
class FixingPlan:
    """Which part the jig holds, in which posture, while each item of the order is added.

    Attributes:
        product: Name of the product.
        order: Items in the order of assembly.
        parts: Names of the n parts, in matrix order.
        contact: (n, n) int, strictly upper triangular C.
        free: Per direction the (n, n) int matrix M_j.
        reachable: Per direction the (n, n) int matrix W_j.
        blockers: Evidence for every 0 of the M_j.
        steps: One per item that comes in, up to where Algorithm 1 stopped.
        stop: Why it stopped, or None if the order is feasible.
        seconds: Time that planning took [s], without that for the orders.
        evidence: What the matrices rest on: tolerance, threads, margins, remarks on the input.
        orders: The best orders there are; None where an order was asked for and is feasible.
        geometry: What the decisions rest on; None for a plan that was read from a file.
    """

    product: str
    order: tuple[str, ...]
    parts: tuple[str, ...]
    contact: np.ndarray
    free: Mapping[str, np.ndarray]
    reachable: Mapping[str, np.ndarray]
    blockers: tuple[Blocker, ...]
    steps: tuple[FixingStep, ...]
    stop: Stop | None
    seconds: float
    evidence: Evidence | None = None
    orders: OrderAdvice | None = None
    geometry: Geometry | None = None

    @property
    def feasible(self) -> bool:
        """Whether every item of the order can be added."""
        return self.stop is None


def plan(
    product: Product,
    order: tuple[str, ...] | None = None,
    *,
    tolerance: float | None = None,
    cache: Path | None = None,
    slanted: bool = False,
) -> FixingPlan:
    """Decide what is fixed on the jig, and how, in each step of an assembly.

    Args:
        product: Parts in assembled poses.
        order: Items in the order of assembly; None for the product's default, or the best there is
            if it states none.
        tolerance: Gap that still touches, and overlap that does not block a motion [m]; None for
            the product's own, or one derived from its sizes and clearances.
        cache: Folder in which matrices are kept by content; None to compute them anew.
        slanted: Whether to look, in each step, for ways out at an angle and for local freedom; they
            are reported, the steps follow from the six directions alone.

    Raises:
        UnknownName, BadOrder: The order does not list the product's parts once each.
        CellError: Parts overlap, or the product cannot be used.

    An order that is well formed but infeasible is an answer, not an error: see ``FixingPlan.stop``.
    """
    started = time.perf_counter()
    _check(product, order)
    if cache is None:
        matrices = matrices_of(product, tolerance)
    else:
        matrices = cached_matrices(product, tolerance, cache)
    contact, leaving = matrices.contact, matrices.leaving
    geometry = Geometry(matrices.solids, contact, leaving)
    advice = advise(product, geometry) if order is None else None
    chosen = _chosen_order(product, geometry, advice) if order is None else order
    steps, stop = configure_fixing(product, chosen, geometry)
    if stop and (order is not None or product.orders):
        advice = advise(product, geometry, chosen)
    stages = (*steps, *([stop] if stop else []))
    return FixingPlan(
        product=product.name,
        order=chosen,
        parts=tuple(product.parts),
        contact=contact,
        free=leaving.free,
        reachable=reachable_matrices(contact, leaving.free),
        blockers=leaving.blockers,
        steps=steps,
        stop=stop,
        seconds=time.perf_counter() - started - (advice.seconds if advice else 0.0),
        evidence=evidence_of(product, matrices, stages, slanted=slanted),
        orders=advice,
        geometry=geometry,
    )


def _chosen_order(
    product: Product, geometry: Geometry, advice: OrderAdvice | None
) -> tuple[str, ...]:
    if product.orders:
        return product.orders[0]
    if advice and advice.ranked:
        return advice.ranked[0].order
    return fallback_order(product, geometry)


def _check(product: Product, order: tuple[str, ...] | None) -> None:
    if not product.parts:
        raise CellError(f"Product '{product.name}' has no parts.")
    if product.up not in DIRECTIONS:
        raise UnknownName("up axis", product.up, DIRECTIONS)
    if order is None:
        order = product.orders[0] if product.orders else product.items()
    check_order(product, order)
