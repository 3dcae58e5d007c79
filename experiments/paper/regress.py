"""``soft-jig regress``: outcomes and metrics of the experiments against a stored baseline.

Each metric has a tolerance with a reason. The compared value is the mean over the trials of a case.
On one machine with one seed every run is bit-identical; the tolerances are for another machine or
library, and for changes of the model that should not change results.

The CPU time that stepping takes is compared as well, by class of what goes on, as ratios to the
calibration kernel (`experiments.speed`), which is timed before and after each trial. A class that
became slower is a warning: it does not change the verdict.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from cell.configuration.config import CellConfig
from cell.errors import InputError, RunFailure
from cell.paths import MODELS
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import trials
from experiments.paper.cases import CaseResult, cases_of
from experiments.paper.place_push import PRODUCT, results_of, timed
from experiments.reporting.output import write_json
from experiments.reporting.provenance import finite, versions
from experiments.speed.meter import changes, ratios, slower

BASELINE = MODELS / "regression"
SEED = 0


@dataclass(frozen=True)
class Tolerance:
    """The allowed drift of a metric.

    Attributes:
        metric: Its name, with SI units.
        absolute: In the unit of the metric.
        relative: To the stored value; the larger of the two applies.
        reason: For this tolerance.
    """

    metric: str
    absolute: float
    relative: float
    reason: str

    def holds(self, stored: float, now: float) -> bool:
        """Return whether the drift is within the tolerance."""
        return abs(now - stored) <= max(self.absolute, self.relative * abs(stored))


TOLERANCES = (
    Tolerance("success_rate", 0.0, 0.0, "an outcome that flips is a change of behaviour"),
    Tolerance("depth_m", 5e-4, 0.05, "the press stops within a step of its force limit"),
    Tolerance("tilt_rad", 0.01, 0.0, "half a degree is the scatter due to the grasp"),
    Tolerance("release_shift_m", 1e-4, 0.0, "a third of the allowed jump of 0.3 mm"),
    Tolerance("place_normal_peak_N", 0.5, 0.05, "one step of the press, 20 N in 10 mm"),
    Tolerance(
        "displacement_m",
        3e-3,
        0.05,
        "half of the 7 mm between limit and push",
    ),
    Tolerance("push_shear_peak_N", 1.0, 0.15, "a peak of stick-slip, averaged over 10 ms"),
    Tolerance("hand_force_peak_N", 2.0, 0.2, "the impact that starts the jig, averaged over 10 ms"),
    Tolerance("part_rotation_rad", 0.05, 0.15, "once the part topples, its final pose is chaotic"),
)


@dataclass(frozen=True)
class Suite:
    """The cases of a regression run.

    Attributes:
        name: "quick" or "full".
        cases: Experiment and label of each case; None stands for all of them.
        trials: Of each case.
    """

    name: str
    cases: tuple[tuple[str, str | None], ...]
    trials: int


# Two pushes that succeed and one that fails, the most robust ones of `push_robustness`: cases that
# depend on rounding, such as whether motor P2-a wedges or topples, are in the full suite only.
QUICK = (
    ("place", "motor/P2"),
    ("push", "plate/P1/a"),
    ("push", "plate/P2/b"),
    ("push", "plate/P2/c"),
)
SUITES = {
    suite.name: suite
    for suite in (
        Suite("quick", QUICK, 1),
        Suite("full", (("place", None), ("push", None)), 3),
    )
}


@dataclass(frozen=True)
class Drift:
    """One metric of one case, stored and now; None where it is missing."""

    case: str
    metric: str
    stored: float | None
    now: float | None
    tolerance: Tolerance

    @property
    def ok(self) -> bool:
        """Whether the metric exists in both and is within its tolerance."""
        known = self.stored is not None and self.now is not None
        return known and self.tolerance.holds(self.stored or 0.0, self.now or 0.0)


Metrics = dict[str, dict[str, float]]  # Case -> metric -> value.
Ratios = dict[str, float]  # Class -> kernel iterations per simulated second.


@dataclass(frozen=True)
class Baseline:
    """What is stored of a suite.

    Attributes:
        cases: Metrics.
        drake: The version of Drake with which they were made.
        speed: Ratios of CPU time; empty: not stored yet.
    """

    cases: Metrics
    drake: str
    speed: Ratios = field(default_factory=dict)


def metrics_of(results: Mapping[str, CaseResult]) -> Metrics:
    """Return the stored metrics of each case."""
    found = {}
    for name, result in results.items():
        means = result.means() | {"success_rate": result.successes / len(result.trials)}
        names = [tolerance.metric for tolerance in TOLERANCES]
        found[name] = {metric: means[metric] for metric in names if metric in means}
    return found


def drifts(stored: Metrics, now: Metrics) -> list[Drift]:
    """Return the drift of every metric, in the order of the present run, then stored cases."""
    rows = []
    for case in dict.fromkeys([*now, *stored]):
        before, after = stored.get(case, {}), now.get(case, {})
        for tolerance in TOLERANCES:
            metric = tolerance.metric
            if metric in before or metric in after:
                rows.append(Drift(case, metric, before.get(metric), after.get(metric), tolerance))
    return rows


def run_suite(
    suite: Suite, config: CellConfig, out: Path, workers: int, console: Console
) -> tuple[dict[str, CaseResult], Ratios]:
    """Run every case of a suite; return the results by "experiment case", and the ratios.

    Args:
        suite: Of cases.
        config: Of the cell.
        out: Folder for the trials; those that have ended there are not run again.
        workers: Trials at a time.
        console: Where to show progress.

    Raises:
        RunFailure: A trial came to no verdict.
    """
    cases = [(name, case) for name, label in suite.cases for case in cases_of(name, label)]
    wanted = [
        trial
        for command, case in cases
        for trial in trials(
            command,
            [{"case": case.label, "number": k, "timed": True} for k in range(suite.trials)],
            product=PRODUCT,
            config=config,
            seeds=[SEED],
        )
    ]
    about = {"command": "regress", "suite": suite.name}
    rows = run_campaign(wanted, out, workers=workers, about=about, console=console, report=False)
    for row in rows:
        if not row.done:
            raise RunFailure(f"{row.experiment} {row.options['case']}: {row.evidence}")
    results = {
        f"{command} {case.label}": result
        for command, case in cases
        for result in results_of([case], rows, out)
    }
    return results, ratios(timed(row, out) for row in rows)


def read_baseline(path: Path) -> Baseline:
    """Return what is stored of a suite.

    Raises:
        InputError: The file is missing or cannot be read.
    """
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        return Baseline(stored["cases"], str(stored["drake"]), stored.get("speed", {}))
    except FileNotFoundError:
        raise InputError(f"No stored metrics '{path}': make them with --update.") from None
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"Cannot read the stored metrics '{path}': {error}.") from error


def run_regress(
    suite_name: str, update: bool, config: CellConfig, out: Path, workers: int, quiet: bool
) -> int:
    """Run a suite and compare it with the baseline, or update the baseline.

    Returns:
        0 if every metric is within its tolerance or the baseline was updated, else 1.
    """
    console = Console(quiet=quiet, highlight=False)
    suite, path = SUITES[suite_name], BASELINE / f"{suite_name}.json"
    drake = version("drake")
    stored = Baseline({}, drake) if update and not path.exists() else read_baseline(path)
    if stored.drake != drake:
        text = f"The stored metrics hold for Drake {stored.drake}; this is {drake}."
        console.print(text, markup=False, soft_wrap=True)
    results, speed = run_suite(suite, config, out, workers, console)
    now = metrics_of(results)
    rows = drifts(stored.cases, now)
    shown = [row for row in rows if row.stored != row.now] if update else rows
    console.print(drift_table(shown, *(("Changes", "changed") if update else ("Drift", "drift"))))
    console.print(speed_table(stored.speed, speed))
    warnings = [] if update else speed_warnings(stored.speed, speed)
    for warning in warnings:
        console.print(warning, markup=False, soft_wrap=True)
    good = all(row.ok for row in rows)
    if update:
        path.parent.mkdir(parents=True, exist_ok=True)
        about = {"suite": suite_name, "seed": SEED, "drake": drake, "speed": speed}
        write_json(path, about | {"cases": now})
    result = _result(suite_name, update or good, rows, config)
    result["speed"] = {"stored": stored.speed, "now": speed, "warnings": warnings}
    write_json(out / "result.json", result)
    return 0 if update or good else 1


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


def _result(suite: str, success: bool, rows: Sequence[Drift], config: CellConfig) -> dict[str, Any]:
    return {
        "command": "regress",
        "suite": suite,
        "seed": SEED,
        "verdict": "success" if success else "failure",
        "metrics": [
            {
                "case": row.case,
                "metric": row.metric,
                "stored": row.stored,
                "now": row.now,
                "ok": row.ok,
                "reason": row.tolerance.reason,
            }
            for row in rows
        ],
        "config": finite(config.to_dict()),
        "versions": versions(),
    }


def drift_table(rows: Sequence[Drift], title: str, word: str) -> Table:
    """Return one line per metric; a word marks those outside their tolerance."""
    table = Table(title=title, title_justify="left")
    for heading in ("case", "metric", "stored", "now", "allowed", ""):
        table.add_column(heading, justify="left" if heading in ("case", "metric") else "right")
    for row in rows:
        allowed = max(row.tolerance.absolute, row.tolerance.relative * abs(row.stored or 0.0))
        values = ["-" if value is None else f"{value:.4g}" for value in (row.stored, row.now)]
        table.add_row(row.case, row.metric, *values, f"{allowed:.2g}", "" if row.ok else word)
    return table
