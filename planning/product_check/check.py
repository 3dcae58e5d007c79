"""Everything that is checked of a product before it is run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cell.configuration.config import CellConfig
from cell.machines.arm import Unreachable
from cell.products.product import Product
from cell.simulation.simulation import Simulation
from planning.assembly_plan.explain import stop_text
from planning.assembly_plan.planner import FixingPlan
from planning.fixture_analysis.candidate import FixtureSetup
from planning.fixture_analysis.rule import general_rule
from planning.motion.paths import NoPath
from planning.operations.operation import NoOperation, Step
from planning.operations.sequence import steps
from planning.operations.station import Station
from planning.product_check.finding import Finding, Level, doubtful, fails, good
from planning.product_check.machine_limits import machine_findings
from planning.product_check.standing_clear import clearance_findings


def plan_findings(product: Product, fixing: FixingPlan) -> tuple[list[Finding], list[Step]]:
    """Return findings on a plan, and the steps that carry it out; none if it cannot be."""
    if fixing.stop is not None or fixing.unplanned:
        reasons = [f"{item.name} {item.reason}" for item in fixing.unplanned]
        reasons += [stop_text(fixing)] if fixing.stop else []
        return [fails("order", "; ".join(reasons))], []
    try:
        todo = steps(product, fixing)
    except NoOperation as error:
        return [fails("order", str(error))], []
    names = ", ".join(step.name for step in todo)
    return [good("order", f"every step has an operation: {names}")], todo


def fixture_findings(product: Product, fixing: FixingPlan, config: CellConfig) -> Iterator[Finding]:
    """Yield what speaks against the postures of a plan: footprint, imprint, stability."""
    if fixing.stop is not None or fixing.unplanned or fixing.matrices is None:
        return
    setup = FixtureSetup.of(config)
    said: set[str] = set()
    for choice, step in zip(
        general_rule(product, fixing.order, fixing.steps, fixing.matrices, setup),
        fixing.steps,
        strict=True,
    ):
        rejected = choice.candidates[choice.paper].rejected
        if rejected and rejected not in said:
            said.add(rejected)
            yield doubtful(step.fixed_part, f"on the jig while {step.item} is added: {rejected}")
    if not said:
        yield good(fixing.steps[0].fixed_part, "the bag holds it, by size, depth and stability")


def reach_findings(station: Station, todo: Sequence[Step]) -> Iterator[Finding]:
    """Yield a finding per step: whether the arms reach every pose that it plans.

    Each step is taken to succeed, so that the next one is seen as it will be.
    """
    station.look()
    for step in todo:
        try:
            remarks = step.operation.foresee(station, step)
        except (Unreachable, NoPath) as error:
            yield fails(step.name, str(error))
            return  # What comes later depends on it.
        station.fixed = step.fixed_after(station.cell.product, station.fixed)
        if step.operation.role is not None and not remarks:
            yield good(step.name, "every pose is reached")
        yield from (doubtful(step.name, remark) for remark in remarks)


def simulated_findings(
    simulation: Simulation, station: Station, todo: Sequence[Step]
) -> list[Finding]:
    """Return what needs the cell: what stands in it, and reach."""
    found = list(clearance_findings(simulation.cell, simulation.root))
    if any(finding.level is Level.FAILS for finding in found):
        return found
    return [*found, *reach_findings(station, todo)]


__all__ = ["fixture_findings", "machine_findings", "plan_findings", "simulated_findings"]
