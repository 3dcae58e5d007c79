"""Repeated assembly with different seeds: success rate, and the range of every limited quantity.

    python -m experiments.repeat --seeds 10 --workers 2 --out out/repeat

The same as `soft-jig sweep assemble --seeds 10`, with a table of what was measured beside its
limits.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from cell.configuration.config import CellConfig
from cell.products.loading import load_product, require_product_file
from experiments.campaigns.command import run_sweep
from experiments.campaigns.points import trials
from experiments.campaigns.store import read_trial, trial_file
from experiments.campaigns.trial import Row
from experiments.cli.common import Common, check_counts, split_order
from experiments.cli.ending import exit_code
from experiments.reporting.output import output_folder
from planning.assembly_plan.planner import plan
from planning.operations.limits import Limit
from planning.operations.operation import NoOperation, Operation
from planning.operations.sequence import steps


@dataclass(frozen=True)
class RepeatOptions:
    """What to assemble, the number of runs, and the number of cores."""

    product: Annotated[Positional[str], arg(metavar="PRODUCT")] = "motor_unit"
    """A name in models/products, or a YAML file."""

    order: Annotated[str | None, arg(metavar="A,B,C")] = None
    """Assembly order: parts or groups, separated by commas. Default: the product's first one."""

    fixture: Annotated[str | None, arg(metavar="NAME")] = None
    """What holds the parts. Default: workcell.fixture."""

    seeds: int = 10
    """Number of runs, with consecutive seeds from --seed."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Runs at a time. What is done already is not run again."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0 if every run succeeded, 1 if one failed, 2 for bad input."""
    options = tyro.cli(
        RepeatOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("repeat", lambda: run_all(options))


def run_all(options: RepeatOptions) -> int:
    """Run what is missing of the assemblies and print the tables; return the exit code.

    Raises:
        InputError: An option is invalid.
    """
    check_counts(options, "seeds", "workers")
    common = options.common
    config = common.load_config(options.fixture)
    require_product_file(options.product)
    operations = operations_of(options, config)
    wanted = trials(
        "assemble",
        [{"order": options.order or ""}],
        product=options.product,
        config=config,
        seeds=range(common.seed, common.seed + options.seeds),
    )
    with output_folder(common.out) as out:
        code = run_sweep(wanted, out, config, options.workers, "local", common.quiet)
        rows = [read_trial(trial_file(out, trial.key)) for trial in wanted]
    console = Console(quiet=common.quiet, highlight=False)
    console.print(range_table(rows, operations))
    return code


def operations_of(options: RepeatOptions, config: CellConfig) -> Mapping[str, Operation]:
    """Return the operation of every step of the plan, by the step's name; none if there is none."""
    product = load_product(options.product)
    fixing = plan(product, split_order(options.order), config=config)
    try:
        todo = [] if fixing.stop is not None else steps(product, fixing)
    except NoOperation:
        todo = []
    return {step.name: step.operation for step in todo}


def range_of(limit: Limit, step: str, rows: Sequence[Row]) -> tuple[float, float] | None:
    """Return the extreme values of a step's quantity over all runs and parts; None if none."""
    values = [
        value
        for row in rows
        for name, value in row.measured.items()
        if name.startswith(f"{step}/") and name.rsplit("/", 1)[-1] == limit.quantity
        if value is not None
    ]
    return (min(values), max(values)) if values else None


def range_table(rows: Sequence[Row], operations: Mapping[str, Operation]) -> Table:
    """Return one line per step and limited quantity: its extremes, and the limit."""
    table = Table("step", "quantity", "smallest", "largest", "limit", title="Over all runs")
    for step, operation in operations.items():
        for limit in operation.limits:
            found = range_of(limit, step, rows)
            low, high = ("-", "-") if found is None else (f"{value:.4g}" for value in found)
            table.add_row(step, limit.quantity, low, high, f"{limit.limit:.4g}")
    return table


if __name__ == "__main__":
    sys.exit(main())
