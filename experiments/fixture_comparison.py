"""The paper's table I, measured: soft jig, jig with supports and custom jig side by side.

    python -m experiments.fixture_comparison --workers 2 --out out/fixture_comparison
    python -m experiments.fixture_comparison --products motor_unit --case motor/P2 --trials 3
    python -m experiments.fixture_comparison --products motor_unit --assemblies 10 --workers 2

For every fixture and posture of the parts of some products: whether it can be fixed, what has to be
made, set or pumped for it, how far the placed part is from where it was meant to be, with a grasp
disturbed by 1 mm and 2 degrees per axis, and what an exactly placed one bears by direction. The
same with parts that are larger than the fixture that is made for them knows; the soft jig knows no
size. The hand is that of the rig, the jig is where it is believed to be. With --assemblies whole
products are assembled on each fixture, too.

A campaign: every trial is kept as it ends, and the same command goes on where it was stopped.
Prints the tables, and writes them to comparison.html and comparison.json. A placement takes 4 to 20
CPU seconds, the pulls 20 to 40, an assembly of the motor unit 100, and on a fixture that is made
for a part more than twice that.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Annotated

import tyro
from rich.console import Console
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.fixtures import fixture_class
from experiments.campaigns.campaign import run_campaign
from experiments.cli.common import BadUsage, Common, check_counts
from experiments.cli.ending import exit_code
from experiments.fixtures.found import found_of
from experiments.fixtures.page import tables_of, terminal_table, write_page
from experiments.fixtures.plan import FIXTURES, Extent, lines_of
from experiments.fixtures.products import selected, source_of
from experiments.fixtures.table_one import entries_of
from experiments.reporting.output import output_folder, write_json
from experiments.reporting.provenance import finite, versions

RESULT = "comparison.json"
WIDTH = 180  # Of the tables [A]; a narrower terminal folds them.


@dataclass(frozen=True)
class ComparisonOptions:
    """Options of the script."""

    products: Annotated[tuple[str, ...], arg(metavar="NAME|FILE|drawn:N ...")] = (
        "motor_unit",
        "idler",
        "drawn:0",
    )
    """Products whose parts are compared: names, product files, or what `random_products` draws as
    number N."""

    fixtures: Annotated[tuple[str, ...], arg(metavar="NAME ...")] = FIXTURES
    """Fixtures that are compared: soft_jig, support_jig, rigid_jig or flat_plate."""

    case: Annotated[str | None, arg(metavar="motor/P2")] = None
    """A posture, or a part for all of its postures. Default: all."""

    trials: int = 10
    """Disturbed placements of each row, with consecutive seeds from --seed."""

    pulls: bool = True
    """Whether to measure what the fixtures bear."""

    assemblies: int = 0
    """Whole assemblies of each product on each fixture, with consecutive seeds."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Trials at a time. What is done already is not run again."""

    executor: Annotated[str, arg(metavar="local|dask://HOST:PORT")] = "local"
    """Where trials run."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


def run(options: ComparisonOptions) -> int:
    """Run what is missing of the comparison, write its files and print its tables.

    Returns:
        0, or 3 if a trial came to no verdict; the tables say which row lacks how many.

    Raises:
        InputError: An option, a product, a fixture or a case is invalid.
    """
    check_counts(options, "trials", "workers")
    check_counts(options, "assemblies", least=0)
    if not options.fixtures:
        raise BadUsage("--fixtures: name at least one.")
    for name in options.fixtures:
        fixture_class(name)
    products = selected(options.products, options.case)
    config = options.common.load_config()
    console = Console(quiet=options.common.quiet, highlight=False, width=WIDTH)
    extent = Extent(
        tuple(dict.fromkeys(options.fixtures)),
        options.case,
        options.trials,
        options.pulls,
        options.assemblies,
        options.common.seed,
    )
    with output_folder(options.common.out) as out:
        sources = {name: source_of(name, out, config) for name in products}
        lines = lines_of(sources, config, extent)
        planned = {trial.key: trial for line in lines for trial in line.trials}
        about = {
            "command": "fixture_comparison",
            "products": products,
            "fixtures": extent.fixtures,
            "case": extent.case or "all",
            "placements_of_a_row": extent.trials,
            "assemblies_of_a_row": extent.assemblies,
            "first_seed": extent.seed,
        }
        rows = run_campaign(
            list(planned.values()),
            out,
            workers=options.workers,
            executor=options.executor,
            about=about,
            console=console,
        )
        ended = {row.key: row for row in rows}
        found = [found_of(line, ended) for line in lines]
        entries = entries_of(found)
        missing = sum(line.no_verdict for line in found)
        cpu = {"cpu_seconds": sum(row.cpu_seconds for row in rows)}
        facts = about | {"trials": len(planned), "no_verdict": missing, **cpu}
        result = facts | {"config": finite(config.to_dict()), "versions": versions()}
        result |= {"table_1": [entry.to_dict() for entry in entries]}
        write_json(out / RESULT, result | {"rows": [asdict(line) for line in found]})
        write_page(out, facts | versions(), found, entries)
    for heading, shown in tables_of(found, entries):
        console.print(terminal_table(heading, shown))
    if missing:
        why = next((row.evidence for row in rows if not row.done), "")
        text = (
            f"{missing} trials came to no verdict; the same command runs them again. First: {why}"
        )
        console.print(text, markup=False, soft_wrap=True)
    return 3 if missing else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    options = tyro.cli(
        ComparisonOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("fixture_comparison", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
