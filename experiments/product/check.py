"""``soft-jig check``: what would fail, one line each."""

from __future__ import annotations

import time

from rich.console import Console

from cell.configuration.config import CellConfig
from cell.products.product import Product
from experiments.assembly.custom_fixture import with_fixture_for
from experiments.assembly.prepare import RunningCell
from planning.assembly_plan.planner import plan
from planning.product_check.check import (
    bed_findings,
    borne_torques,
    fixture_choices,
    fixture_findings,
    machine_findings,
    plan_findings,
    press_findings,
    simulated_findings,
)
from planning.product_check.finding import Finding, Level


def run_check(
    product: Product, order: tuple[str, ...] | None, config: CellConfig, seed: int, *, quiet: bool
) -> int:
    """Print what was found, the worst last; return 0 if nothing fails, else 1.

    Raises:
        InputError: The product cannot be simulated at all, or the order is malformed.
    """
    started = time.perf_counter()
    console = Console(quiet=quiet, highlight=False)
    found = find(product, order, config, seed)
    levels = list(Level)
    for finding in sorted(found, key=lambda finding: levels.index(finding.level)):
        console.print(str(finding), markup=False, soft_wrap=True)
    bad = sum(finding.level is Level.FAILS for finding in found)
    doubts = sum(finding.level is Level.DOUBTFUL for finding in found)
    seconds = time.perf_counter() - started
    verdict = f"{bad} would fail" if bad else "nothing would fail that can be seen without running"
    console.print(f"{product.name}: {verdict}, {doubts} doubtful; {seconds:.1f} s", markup=False)
    return 1 if bad else 0


def find(
    product: Product, order: tuple[str, ...] | None, config: CellConfig, seed: int
) -> list[Finding]:
    """Return what was found.

    Raises:
        InputError: The product cannot be simulated at all, or the order is malformed.
    """
    product.check_simulable()
    found = list(machine_findings(product, config))
    fixing = plan(product, order, config=config)
    planned, todo = plan_findings(product, fixing)
    choices = fixture_choices(product, fixing, config)
    held = bed_findings(product, fixing, config)
    found += [*held, *fixture_findings(fixing, choices), *press_findings(fixing, choices), *planned]
    running = RunningCell(product, with_fixture_for(config, product, seed, todo), seed)
    borne = borne_torques(fixing, choices)
    return [*found, *simulated_findings(running.simulation, running.station, todo, borne)]
