"""``soft-jig plan``: decide what is fixed on the jig for each step of an assembly."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from rich.console import Console

from cell.config import CellConfig
from cell.loading import load_product
from experiments.output import write_arrays
from experiments.plan_page.page import write_page
from planning.fixing.directions import DIRECTIONS
from planning.fixing.explain import explanation, step_table, step_text, stop_text
from planning.fixing.plan_file import save_plan
from planning.fixing.planner import FixingPlan, plan
from planning.fixing.remark import bolt_remarks
from planning.holding.candidate import Choice, Setup
from planning.holding.choice_file import choices_text, choices_to_list
from planning.holding.rule import general_rule
from planning.ordering.explain import advice_text

MIN_WIDTH = 100  # Characters: the step table with names of ordinary length, also into a file.


def run_plan(
    product: str,
    order: tuple[str, ...] | None,
    units: str | None,
    explain: bool,
    out: Path,
    *,
    config: CellConfig | None = None,
    html: bool = False,
) -> int:
    """Plan a product, print the plan, and write ``plan.json`` and ``matrices.npz``.

    Args:
        product: A name in ``models/products``, or what else ``load_product`` reads.
        order: Parts or groups in the order of assembly, or None for the product's default.
        units: Length unit of meshes that state none.
        explain: Whether to print matrices, reasons, candidates and evidence as well.
        out: Folder for the files; made if missing.
        config: The cell that the general rule reckons with; None for the default.
        html: Whether to write ``plan.html``, too.

    Returns:
        0 if the order is feasible, 1 if it is well formed but infeasible.

    Raises:
        CellError: The product or the order cannot be used; nothing is written.
    """
    described = load_product(product, units=units)
    fixing = plan(described, order)
    setup = Setup.of(config or CellConfig())
    started = time.perf_counter()
    choices = general_rule(described, fixing, setup)
    seconds = {"general rule": time.perf_counter() - started}
    if fixing.orders:
        seconds["orders"] = fixing.orders.seconds
    out.mkdir(parents=True, exist_ok=True)
    (out / "plan.html").unlink(missing_ok=True)  # An earlier plan's page is not this one's.
    save_plan(fixing, out / "plan.json", general_rule=choices_to_list(choices))
    save_matrices(fixing, out / "matrices.npz")
    assert fixing.geometry is not None
    notes = [remark.text() for remark in bolt_remarks(described, fixing.geometry)]
    if html:
        page = out / "plan.html"
        seconds["plan.html"] = write_page(page, described, fixing, choices, setup, notes)
    _print(fixing, choices, explain, notes, seconds)
    return 0 if fixing.feasible else 1


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


def _print(
    fixing: FixingPlan,
    choices: tuple[Choice, ...],
    explain: bool,
    notes: list[str],
    seconds: dict[str, float],
) -> None:
    console = Console(highlight=False)
    console.width = max(console.width, MIN_WIDTH)
    console.print(step_table(fixing))
    lines = [explanation(fixing)] if explain else [step_text(step) for step in fixing.steps]
    lines += [stop_text(fixing.stop)] if fixing.stop else []
    lines += [advice_text(fixing.orders)] if fixing.orders else []
    if explain and choices:
        lines += ["Candidates, by the general rule:\n" + choices_text(choices)]
    else:
        lines += [f"{c.item}: {c.verdict}" for c in choices if not c.agrees]
    lines += notes
    apart = ", ".join(f"{name} {time:.2f} s" for name, time in seconds.items())
    for line in [*lines, f"Planned in {fixing.seconds:.2f} s; {apart}."]:
        console.print(line, markup=False, soft_wrap=True)
