"""``result.json`` and ``report.html`` of the place and push experiments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table
from scipy.stats import t as student
from scipy.stats import ttest_ind

from cell.configuration.config import CellConfig
from experiments.paper.case_plots import PAPER_MEANS, plot_forces, plot_quantity, plot_rates
from experiments.paper.cases import CaseResult
from experiments.reporting.provenance import finite, versions
from experiments.reporting.report import Picture, write_report

ASSUMED = (
    "The paper's figures of postures and push directions are not public as text: the pictures and "
    "the table show how its words are interpreted here. Postures, directions, push height and "
    "suction were chosen with its outcome table known; no number differs between cases or parts."
)
HAND = (
    "The hand is a closed parallel gripper with fingers and palm of assumed size, pushed so that "
    "both fingertips' narrow sides lead; its palm overhangs their noses by 36 mm."
)
FORMULA = (
    "The displacement is |dp_c|, that of the mean of the four screws. The formula printed in the "
    "paper compares the screws with their own mean and is 0 for any pure translation, so it cannot "
    "have given the paper's 78.2 mm; its value is reported as printed_formula_m."
)
FORCES = (
    "The readings of the force plate are relative to those at the start, with the jig at rest on "
    "it, and averaged over 10 ms. While the hand travels from placing to pushing, part and jig "
    "sleep, and the last reading is held."
)
# Of the printed table: quantity, heading, scale.
PUSH_COLUMNS = (
    ("displacement_m", "moved [mm]", 1e3),
    ("push_shear_peak_N", "shear [N]", 1.0),
    ("force_peaks", "peaks", 1.0),
)
PLACE_COLUMNS = (
    ("depth_m", "depth [mm]", 1e3),
    ("tilt_rad", "tilt [deg]", float(np.rad2deg(1.0))),
)


@dataclass(frozen=True)
class Experiment:
    """The options of a place or push experiment.

    Attributes:
        command: "place" or "push".
        config: Of the cell.
        hand: "rig" or "robot".
        trials: Of each case.
        seed: Of the disturbances.
        out: Existing folder for the results.
        quiet: Whether to print nothing.
        workers: Trials at a time.
    """

    command: str
    config: CellConfig
    hand: str
    trials: int
    seed: int
    out: Path
    quiet: bool = False
    workers: int = 1


def verdict(results: Sequence[CaseResult]) -> str:
    """Return "success" if every case came out as expected, else "failure"."""
    return "success" if all(result.agrees for result in results) else "failure"


def write_case_report(
    experiment: Experiment, results: Sequence[CaseResult], pictures: Sequence[Picture], notes
) -> None:
    """Write ``report.html`` into the folder of the experiment."""
    result = summary(experiment, results)
    push = experiment.command == "push"
    failures = [
        f"{result.case.label}, trial {k}: failed in '{trial.failure[0]}': {trial.failure[1]}"
        for result in results
        for k, trial in enumerate(result.trials)
        if trial.failure is not None
    ]
    remarks = [ASSUMED, *([HAND, FORMULA] if push else []), FORCES, *notes, *failures]
    write_report(
        experiment.out / "report.html",
        title=f"Experiment: {experiment.command}",
        plan={},
        result=result,
        pictures=pictures,
        plots=_plots(results, push),
        notes=remarks,
    )


def summary(experiment: Experiment, results: Sequence[CaseResult]) -> dict[str, Any]:
    """Return the content of ``result.json``."""
    return {
        "command": experiment.command,
        "product": "motor_unit",
        "order": [],
        "seed": experiment.seed,
        "hand": experiment.hand,
        **case_results(results),
        "config": finite(experiment.config.to_dict()),
        "versions": versions(),
    }


def case_results(results: Sequence[CaseResult]) -> dict[str, Any]:
    """Return what ``result.json`` says of the trials that have ended."""
    trials = [trial.trial for result in results for trial in result.trials]
    simulated = sum(trial.sim_seconds for trial in trials)
    spent = sum(trial.cpu_seconds for trial in trials)
    return {
        "verdict": verdict(results),
        "cases": [_case(result) for result in results],
        "by_outcome": {
            "displacement_m": by_outcome(results, "displacement_m", PAPER_MEANS),
            "push_shear_peak_N": by_outcome(results, "push_shear_peak_N"),
        },
        "real_time_factor": simulated / max(spent, 1e-9),
        "cpu_seconds_per_trial": spent / max(len(trials), 1),
    }


def _case(result: CaseResult) -> dict[str, Any]:
    case = result.case
    direction = {} if case.push is None else {"direction": case.push.direction}
    failures = [
        {"trial": k, "phase": trial.failure[0], "evidence": trial.failure[1]}
        for k, trial in enumerate(result.trials)
        if trial.failure is not None
    ]
    return {
        "part": case.posture.part,
        "posture": case.posture.name,
        **direction,
        "meaning": _meaning(result),
        "trials": len(result.trials),
        "successes": result.successes,
        "expected": case.expected,
        "verdict": "success" if result.agrees else "failure",
        "success_rate_interval": result.interval,
        "measured": result.means(),
        "each": [trial.measured | {"success": int(trial.success)} for trial in result.trials],
        "failures": failures,
    }


def by_outcome(
    results: Sequence[CaseResult], quantity: str, paper: Mapping[str, float] | None = None
) -> dict[str, Any]:
    """Compare a quantity between successful and failed trials: means, 95 % intervals, Welch's test.

    Args:
        results: Of all cases; the trials of a case count as independent.
        quantity: Name of the measured quantity.
        paper: Its mean in the paper by outcome, if known.
    """
    groups: dict[str, list[float]] = {"success": [], "failure": []}
    for trial in (trial for result in results for trial in result.trials):
        if quantity in trial.measured:
            groups["success" if trial.success else "failure"].append(trial.measured[quantity])
    found: dict[str, Any] = {name: _mean(values) for name, values in groups.items() if values}
    for name in found:
        found[name] |= {"paper_mean": paper[name]} if paper else {}
    if all(len(values) > 1 and np.ptp(values) > 0 for values in groups.values()):
        test = ttest_ind(groups["success"], groups["failure"], equal_var=False)
        found["welch_p"] = float(np.asarray(test)[1])
    return found


def _mean(values: Sequence[float]) -> dict[str, Any]:
    """Return number, mean and, for more than one value, Student's 95 % interval."""
    mean = float(np.mean(values))
    found: dict[str, Any] = {"trials": len(values), "mean": mean}
    if len(values) > 1:
        half = student.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / len(values) ** 0.5
        found["interval"] = [mean - float(half), mean + float(half)]
    return found


def _plots(results: Sequence[CaseResult], push: bool) -> list[Picture]:
    plots = [("Success rate, with Wilson's 95 % interval", plot_rates(results))]
    if push:
        shear = plot_quantity(results, "push_shear_peak_N", "largest shear force [N]", 1.0)
        moved = plot_quantity(results, "displacement_m", "displacement of the jig [mm]", 1e3)
        plots += [("Largest shear force while pushing", shear), ("Displacement", moved)]
    else:
        depth = plot_quantity(results, "depth_m", "depth below the apex [mm]", 1e3)
        plots.append(("Depth of the lowest point", depth))
    return plots + [
        (f"{result.case.label}: {_meaning(result)}", plot_forces(result)) for result in results
    ]


def _meaning(result: CaseResult) -> str:
    case = result.case
    return case.posture.meaning + ("" if case.push is None else f", pushed {case.push.meaning}")


def case_table(command: str, results: Sequence[CaseResult]) -> Table:
    """Return the table for the terminal, no wider than 80 characters."""
    table = Table(title=f"Experiment: {command}", title_justify="left")
    columns = PUSH_COLUMNS if command == "push" else PLACE_COLUMNS
    quantities, headings, scales = zip(*columns, strict=True)
    for heading in ("case", "hits", "agrees", *map(escape, headings), escape("CPU [s]")):
        justify = "left" if heading == "case" else "right"
        table.add_column(heading, justify=justify, no_wrap=True)
    for result in results:
        values = [scale * result.values(q) for q, scale in zip(quantities, scales, strict=True)]
        cpu = np.mean([trial.trial.cpu_seconds for trial in result.trials])
        counts = f"{result.successes}/{len(result.trials)}"
        agrees = "yes" if result.agrees else "no"
        table.add_row(result.case.label, counts, agrees, *map(_spread, values), f"{cpu:.0f}")
    return table


def _spread(values: np.ndarray) -> str:
    """Return mean and standard deviation as text; only the mean if all values are equal."""
    if len(values) < 2 or np.ptp(values) == 0:
        return "".join(f"{value:.1f}" for value in values[:1])
    return f"{values.mean():.1f} ± {values.std(ddof=1):.1f}"
