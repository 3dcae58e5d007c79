"""Run what is missing of a campaign; its files are all that is remembered between two runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.campaigns.executors import death_of, pool_at
from experiments.campaigns.progress import Progress
from experiments.campaigns.report import write_campaign_report
from experiments.campaigns.run_trial import row_of, run_trial
from experiments.campaigns.store import (
    TRIALS,
    DamagedTrial,
    read_trial,
    trial_file,
    write_index,
    write_trial,
)
from experiments.campaigns.summary import summary_of
from experiments.campaigns.trial import Outcome, Row, Trial
from experiments.reporting.output import write_json

SUMMARY = "summary.json"
SUMMARY_SECONDS = 2.0  # Between two summaries of a campaign that runs [A].


def run_campaign(
    trials: Sequence[Trial],
    out: Path,
    *,
    workers: int = 1,
    executor: str = "local",
    about: Mapping[str, Any] | None = None,
    console: Console | None = None,
    ended: Callable[[Row], None] = lambda row: None,
    report: bool = True,
) -> list[Row]:
    """Run the trials that have no verdict in the folder yet; return the rows of all.

    Each trial writes its own file as it ends. A trial whose code raised an error or whose process
    was killed is a row as well, and is run again by the next call. When it ends, and when it is
    interrupted, the call writes ``trials.parquet``, ``summary.json`` and ``report.html`` from the
    files that are there.

    Args:
        trials: Of the campaign, as `trials` returns them.
        out: The folder. It must be the same folder for all workers of a cluster.
        workers: Processes of this machine at a time.
        executor: "local", or ``dask://HOST:PORT``.
        about: What else the summary says, for example the command.
        console: Where to show progress; None shows none.
        ended: Told of every trial that has ended, also of those that had before.
        report: Whether to write ``report.html``.

    Raises:
        InputError: No executor at this address.
        OSError: A file cannot be written.
    """
    console = console or Console(quiet=True)
    out = Path(out).absolute()
    (out / TRIALS).mkdir(parents=True, exist_ok=True)
    rows = kept(trials, out, console)
    waiting = [trial for trial in trials if trial.key not in rows or not rows[trial.key].done]
    if len(waiting) < len(trials):
        text = f"{len(trials) - len(waiting)} of {len(trials)} trials are done already."
        console.print(text, markup=False)
    folder = _Folder(trials, out, dict(about or {}), rows, report)
    folder.summarize(running=bool(waiting))
    for row in folder.rows:
        if row.done:
            ended(row)

    def take(row: Row) -> None:
        folder.add(row)
        progress.trial(row)
        ended(row)

    try:
        with Progress(console, len(waiting)) as progress:
            _run(waiting, out, executor, workers, take)
    finally:
        folder.write()
    return folder.rows


def kept(trials: Sequence[Trial], out: Path, console: Console) -> dict[str, Row]:
    """Return the rows of the trials that have ended before, by key."""
    rows = {}
    for trial in trials:
        try:
            row = read_trial(trial_file(out, trial.key))
        except FileNotFoundError:
            continue
        except DamagedTrial as damage:
            console.print(f"{damage} The trial is run again.", markup=False, soft_wrap=True)
            continue
        rows[trial.key] = replace(row, varied=dict(trial.varied))
    return rows


def _run(
    waiting: Sequence[Trial],
    out: Path,
    executor: str,
    workers: int,
    ended: Callable[[Row], None],
) -> None:
    """Run trials and tell of each that has ended."""
    if not waiting:
        return
    with pool_at(executor, min(workers, len(waiting))) as pool:
        futures = {pool.submit(run_trial, trial, out): trial for trial in waiting}
        for future in as_completed(futures):
            trial = futures.pop(future)
            if future.cancelled():
                raise ConnectionError(f"{executor} is gone; the same command goes on.")
            error = future.exception()
            if error is None:
                ended(future.result())
            elif (death := death_of(error)) is not None:
                row = row_of(trial, "killed", Outcome(False, evidence=death), 0.0, "", out)
                write_trial(out, row)
                ended(row)
            else:
                raise error


class _Folder:
    """The files of a campaign that are made from those of its trials."""

    def __init__(
        self,
        trials: Sequence[Trial],
        out: Path,
        about: dict[str, Any],
        rows: dict[str, Row],
        report: bool,
    ) -> None:
        self.trials, self.out, self.about, self.by_key = trials, out, about, rows
        self.report, self.written = report, 0.0

    @property
    def rows(self) -> list[Row]:
        """Of the trials that have ended, in the order of the campaign."""
        return [self.by_key[trial.key] for trial in self.trials if trial.key in self.by_key]

    def add(self, row: Row) -> None:
        """Take note of a trial that has ended."""
        self.by_key[row.key] = row
        if time.monotonic() - self.written > SUMMARY_SECONDS:
            self.summarize(running=True)

    def summarize(self, running: bool) -> dict[str, Any]:
        """Write the summary of what there is, and return it."""
        summary = self.about | summary_of(self.rows, len(self.trials), running)
        write_json(self.out / SUMMARY, summary)
        self.written = time.monotonic()
        return summary

    def write(self) -> None:
        """Write index, summary and, if wanted, report.

        A worker may have ended a trial without a chance to tell, as the campaign was interrupted.
        """
        missing = [trial for trial in self.trials if trial.key not in self.by_key]
        self.by_key |= kept(missing, self.out, Console(quiet=True))
        write_index(self.out, self.rows)
        summary = self.summarize(running=False)
        if self.report:
            write_campaign_report(self.out, self.rows, summary)
