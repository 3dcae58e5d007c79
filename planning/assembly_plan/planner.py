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
from planning.assembly_plan.order_search import (
    AssemblyLine,
    named_subassemblies,
)
from planning.assembly_plan.ordered import OrderTask
from planning.feasibility.algorithm import FixingStep, Stop
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
from planning.feasibility.overlaps import Overlap
from planning.feasibility.pose_doubt import pose_doubt
from planning.feasibility.slanted import Slanted
from planning.fixture_analysis.candidate import FixtureSetup
from planning.ordering.advice import OrderAdvice, with_groups
from planning.ordering.unplanned import Unplanned


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
        slanted: Slanted directions that the plan uses or may use, two per axis; none where the six
            suffice.
        subassemblies: What the order contains as one item because single items lock each other;
            each after those it is built of.
        unplanned: Items that are not in the order, with the reasons: strays, for example.
        likely_cause: What is probably wrong with the input of a plan that fails; "" if unknown.
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
    slanted: tuple[Slanted, ...] = ()
    subassemblies: tuple[AssemblyLine, ...] = ()
    unplanned: tuple[Unplanned, ...] = ()
    likely_cause: str = ""

    @property
    def feasible(self) -> bool:
        """Whether every item of the product can be added, and no overlap is unexplained."""
        return self.stop is None and not self.unplanned and not self.overlaps

    @property
    def lines(self) -> tuple[AssemblyLine, ...]:
        """The sub-assemblies in the order in which they are built, then the product itself."""
        own = AssemblyLine(self.product, self.parts, self.order, self.steps)
        return (*self.subassemblies, own)

    @property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Overlaps that nothing explains, deepest first."""
        found = self.evidence.overlaps if self.evidence else ()
        return tuple(one for one in found if not one.kind)


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
        slanted: Whether to report, for each step, all slanted removal directions and local freedom.
            Slanted directions that a plan needs are found and used without it.
        progress: Is told how many comparisons of two parts have been made, of how many.

    Raises:
        UnknownName, BadOrder: The order does not list the product's parts once each.
        InputError: The product cannot be used.

    An order that is well formed but infeasible is a result, not an error: see ``FixingPlan.stop``.
    """
    started = time.perf_counter()
    groups = named_subassemblies(product, order or ())
    whole = with_groups(product, groups)
    _validate(whole, order)
    setup = FixtureSetup.of(config or CellConfig())
    if cache is None:
        matrices = matrices_of(product, tolerance, progress=progress)
    else:
        matrices = cached_matrices(product, tolerance, cache, progress)
    asked = order or (product.orders[0] if product.orders else None)
    task = OrderTask(whole, asked, product.items(), order is None, setup, groups)
    ordered = task.ordered(matrices)
    if tolerance is None and product.contact_tolerance is None:
        ordered = task.with_play(ordered)
    matrices, search, unplanned = ordered.matrices, ordered.search, ordered.unplanned
    chosen, steps, stop = ordered.result
    contact, leaving = matrices.contact, matrices.interference
    stages = (*(step for built in search.built for step in built.steps), *steps, stop)
    cause = ""
    if stop is not None or unplanned:
        errors = [(one.part, one.other) for one in matrices.errors]
        cause = pose_doubt(list(matrices.solids.values()), contact, errors)
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
        seconds=time.perf_counter() - started - (search.advice.seconds if search.advice else 0.0),
        evidence=evidence_of(
            product, matrices, [stage for stage in stages if stage], slanted=slanted
        ),
        orders=search.advice,
        matrices=matrices,
        slanted=search.ways.slanted,
        subassemblies=tuple(search.built),
        unplanned=unplanned,
        likely_cause=cause,
    )


def _validate(product: Product, order: tuple[str, ...] | None) -> None:
    if not product.parts:
        raise InputError(f"Product '{product.name}' has no parts.")
    if product.up not in DIRECTIONS:
        raise UnknownName("up axis", product.up, DIRECTIONS)
    if order is None:
        order = product.orders[0] if product.orders else product.items()
    check_order(product, order)
