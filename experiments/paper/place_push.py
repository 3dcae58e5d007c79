"""``soft-jig place`` and ``soft-jig push``: the paper's experiments, with either hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform
from rich.console import Console

from cell.configuration.config import CellConfig
from cell.machines.cameras.rendering import rendering_problem
from cell.products.loading import load_product
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import trials
from experiments.campaigns.store import trial_folder
from experiments.campaigns.trial import Row
from experiments.paper.case_results import (
    Experiment,
    case_results,
    case_table,
    summary,
    verdict,
    write_case_report,
)
from experiments.paper.cases import Case, CaseResult, TrialResult, cases_of
from experiments.paper.trial import TrialRecord, check_fits
from experiments.paper.trial_tasks import CRITERION, LOG, PICTURES, from_arrays
from experiments.reporting.html_page import Picture
from experiments.reporting.result_file import ResultFile
from experiments.speed.meter import Meter

PRODUCT = "motor_unit"


def with_pressure(config: CellConfig, pressure_kpa: float | None) -> CellConfig:
    """Return the configuration with another vacuum [kPa]; None keeps it."""
    if pressure_kpa is None:
        return config
    return config.with_changes({"jig.vacuum.pressure": 1e3 * pressure_kpa})


def run_experiment(experiment: Experiment, label: str | None) -> int:
    """Run the cases that a label selects, as a campaign; write result and report.

    Returns:
        0 if every case came out as expected, else 1; 3 if a trial came to no verdict.
    """
    cases = cases_of(experiment.command, label)
    product = load_product(PRODUCT)
    for case in cases:
        check_fits(experiment.config, product, case.posture)
    console = Console(quiet=experiment.quiet, highlight=False)
    done: list[Row] = []

    def ended(row: Row) -> None:
        done.append(row)
        course = case_results(results_of(cases, done, experiment.out))
        result.update(**course | {"verdict": "running"})

    points = [
        {"case": case.label, "hand": experiment.hand, "number": number}
        for case in cases
        for number in range(experiment.trials)
    ]
    wanted = trials(
        experiment.command,
        points,
        product=PRODUCT,
        config=experiment.config,
        seeds=[experiment.seed],
    )
    with ResultFile(experiment.out, summary(experiment, [])) as result:
        rows = run_campaign(
            wanted,
            experiment.out,
            workers=experiment.workers,
            about={"command": experiment.command},
            console=console,
            ended=ended,
            report=False,
        )
        found = results_of(cases, rows, experiment.out)
        write_case_report(experiment, found, *_pictures(experiment, rows))
        # Last: whoever finds a verdict finds the report, too.
        result.update(**case_results(found))
    console.print(case_table(experiment.command, found))
    if not all(row.done for row in rows):
        return 3
    return 0 if verdict(found) == "success" else 1


def results_of(cases: Sequence[Case], rows: Sequence[Row], out: Path) -> list[CaseResult]:
    """Return the results of the cases of which a trial has ended.

    Args:
        cases: Of the experiment.
        rows: Of the trials that have ended.
        out: Folder of the campaign, in which their logs are.
    """
    found = [
        CaseResult(case, [_result(row, out) for row in rows if row.options["case"] == case.label])
        for case in cases
    ]
    return [result for result in found if result.trials]


def _result(row: Row, out: Path) -> TrialResult:
    """Return a trial with its log; one that came to no verdict, or failed early, has none."""
    trial, log = TrialRecord(planned=RigidTransform()), trial_folder(out, row.key) / LOG
    if row.done and log.exists():
        with np.load(log) as arrays:
            trial, _ = from_arrays(dict(arrays))
    # That a push has not moved the jig is its result; that a placement is none needs its reason.
    told = row.verdict != "success" and not (row.experiment == "push" and row.phase == CRITERION)
    failure = (row.phase or row.verdict, row.evidence) if told else None
    measured = {name: value for name, value in row.measured.items() if value is not None}
    return TrialResult(row.verdict == "success", measured, failure, trial)


def timed(row: Row, out: Path) -> tuple[Meter, float] | None:
    """Return what a trial spent, and the CPU time of a kernel iteration meanwhile [s].

    None if it failed before it was simulated.
    """
    log = trial_folder(out, row.key) / LOG
    if not log.exists():
        return None
    with np.load(log) as arrays:
        trial, kernel = from_arrays(dict(arrays))
    return trial.meter, kernel


def _pictures(experiment: Experiment, rows: Sequence[Row]) -> tuple[list[Picture], list[str]]:
    """Return the pictures of the first trial of each case, and why there are none."""
    problem = rendering_problem()
    found = []
    for row in rows:
        for event in PICTURES[experiment.command]:
            file = trial_folder(experiment.out, row.key) / f"{event}.png"
            if file.exists():
                found.append((f"{row.options['case']}: {event}", file.read_bytes()))
    return found, [] if problem is None else [f"No pictures: {problem}."]
