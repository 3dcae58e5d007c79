"""``soft-jig regress``: outcomes and metrics of the experiments against a stored baseline.

Each metric has a tolerance with a reason. The compared value is the mean over the trials of a case.
On one machine with one seed every run is bit-identical; the tolerances are for another machine or
library, and for changes of the model that should not change results.

The CPU time that stepping takes is compared as well, by class of what goes on, as ratios to the
calibration kernel (`experiments.speed`), which is timed before and after each trial. A class that
became slower is a warning: it does not change the verdict.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from cell.configuration.config import CellConfig
from cell.paths import MODELS
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.trial import Row
from experiments.compare.comparison import (
    Comparison,
    compared,
    plain,
    tolerance_table,
    value_table,
)
from experiments.compare.files import check_files, write_csv, write_junit
from experiments.paper.place_push import timed
from experiments.regress.baseline import Baseline, Metrics, Ratios, metrics_of, read_baseline
from experiments.regress.suites import NAMES, SEED, SUITES, Suite, cases_named, trials_of
from experiments.reporting.output import write_json
from experiments.reporting.provenance import finite, versions
from experiments.reporting.result_file import ResultFile
from experiments.speed.meter import changes, ratios, slower

BASELINES = MODELS / "regression"


@dataclass(frozen=True)
class Regression:
    """A regression run that was asked for, checked.

    Attributes:
        suite: The cases and their trials.
        stored: What they are compared with; None: nothing is stored yet.
        path: Of the baseline.
        update: Whether to store what comes out.
        config: Of the cell.
        workers: Trials at a time.
        junit, csv: Further files, if wanted.
        quiet: Whether to print nothing.
    """

    suite: Suite
    stored: Baseline | None
    path: Path
    update: bool
    config: CellConfig
    workers: int = 1
    junit: Path | None = None
    csv: Path | None = None
    quiet: bool = False

    @staticmethod
    def of(
        suite: str, cases: Sequence[str], baseline: Path | None, update: bool, **options: Any
    ) -> Regression:
        """Return the run that options describe.

        Args:
            suite: "quick" or "full": cases and trials of the stored baselines.
            cases: Names; empty: those of the baseline, or of the suite if that is new.
            baseline: File of one's own; None: that of the suite.
            update: Whether to store what comes out.
            options: The other attributes.

        Raises:
            InputError: A case is unknown or not stored, or a file cannot be read or written.
        """
        path = baseline or BASELINES / f"{suite}.json"
        files = {"junit": options.get("junit"), "csv": options.get("csv")}
        check_files(**files, baseline=path if update else None)
        stored = None if update and not path.exists() else read_baseline(path)
        if stored is not None:
            cases_named(tuple(stored.cases), NAMES)
        names, trials = SUITES[suite].cases, SUITES[suite].trials
        if baseline is not None and stored is not None:
            names, trials = tuple(stored.cases), stored.trials
        known = NAMES if stored is None or update else tuple(stored.cases)
        chosen = cases_named(cases, known) if cases else names
        return Regression(Suite(chosen, trials), stored, path, update, **options)

    def run(self, out: Path) -> int:
        """Run the cases and compare them with the baseline, or update the baseline.

        Args:
            out: Existing folder for ``result.json`` and the trials; those that have ended there
                are not run again.

        Returns:
            0 if every metric is within its tolerance or the baseline was updated, else 1; 3 if a
            trial came to no verdict.
        """
        console = Console(quiet=self.quiet, highlight=False)
        head = {
            "command": "regress",
            "baseline": self.path,
            "cases": list(self.suite.cases),
            "metrics": [],
            "seed": SEED,
            "config": finite(self.config.to_dict()),
            "versions": versions(),
        }
        with ResultFile(out, head) as result:
            self._tell_versions(console)
            found = self._run_trials(out, console)
            errors = {
                case: f"{row.verdict}: {row.evidence}"
                for case, rows in found.items()
                for row in rows
                if not row.done
            }
            now = {case: metrics_of(rows) for case, rows in found.items() if case not in errors}
            ended = [row for rows in found.values() for row in rows if row.done]
            spent = (timed(row, out) for row in ended if row.options.get("timed"))
            speed = ratios(each for each in spent if each is not None)
            return self._conclude(result, console, now, speed, errors)

    def _tell_versions(self, console: Console) -> None:
        drake = version("drake")
        if self.stored is not None and self.stored.drake != drake:
            text = f"The stored metrics hold for Drake {self.stored.drake}; this is {drake}."
            console.print(text, markup=False, soft_wrap=True)

    def _run_trials(self, out: Path, console: Console) -> dict[str, list[Row]]:
        """Run the trials of all cases; return their rows by case."""
        wanted = trials_of(self.suite, self.config)
        everything = [trial for trials in wanted.values() for trial in trials]
        about = {"command": "regress"}
        rows = run_campaign(
            everything, out, workers=self.workers, about=about, console=console, report=False
        )
        by_key = {row.key: row for row in rows}
        return {case: [by_key[trial.key] for trial in trials] for case, trials in wanted.items()}

    def _conclude(
        self,
        result: ResultFile,
        console: Console,
        now: Metrics,
        speed: Ratios,
        errors: dict[str, str],
    ) -> int:
        stored = self.stored or Baseline({}, version("drake"), self.suite.trials)
        before = {case: stored.cases.get(case, {}) for case in now}
        rows = compared(before, now)
        self._print(rows, stored, speed, console)
        for case, error in errors.items():
            console.print(f"{case}: {error}", markup=False, soft_wrap=True)
        warnings = [] if self.update else speed_warnings(stored.speed, speed)
        for warning in warnings:
            console.print(warning, markup=False, soft_wrap=True)
        held = compared(now, now) if self.update else rows  # What is stored is what holds.
        if self.junit is not None:
            write_junit(self.junit, "regress", held, errors)
        if self.csv is not None:
            write_csv(self.csv, held, ("stored", "now"))
        if self.update and not errors:
            whole = set(now) >= set(stored.cases)
            kept = Baseline(
                stored.cases | now,
                version("drake"),
                self.suite.trials,
                speed if whole else stored.speed,
            )
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_json(self.path, {"seed": SEED, **kept.to_dict()})
        good = self.update or all(row.ok for row in rows)
        verdict = "error" if errors else "success" if good else "failure"
        result.update(
            verdict=verdict,
            metrics=metrics_to_json(rows),
            errors=errors,
            speed={"stored": stored.speed, "now": speed, "warnings": warnings},
        )
        return {"error": 3, "success": 0, "failure": 1}[verdict]

    def _print(
        self, rows: Sequence[Comparison], stored: Baseline, speed: Ratios, console: Console
    ) -> None:
        names = ("stored", "now")
        if self.update:
            shown = [row for row in rows if row.before != row.after]
            console.print(value_table(shown, "Changes", names, "changed"))
        else:
            console.print(value_table(rows, "Drift", names, "drift"))
            console.print(tolerance_table(rows))
        console.print(speed_table(stored.speed, speed))


def metrics_to_json(rows: Sequence[Comparison]) -> list[dict[str, Any]]:
    """Return one entry per metric of ``result.json``."""
    return [
        {
            "case": row.place,
            "metric": row.quantity,
            "stored": plain(row.before),
            "now": plain(row.after),
            "allowed": row.allowed,
            "ok": row.ok,
            "reason": row.reason,
        }
        for row in rows
    ]


def speed_warnings(stored: Ratios, now: Ratios) -> list[str]:
    """Return a line for each class of what goes on that became slower than is stored."""
    return [
        f"Warning: '{name}' takes {now[name] / stored[name] - 1:.0%} more CPU time than is stored."
        for name in slower(stored, now)
    ]


def speed_table(stored: Ratios, now: Ratios) -> Table:
    """Return one line per class of what goes on, in kernel iterations per simulated second."""
    table = Table(title="CPU time, in units of the calibration kernel", title_justify="left")
    for heading in ("class", "stored", "now", "change"):
        table.add_column(heading, justify="left" if heading == "class" else "right")
    change = changes(stored, now)
    for name, ratio in now.items():
        known = (f"{stored[name]:.1f}", f"{change[name]:+.0%}") if name in change else ("-", "-")
        table.add_row(name, known[0], f"{ratio:.1f}", known[1])
    return table
