"""``soft-jig sweep``: a campaign, with a table at its end."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import shorten

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from cell.configuration.config import CellConfig
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.summary import failures_by_phase, rate_of, verdict_of
from experiments.campaigns.trial import VERDICTS, Row, Trial
from experiments.reporting.provenance import finite, versions

WIDTH = 120  # Of evidence on the terminal; files and report have all of it.
EXIT_CODES = {"success": 0, "failure": 1, "error": 3}


def run_sweep(
    trials: Sequence[Trial],
    out: Path,
    config: CellConfig,
    workers: int,
    executor: str,
    quiet: bool,
) -> int:
    """Run what is missing of a campaign and print what all of it found; return the exit code.

    Args:
        trials: Of the campaign.
        out: Existing folder.
        config: Of what does not differ between the trials.
        workers: Processes at a time.
        executor: Where they run.
        quiet: Whether to print nothing.
    """
    console = Console(quiet=quiet, highlight=False)
    about = {
        "command": "sweep",
        "experiment": Path(trials[0].experiment).name,
        "product": trials[0].product,
        "seeds": sorted({trial.seed for trial in trials}),
        "code": trials[0].code,
        "config": finite(config.to_dict()),
        "versions": versions(),
    }
    rows = run_campaign(
        trials, out, workers=workers, executor=executor, about=about, console=console
    )
    console.print(count_table(rows))
    console.print(failure_table(rows))
    return EXIT_CODES[verdict_of(rows, len(trials))]


def count_table(rows: Sequence[Row]) -> Table:
    """Return how many trials came to which verdict, and the success rate with its interval."""
    table = Table(title="Trials", title_justify="left")
    for heading in ("trials", *VERDICTS, "success rate", "95 % interval"):
        table.add_column(heading, justify="right")
    counts = [sum(row.verdict == verdict for row in rows) for verdict in VERDICTS]
    rate = rate_of(rows)
    shown = ["-", "-"]
    if rate["success_rate"] is not None:
        low, high = rate["success_interval"]
        shown = [f"{rate['success_rate']:.3f}", f"{low:.3f} to {high:.3f}"]
    table.add_row(str(len(rows)), *map(str, counts), *shown)
    return table


def failure_table(rows: Sequence[Row]) -> Table:
    """Return one line per phase in which trials failed."""
    table = Table(
        "phase", "trials", "evidence of the first", title="Failures", title_justify="left"
    )
    for phase in failures_by_phase(rows):
        evidence = shorten(phase["evidence"], WIDTH, placeholder=" ...")
        table.add_row(escape(phase["phase"]), str(phase["trials"]), escape(evidence))
    return table
