"""Products drawn in code, from CAD to the end, over seeds: ``python -m experiments.product_seeds``.

    python -m experiments.product_seeds --seeds 10 --workers 2 --out out/products
    python -m experiments.product_seeds --kind "gear pair" --seeds 1

Each kind (`experiments.product.drawings`) is drawn, drafted by ``init`` and checked; no file is
touched in between. What `check` has nothing against is assembled with every seed, as a campaign:
the same command again goes on where it was stopped. A draft that is there is kept. The table says
how many runs succeeded, what they took, the largest force of a push and the farthest way of the
fixed part; ``products.json`` holds it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.errors import UnknownName
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import trials
from experiments.campaigns.trial import Row
from experiments.cli.common import Common, check_counts
from experiments.cli.ending import exit_code
from experiments.product.drafting import Draft, drafted
from experiments.product.drawings import KINDS
from experiments.reporting.output import output_folder, write_json

TABLE = "products.json"
FORCES = ("insertion_force_peak_N", "press_force_peak_N")
MOVED = "base_moved_since_placed_m"


@dataclass(frozen=True)
class Options:
    """Which products, and how often each."""

    kind: Annotated[tuple[str, ...], arg(metavar="NAME")] = tuple(KINDS)
    """Kinds to assemble, by name; all by default."""

    seeds: int = 10
    """Runs of each, with consecutive seeds from --seed."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Runs at a time. What is done already is not run again."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


def run(options: Options) -> int:
    """Assemble, print and write the table; return 0 if every run of every kind succeeded, else 1.

    Raises:
        InputError: An option is invalid.
    """
    check_counts(options, "seeds", "workers")
    for name in options.kind:
        if name not in KINDS:
            raise UnknownName("kind of product", name, KINDS)
    common, config = options.common, options.common.load_config()
    seeds = range(common.seed, common.seed + options.seeds)
    console = Console(quiet=common.quiet, highlight=False)
    with output_folder(common.out, TABLE) as out:
        drafts = {}
        for name in options.kind:
            kind, folder = KINDS[name], out / name.replace(" ", "_")
            drafts[name] = drafted(kind.draw(), folder, config, materials=kind.materials)
        wanted = {
            name: trials("assemble", product=draft.file, config=config, seeds=seeds)
            for name, draft in drafts.items()
            if not draft.against
        }
        todo = [trial for own in wanted.values() for trial in own]
        rows = run_campaign(todo, out, workers=options.workers, console=console)
        of_key = {row.key: row for row in rows}
        lines = [
            line_of(name, draft, [of_key[trial.key] for trial in wanted.get(name, [])])
            for name, draft in drafts.items()
        ]
        write_json(out / TABLE, {"seeds": list(seeds), "products": lines})
    console.print(table_of(lines))
    done = [line["succeeded"] == options.seeds for line in lines]
    return 0 if all(done) else 1


def line_of(name: str, draft: Draft, rows: Sequence[Row]) -> dict[str, object]:
    """Return what became of a product."""
    return {
        "product": name,
        "init_and_check_cpu_s": draft.seconds,
        "against": draft.against,
        "runs": len(rows),
        "succeeded": sum(row.verdict == "success" for row in rows),
        "run_cpu_s": [row.cpu_seconds for row in rows],
        "force_peak_N": _largest(rows, FORCES),
        "fixed_part_moved_m": _largest(rows, (MOVED,)),
        "failures": [
            f"seed {r.seed}: {r.phase}: {r.evidence}" for r in rows if r.verdict != "success"
        ],
    }


def _largest(rows: Sequence[Row], quantities: Sequence[str]) -> float | None:
    """Return the largest value of some quantities, whatever step and part they are of."""
    values = [
        value
        for row in rows
        for name, value in row.measured.items()
        if name.rsplit("/", 1)[-1] in quantities and value is not None
    ]
    return max(values, default=None)


def table_of(lines: Sequence[dict]) -> Table:  # pyright: ignore[reportMissingTypeArgument]
    """Return one line per product."""
    table = Table("product", "init, check [CPU s]", "succeeded", "run [CPU s]", "force [N]",
                  "fixed part moved [mm]", "what fails")  # fmt: skip
    for line in lines:
        init, check = line["init_and_check_cpu_s"]
        took, force, moved = line["run_cpu_s"], line["force_peak_N"], line["fixed_part_moved_m"]
        table.add_row(
            line["product"],
            f"{init:.0f}, {check:.0f}",
            f"{line['succeeded']} of {line['runs']}",
            f"{min(took):.0f} .. {max(took):.0f}" if took else "-",
            "-" if force is None else f"{force:.1f}",
            "-" if moved is None else f"{1e3 * moved:.2f}",
            "; ".join([*line["against"], *line["failures"]]),
        )
    return table


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return its exit code."""
    options = tyro.cli(Options, args=arguments, description=__doc__, config=(FlagCreatePairsOff,))
    return exit_code("product_seeds", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
