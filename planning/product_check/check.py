"""Everything that is checked of a product before it is run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cell.configuration.config import CellConfig
from cell.fixtures.soft_jig.bed_pieces import bed_pieces
from cell.machines.arm import Unreachable
from cell.products.product import Product
from cell.simulation.simulation import Simulation
from planning.assembly_plan.explain import stop_text
from planning.assembly_plan.planner import FixingPlan
from planning.fixture_analysis.candidate import Choice, FixtureSetup
from planning.fixture_analysis.rule import general_rule
from planning.motion.paths import NoPath
from planning.operations.operation import NoOperation, Step
from planning.operations.sequence import steps
from planning.operations.station import Station
from planning.product_check.drawn_support import support_findings
from planning.product_check.finding import Finding, Level, doubtful, fails, good
from planning.product_check.machine_limits import machine_findings
from planning.product_check.standing_clear import clearance_findings
from planning.product_draft.unknown_screws import unknown_screws


def plan_findings(product: Product, fixing: FixingPlan) -> tuple[list[Finding], list[Step]]:
    """Return findings on a plan, and the steps that carry it out; none if it cannot be."""
    unknown = [fails(n, text) for n, text in unknown_screws(fixing, product.screws).items()]
    if fixing.stop is not None or fixing.unplanned:
        reasons = [f"{item.name} {item.reason}" for item in fixing.unplanned]
        reasons += [stop_text(fixing)] if fixing.stop else []
        return [*unknown, fails("order", "; ".join(reasons))], []
    try:
        todo = steps(product, fixing)
    except NoOperation as error:
        return [*unknown, fails("order", str(error))], []
    if unknown:
        return unknown, []
    names = ", ".join(step.name for step in todo)
    found = [good("order", f"every step has an operation: {names}")]
    fixed = {step.fixed_part for step in fixing.steps}
    return [*found, *support_findings(product, fixing.order, fixed)], todo


def fixture_choices(product: Product, fixing: FixingPlan, config: CellConfig) -> tuple[Choice, ...]:
    """Return what the general rule says of the steps of a plan; nothing if it cannot be done."""
    if fixing.stop is not None or fixing.unplanned or fixing.matrices is None:
        return ()
    setup = FixtureSetup.of(config)
    return general_rule(product, fixing.order, fixing.steps, fixing.matrices, setup)


def fixture_findings(fixing: FixingPlan, choices: Sequence[Choice]) -> Iterator[Finding]:
    """Yield what speaks against the postures of a plan: footprint, imprint, stability."""
    said: set[str] = set()
    for choice, step in zip(choices, fixing.steps, strict=bool(choices)):
        rejected = choice.candidates[choice.paper].rejected
        if rejected and rejected not in said:
            said.add(rejected)
            yield doubtful(step.fixed_part, f"on the jig while {step.item} is added: {rejected}")
    if choices and not said:
        yield good(fixing.steps[0].fixed_part, "the bag holds it, by size, depth and stability")


def bed_findings(product: Product, fixing: FixingPlan, config: CellConfig) -> Iterator[Finding]:
    """Yield the fixed parts of a plan of whose contact models nothing touches the jig's bed."""
    if config.workcell.fixture != "soft_jig":
        return
    for name in dict.fromkeys(step.fixed_part for step in fixing.steps):
        part, membrane = product.parts[name], config.jig.jammed.friction
        if part.model is not None and not bed_pieces(part.model, part.mesh, membrane).own:
            text = "the jig cannot hold it: no piece of its contact model is named bed_..."
            yield fails(name, f"{text}; a shaft that another part comes over is none")


def borne_torques(fixing: FixingPlan, choices: Sequence[Choice]) -> dict[str, float]:
    """Return, by name of a screw, the torque about the vertical that the jig alone bears [N m]."""
    borne: dict[str, float] = {}
    for choice, step in zip(choices, fixing.steps, strict=bool(choices)):
        figures = choice.candidates[choice.paper].figures
        if "bears_turning_N_m" in figures:
            borne |= dict.fromkeys(step.incoming, figures["bears_turning_N_m"])
    return borne


def press_findings(fixing: FixingPlan, choices: Sequence[Choice]) -> Iterator[Finding]:
    """Yield a finding per part that is pressed in: whether what is on the fixture bears that."""
    for choice, step in zip(choices, fixing.steps, strict=bool(choices)):
        figures = choice.candidates[choice.paper].figures
        if "bears_down_N" in figures:
            down, bears = figures["pressed_down_N"], figures["bears_down_N"]
            text = f"pressed down with {down:.0f} N, of {bears:.0f} N that the fixture bears"
            yield (good if down <= bears else fails)(step.fixed_part, text)


def reach_findings(
    station: Station, todo: Sequence[Step], borne: Mapping[str, float] | None = None
) -> Iterator[Finding]:
    """Yield a finding per step: whether the arms reach every pose that it plans.

    Each step is taken to succeed, so that the next one is seen as it will be.

    Args:
        station: Of a cell in which nothing has happened yet; it is used up.
        todo: The steps of the plan.
        borne: See `borne_torques`: what no hand holds against has to be borne by the jig.
    """
    borne, screws = borne or {}, station.cell.product.screws
    station.look()
    for step in todo:
        try:
            remarks = step.operation.foresee(station, step)
        except (Unreachable, NoPath, NoOperation) as error:
            yield fails(step.name, str(error))
            return  # What comes later depends on it.
        station.fixed = step.fixed_after(station.cell.product, station.fixed)
        if step.operation.role is not None and not remarks:
            yield good(step.name, "every pose is reached")
        for remark in remarks:
            weak = [n for n in step.parts if borne.get(n, np.inf) < screws[n].torque]
            if weak:
                asked = max(screws[name].torque for name in weak)
                bears = f"{borne[weak[0]]:.2g} of {asked:.2g} N m"
                yield fails(step.name, f"{remark}, {bears}; init --torque asks for less")
            else:
                yield doubtful(step.name, remark)


def simulated_findings(
    simulation: Simulation,
    station: Station,
    todo: Sequence[Step],
    borne: Mapping[str, float] | None = None,
) -> list[Finding]:
    """Return what needs the cell: what stands in it, and reach; see `reach_findings`."""
    found = list(clearance_findings(simulation.cell, simulation.root))
    if any(finding.level is Level.FAILS for finding in found):
        return found
    return [*found, *reach_findings(station, todo, borne)]


__all__ = [
    "bed_findings",
    "borne_torques",
    "fixture_choices",
    "fixture_findings",
    "machine_findings",
    "plan_findings",
    "press_findings",
    "simulated_findings",
]
