"""``soft-jig plan``: decide what is fixed on the jig for each step of an assembly."""

from __future__ import annotations

import resource
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from cell.configuration.config import CellConfig
from cell.products.declared import declared_from
from cell.products.loading import load_product
from cell.products.product import Product
from experiments.plan.options import MATRICES, PAGE, PLAN, PlanOptions
from experiments.plan.page import write_page
from experiments.reporting.output import write_arrays
from planning.assembly_plan.explain import (
    explanation,
    overlap_text,
    step_table,
    step_texts,
    stop_text,
)
from planning.assembly_plan.plan_file import save_plan
from planning.assembly_plan.planner import FixingPlan, plan
from planning.assembly_plan.verdict import verdict_of
from planning.feasibility.bolt_remark import bolt_remarks
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.evidence_format import evidence_text
from planning.fixture_analysis.candidate import Choice, FixtureSetup
from planning.fixture_analysis.rule import choices_text, choices_to_list, general_rule
from planning.ordering.advice_format import advice_text


def run_plan(
    product: str,
    order: tuple[str, ...] | None,
    options: PlanOptions,
    explain: bool,
    out: Path,
    *,
    config: CellConfig | None = None,
    html: bool = False,
) -> int:
    """Plan a product, print the plan, and write ``plan.json`` and ``matrices.npz``.

    Args:
        product: A name in ``models/products``, or anything else that ``load_product`` reads.
        order: Parts or groups in the order of assembly, or None for the product's default.
        options: How the product is read and planned.
        explain: Whether to print matrices, reasons and candidates as well.
        out: Folder for the files; made if missing.
        config: The cell, for the search of orders and the general rule; None for the default.
        html: Whether to write ``plan.html`` as well.

    Returns:
        0 if the order is feasible, 1 if it is well formed but infeasible.

    Raises:
        InputError: The product or the order cannot be used; nothing is written.
    """
    described = described_product(product, options)
    config = config or CellConfig()
    console = Console(highlight=False)
    with console.status("Matrices, steps and orders ...") as status:

        def show(done: int, total: int) -> None:
            status.update(f"Matrices: {done} of {total} comparisons of two parts ...")

        fixing = plan(
            described,
            order,
            config=config,
            tolerance=options.tolerance,
            cache=options.cache,
            slanted=options.slanted,
            progress=show,
        )
    assert fixing.matrices is not None
    _print_plan(console, fixing, explain)
    setup, started = FixtureSetup.of(config), time.perf_counter()
    with console.status("Candidates of the general rule ..."):
        choices = tuple(
            choice
            for line in fixing.lines
            for choice in general_rule(described, line.order, line.steps, fixing.matrices, setup)
        )
    verdict = verdict_of(fixing, choices)
    seconds = {"general rule": time.perf_counter() - started}
    remarks = [remark.text() for remark in bolt_remarks(described, fixing.matrices.solids)]
    out.mkdir(parents=True, exist_ok=True)
    page = out / PAGE
    save_matrices(fixing, out / MATRICES)
    if html:
        with console.status(f"Pictures for {page.name} ..."):
            seconds[page.name] = write_page(
                page, described, fixing, choices, verdict, setup, remarks
            )
    else:
        page.unlink(missing_ok=True)  # A page of an earlier plan would not match.
    # Last: whoever finds it finds what belongs to it.
    save_plan(fixing, out / PLAN, general_rule=choices_to_list(choices))
    _print_rule(console, choices, explain, remarks)
    if fixing.orders:
        seconds = {"orders": fixing.orders.seconds} | seconds
    further = ", ".join(f"{name} {value:.2f} s" for name, value in seconds.items())
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # Linux states it in kB.
    timing = f"Planned in {fixing.seconds:.2f} s; {further}; at most {most:.0f} MB of memory."
    _print_lines(console, [timing, f"Verdict: {verdict.text}."])
    return 0 if fixing.feasible else 1


def described_product(product: str, options: PlanOptions) -> Product:
    """Return a product as it is read, with what the options say about it.

    Args:
        product: A name in ``models/products``, or anything else that ``load_product`` reads.
        options: How it is read, which way is up, what is declared.
    """
    described = load_product(product, options.read)
    declared = declared_from(
        described,
        accept=options.accept,
        press=options.press,
        snap=options.snap,
        flexible=options.flexible,
    )
    return replace(described, declared=declared, up=options.up or described.up)


def save_matrices(fixing: FixingPlan, file: Path) -> None:
    """Write C (n, n), M and W (6, n, n), and the names of their rows and layers."""
    arrays = {
        "parts": np.array(fixing.parts),
        "directions": np.array(DIRECTIONS),
        "contact": fixing.contact,
        "free": np.stack([fixing.free[j] for j in DIRECTIONS]),
        "reachable": np.stack([fixing.reachable[j] for j in DIRECTIONS]),
    }
    write_arrays(file, arrays)


def _print_plan(console: Console, fixing: FixingPlan, explain: bool) -> None:
    for line in fixing.lines:
        console.print(step_table(line))
        _print_lines(console, [] if explain else step_texts(line))
    lines = [explanation(fixing)] if explain else []
    lines += [text for text in [stop_text(fixing)] if text]
    lines += [overlap_text(fixing)] if fixing.overlaps else []
    lines += [advice_text(fixing.orders)] if fixing.orders else []
    lines += [evidence_text(fixing.evidence)] if fixing.evidence else []
    _print_lines(console, lines)


def _print_rule(
    console: Console, choices: tuple[Choice, ...], explain: bool, remarks: list[str]
) -> None:
    if explain and choices:
        lines = ["Candidates, by the general rule:\n" + choices_text(choices)]
    else:
        lines = [f"{choice.item}: {choice.verdict}" for choice in choices if not choice.agrees]
    _print_lines(console, lines + remarks)


def _print_lines(console: Console, lines: list[str]) -> None:
    for line in lines:
        console.print(line, markup=False, soft_wrap=True)
