"""From a product and an order to its fixing plan: all stages of the planner."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cell.configuration.config import CellConfig
from cell.errors import InputError, UnknownName
from cell.products.product import Product
from planning.feasibility.algorithm import FixingStep, Stop, configure_fixing
from planning.feasibility.cache import cached_matrices
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.evidence import Evidence, evidence_of
from planning.feasibility.interference import Blocker
from planning.feasibility.matrices import (
    AssemblyMatrices,
    Progress,
    matrices_of,
    reachable_matrices,
)
from planning.feasibility.order import check_order
from planning.fixture_analysis.candidate import FixtureSetup
from planning.ordering.advice import OrderAdvice, advise, fallback_order


@dataclass(frozen=True, eq=False)
class FixingPlan:
    """Which part the jig holds, and in which posture, while each item of the order is added.

    Attributes:
        product: Name of the product.
        order: Items in the order of assembly.
        parts: Names of the n parts, in matrix order.
        contact: (n, n) int, strictly upper triangular C.
        free: Per direction the (n, n) int matrix M_j.
        reachable: Per direction the (n, n) int matrix W_j.
        blockers: Evidence for every 0 of the M_j.
        steps: One per incoming item, up to where Algorithm 1 stopped.
        stop: Why it stopped, or None if the order is feasible.
        seconds: Computing time [s], without that for the orders.
        evidence: Basis of the matrices: tolerance, threads, margins, remarks on the input.
        orders: The best orders; None if an order was requested and is feasible.
        matrices: Matrices with the parts' geometry; None for a plan that was read from a file.
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
    matrices: AssemblyMatrices | None = None

    @property
    def feasible(self) -> bool:
        """Whether every item of the order can be added."""
        return self.stop is None


def plan(
    product: Product,
    order: tuple[str, ...] | None = None,
    *,
    config: CellConfig | None = None,
    tolerance: float | None = None,
    cache: Path | None = None,
    slanted: bool = False,
    progress: Progress = lambda done, total: None,
) -> FixingPlan:
    """Decide what is fixed on the jig, and how, in each step of an assembly.

    Args:
        product: Parts in assembled poses.
        order: Items in the order of assembly; None for the product's default, or the best one if it
            states none.
        config: The cell; its jig and press force decide which stages of an order are stable. None
            for the default cell.
        tolerance: Largest gap that counts as contact and largest overlap that does not block a
            motion [m]; None for the product's own, or one derived from its sizes and clearances.
        cache: Folder of the matrix cache; None to compute the matrices without it.
        slanted: Whether to search, in each step, for slanted removal directions and local freedom.
            They are reported; the steps follow from the six directions alone.
        progress: Is told how many comparisons of two parts have been made, of how many.

    Raises:
        UnknownName, BadOrder: The order does not list the product's parts once each.
        InputError: Parts overlap, or the product cannot be used.

    An order that is well formed but infeasible is a result, not an error: see ``FixingPlan.stop``.
    """
    started = time.perf_counter()
    _validate(product, order)
    setup = FixtureSetup.of(config or CellConfig())
    if cache is None:
        matrices = matrices_of(product, tolerance, progress=progress)
    else:
        matrices = cached_matrices(product, tolerance, cache, progress)
    contact, leaving = matrices.contact, matrices.interference
    advice = advise(product, matrices, setup) if order is None else None
    if order is not None:
        chosen = order
    elif product.orders:
        chosen = product.orders[0]
    elif advice and advice.ranked:
        chosen = advice.ranked[0].order
    else:
        chosen = fallback_order(product, matrices)
    steps, stop = configure_fixing(product, chosen, matrices)
    if stop and (order is not None or product.orders):
        advice = advise(product, matrices, setup, chosen)
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
        matrices=matrices,
    )


def _validate(product: Product, order: tuple[str, ...] | None) -> None:
    if not product.parts:
        raise InputError(f"Product '{product.name}' has no parts.")
    if product.up not in DIRECTIONS:
        raise UnknownName("up axis", product.up, DIRECTIONS)
    if order is None:
        order = product.orders[0] if product.orders else product.items()
    check_order(product, order)
