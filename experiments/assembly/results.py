"""``result.json``, ``log.npz``, ``report.html`` and saved states of a run."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from cell.simulation.state import State
from experiments.assembly.job import Job
from experiments.assembly.pictures import Pictures
from experiments.assembly.run import Run, StepResult, final_state
from experiments.assembly.timeline import fixture_bars
from experiments.reporting.gantt import plot_bars
from experiments.reporting.html_page import Picture
from experiments.reporting.output import write_arrays, write_json
from experiments.reporting.plots import draw, plot_force_plate
from experiments.reporting.provenance import finite, versions
from experiments.reporting.report import write_report
from planning.assembly_plan.plan_file import plan_to_dict
from planning.assembly_plan.planner import FixingPlan
from planning.operations.operation import Arrays
from planning.operations.phase_class import PhaseClass

FILES = ("result.json", "log.npz", "report.html", "state.npz", "failed_state.npz")

REPEATED = "carried out again with fine time steps, as the solver failed at a coarse one."
ASLEEP = "A part that rests while nothing touches it sleeps: the force plate does not feel it then."


def write_infeasible(job: Job, fixing: FixingPlan, reason: str) -> None:
    """Write the result of an order that cannot be carried out."""
    _remove_former(job)
    result = _summary(job, fixing, "failure") | {
        "steps": [],
        "failure": {"phase": "plan", "evidence": reason},
    }
    write_json(job.out / "result.json", result)


def write_results(job: Job, fixing: FixingPlan, run: Run, pictures: Pictures) -> None:
    """Write everything that a run leaves behind."""
    _remove_former(job)
    result = _result(job, fixing, run)
    log = run.simulation.log.arrays()
    write_arrays(job.out / "log.npz", log)
    if run.failure is None:
        _write_state(job, "state.npz", final_state(run))
    else:
        _write_state(job, "failed_state.npz", run.failure.state)
    write_report(
        job.out / "report.html",
        title=f"{job.product.name}: {job.command}",
        plan=plan_to_dict(fixing),
        result=result,
        pictures=pictures.taken,
        timeline=_timeline(run, log),
        plots=_plots(run, log),
        notes=_notes(run, pictures),
    )
    # Last: whoever finds it finds the rest, too.
    write_json(job.out / "result.json", result)


def _remove_former(job: Job) -> None:
    """An earlier run's files must not be taken for this one's."""
    for name in FILES:
        (job.out / name).unlink(missing_ok=True)


def _write_state(job: Job, name: str, state: State) -> None:
    write_arrays(job.out / name, state)


def _summary(job: Job, fixing: FixingPlan, verdict: str) -> dict[str, Any]:
    return {
        "command": job.command,
        "product": job.product.name,
        "order": list(fixing.order),
        "seed": job.seed,
        "verdict": verdict,
        "config": finite(job.config.to_dict()),
        "versions": versions(),
    }


def _result(job: Job, fixing: FixingPlan, run: Run) -> dict[str, Any]:
    simulation = run.simulation
    began = run.records[0].start.time if run.records else 0.0
    result = _summary(job, fixing, run.verdict) | {
        "steps": [_step(step) for step in run.steps],
        "real_time_factor": (simulation.time - began) / max(simulation.stepping_cpu, 1e-9),
        "sim_seconds": simulation.time - began,
        "disturbance": asdict(run.running.disturbance),
        "contact_links": simulation.cell.links.summary(simulation.root),
    }
    if run.failure is not None:
        result["failure"] = {
            "phase": run.failure.phase,
            "evidence": run.failure.evidence,
            "state": "failed_state.npz",
        }
    return result


def _step(step: StepResult) -> dict[str, Any]:
    return asdict(step) | {"failed_checks": [asdict(check) for check in step.failed_checks]}


def _notes(run: Run, pictures: Pictures) -> list[str]:
    notes = [ASLEEP]
    if run.failure is not None:
        notes.append(f"Failed in '{run.failure.phase}': {run.failure.evidence}")
    for step in run.steps:
        if step.repeated:
            notes.append(f"{step.name}: {REPEATED}")
        for check in step.failed_checks:
            value = "not measured" if check.value is None else f"{check.value:.4g}"
            notes.append(
                f"{step.name}: {check.quantity} is {value}, limit {check.limit:.4g}: {check.reason}"
            )
    if pictures.problem is not None:
        notes.append(f"No pictures: {pictures.problem}.")
    return notes


def _timeline(run: Run, log: Arrays) -> list[Picture]:
    bars = run.timeline.bars
    if not bars:
        return []
    bars = [*bars, *fixture_bars(log, bars)]
    return [("Arms and fixture", plot_bars(bars, [kind.value for kind in PhaseClass]))]


def _plots(run: Run, log: Arrays) -> list[Picture]:
    if "time" not in log:
        return []
    starts = [(record.step.name, record.start.time) for record in run.records]
    force = log["force_plate"][:, 3:] - log["force_plate"][0, 3:]
    plots = [("Force plate", plot_force_plate(log["time"], force, starts))]
    for record in run.records:
        for plot in record.step.operation.plots(run.simulation.cell, record, log):
            plots.append((plot.caption, draw(plot)))
    return plots
