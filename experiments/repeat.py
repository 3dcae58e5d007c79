"""Repeated assembly with different seeds: success rate, and the range of every limited quantity.

    python -m experiments.repeat --seeds 10 --workers 2 --out out/repeat

Every run is one of `soft-jig assemble`, in its own process and folder. Prints one row per seed and
one per limit, and writes both to summary.json.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.products.loading import load_product
from experiments.cli.assemble import Assemble
from experiments.cli.common import BadUsage
from experiments.cli.ending import exit_code
from experiments.reporting.output import output_folder, write_json
from planning.operations.limits import Limit
from planning.operations.registry import OPERATIONS

Bound = tuple[str, Limit]  # Name of an operation, and one of its limits.
Range = tuple[float, float]  # Smallest and largest value.


@dataclass(frozen=True)
class RepeatOptions:
    """Options of `soft-jig assemble`, the number of runs, and the number of cores."""

    assemble: OmitArgPrefixes[Assemble] = field(default_factory=Assemble)

    seeds: int = 10
    """Number of runs, with consecutive seeds from --seed."""

    workers: Annotated[int, arg(metavar="CORES")] = 1
    """Runs at a time."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0 if every run succeeded, 1 if one failed, 2 for bad input."""
    options = tyro.cli(
        RepeatOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("repeat", lambda: run_all(options))


def run_all(options: RepeatOptions) -> int:
    """Run the assemblies, write ``summary.json`` and print the tables; return the exit code.

    Raises:
        InputError: An option is invalid.
    """
    for name in ("seeds", "workers"):
        if getattr(options, name) < 1:
            raise BadUsage(f"--{name} must be >= 1, not {getattr(options, name)}.")
    # Bad input is found once, here, instead of in every process.
    options.assemble.common.load_config()
    load_product(options.assemble.product)
    console = Console(quiet=options.assemble.common.quiet, highlight=False)
    common = options.assemble.common
    jobs = [
        replace(
            options.assemble, common=replace(common, seed=s, out=common.out / str(s), quiet=True)
        )
        for s in range(common.seed, common.seed + options.seeds)
    ]
    with output_folder(common.out) as out:
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(options.workers, spawn, max_tasks_per_child=1) as pool:
            results = list(pool.map(_run, jobs))
        bounds = [(name, limit) for name, o in OPERATIONS.items() for limit in o.limits]
        ranges = {bound: _range(*bound, results) for bound in bounds}
        runs = [
            {
                "seed": result["seed"],
                "verdict": result["verdict"],
                "real_time_factor": result.get("real_time_factor"),
                "failures": _failures(result),
            }
            for result in results
        ]
        found = {f"{name}/{limit.quantity}": extremes for (name, limit), extremes in ranges.items()}
        write_json(out / "summary.json", {"runs": runs, "ranges": found})
    console.print(_seed_table(results))
    console.print(_range_table(ranges))
    return 0 if all(result["verdict"] == "success" for result in results) else 1


def _run(job: Assemble) -> dict[str, Any]:
    """Run one assembly; return its ``result.json``."""
    job.run()
    return json.loads((job.common.out / "result.json").read_text(encoding="utf-8"))


def _range(operation: str, limit: Limit, results: Sequence[dict[str, Any]]) -> Range | None:
    """Return the extreme values of a limited quantity over all runs and parts; None if none."""
    values = [
        value
        for result in results
        for step in result["steps"]
        if step["operation"] == operation
        for name, value in step["measured"].items()
        if name.rsplit("/", 1)[-1] == limit.quantity
    ]
    return (min(values), max(values)) if values else None


def _failures(result: dict[str, Any]) -> list[str]:
    """Return the phase in which a run failed, or the checks that failed."""
    if failure := result.get("failure"):
        return [f"{failure['phase']}: {failure['evidence']}"]
    return [check["quantity"] for step in result["steps"] for check in step["failed_checks"]]


def _seed_table(results: Sequence[dict[str, Any]]) -> Table:
    table = Table("seed", "verdict", "simulated s / CPU s", "failure", title="Runs")
    for result in results:
        speed = result.get("real_time_factor")
        shown = "-" if speed is None else f"{speed:.3f}"
        table.add_row(str(result["seed"]), result["verdict"], shown, "; ".join(_failures(result)))
    return table


def _range_table(ranges: dict[Bound, Range | None]) -> Table:
    table = Table("operation", "quantity", "smallest", "largest", "limit", title="Over all runs")
    for (name, limit), found in ranges.items():
        low, high = ("-", "-") if found is None else (f"{value:.4g}" for value in found)
        table.add_row(name, limit.quantity, low, high, f"{limit.limit:.4g}")
    return table


if __name__ == "__main__":
    sys.exit(main())
