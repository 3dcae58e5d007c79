"""``soft-jig plan``: decide what is fixed on the jig for each step of an assembly."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from cell.loading import load_product
from experiments.plan_options import PlanOptions
from planning.fixing.evidence import evidence_text
from planning.fixing.explain import explanation, step_table, step_text, stop_text
from planning.fixing.plan_file import save_plan
from planning.fixing.planner import FixingPlan, plan

MIN_WIDTH = 100  # Characters: the step table with names of ordinary length, also into a file.


def run_plan(
    product: str,
    order: tuple[str, ...] | None,
    options: PlanOptions,
    explain: bool,
    out: Path,
) -> int:
    """Plan a product, print the plan, and write ``plan.json``.

    Args:
        product: A name in ``models/products``, or what else ``load_product`` reads.
        order: Parts or groups in the order of assembly, or None for the product's default.
        options: How the product is read and planned.
        explain: Whether to print matrices, reasons and evidence as well.
        out: Folder for ``plan.json``; made if missing.

    Returns:
        0 if the order is feasible, 1 if it is well formed but infeasible.

    Raises:
        CellError: The product or the order cannot be used; nothing is written.
    """
    described = load_product(
        product, options.units, densities=options.densities, group=options.group
    )
    fixing = plan(
        described,
        order,
        tolerance=options.tolerance,
        cache=options.cache,
        slanted=options.slanted,
    )
    out.mkdir(parents=True, exist_ok=True)
    save_plan(fixing, out / "plan.json")
    _print(fixing, explain)
    return 0 if fixing.feasible else 1


def _print(fixing: FixingPlan, explain: bool) -> None:
    console = Console(highlight=False)
    console.width = max(console.width, MIN_WIDTH)
    console.print(step_table(fixing))
    lines = [explanation(fixing)] if explain else [step_text(step) for step in fixing.steps]
    lines += [stop_text(fixing.stop)] if fixing.stop else []
    lines += [evidence_text(fixing.evidence)] if fixing.evidence else []
    for line in [*lines, f"Planned in {fixing.seconds:.2f} s."]:
        console.print(line, markup=False, soft_wrap=True)
