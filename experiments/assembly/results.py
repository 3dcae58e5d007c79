"""``result.json``, ``log.npz``, ``report.html`` and saved states of a run."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from cell.simulation.state import State
from experiments.assembly.job import Job
from experiments.assembly.pictures import Pictures
from experiments.assembly.prepare import Disturbance
from experiments.assembly.run import Run, StepResult, final_state
from experiments.metrics.bolts import thread_curve
from experiments.metrics.insert import INSERTION_PHASES, insertion_curve
from experiments.metrics.record import Arrays, OperationRecord, rows_of
from experiments.reporting.html_page import Picture
from experiments.reporting.output import write_arrays, write_json
from experiments.reporting.plots import plot_force_plate, plot_insertion_force, plot_torque
from experiments.reporting.provenance import finite, versions
from experiments.reporting.report import write_report
from planning.assembly_plan.plan_file import plan_to_dict
from planning.assembly_plan.planner import FixingPlan

FILES = ("result.json", "log.npz", "report.html", "state.npz", "failed_state.npz")

LAST = np.pi / 4  # The tightening takes place within this angle before the trip [rad].
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
        "disturbance": asdict(Disturbance.draw(job.config, job.seed)),
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
        for check in step.failed_checks:
            value = "not measured" if check.value is None else f"{check.value:.4g}"
            notes.append(
                f"{step.name}: {check.quantity} is {value}, limit {check.limit:.4g}: {check.reason}"
            )
    if pictures.problem is not None:
        notes.append(f"No pictures: {pictures.problem}.")
    return notes


def _plots(run: Run, log: Arrays) -> list[Picture]:
    if "time" not in log:
        return []
    starts = [(record.operation.name, record.start.time) for record in run.records]
    force = log["force_plate"][:, 3:] - log["force_plate"][0, 3:]
    plots = [("Force plate", plot_force_plate(log["time"], force, starts))]
    for record in run.records:
        fit = record.operation.fit
        if fit is not None and record.named(fit.hole, *INSERTION_PHASES):
            depth, force = insertion_curve(run.simulation.cell, record, log)
            limit = run.station.config.insertion.force_limit
            plots.append((record.operation.name, plot_insertion_force(depth, force, limit)))
        if record.operation.kind == "tighten_bolts":
            plots += _torque_plots(run, record, log)
    return plots


def _torque_plots(run: Run, record: OperationRecord, log: Arrays) -> list[Picture]:
    """Return torque over angle from the catch of the thread, and the end of it, from the trip."""
    angles: dict[str, np.ndarray] = {}
    torques: dict[str, np.ndarray] = {}
    for bolt in record.operation.parts:
        phases = record.named(bolt, "run down", "tighten")
        if len(phases) == 2:
            rows = rows_of(log, phases)
            angles[bolt], _, clamp = thread_curve(run.simulation.cell, bolt, rows)
            torques[bolt] = rows["spindle_torque"][-len(clamp) :]
    if not angles:
        return []
    fasteners = run.station.cell.product.fasteners
    target = fasteners[record.operation.parts[0]].torque
    whole = {bolt: angle - angle[0] for bolt, angle in angles.items()}
    last = {bolt: (angle - angle[-1])[angle > angle[-1] - LAST] for bolt, angle in angles.items()}
    ends = {bolt: torques[bolt][-len(angle) :] for bolt, angle in last.items()}
    return [
        ("Tightening, from the thread's catch", plot_torque(whole, torques, target)),
        ("Tightening, up to the clutch's trip", plot_torque(last, ends, target)),
    ]
