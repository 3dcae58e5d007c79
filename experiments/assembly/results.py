"""``result.json``, ``log.npz``, ``report.html`` and saved states of a run."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict
from types import TracebackType
from typing import Any

from cell.errors import CellError
from cell.simulation.state import State
from experiments.assembly.job import Job
from experiments.assembly.pictures import Pictures
from experiments.assembly.resume import failed_state, resumable_state
from experiments.assembly.run import Run, StepResult
from experiments.assembly.timeline import fixture_bars
from experiments.reporting.gantt import plot_bars
from experiments.reporting.html_page import Picture
from experiments.reporting.output import write_arrays, write_json
from experiments.reporting.plots import draw, plot_force_plate
from experiments.reporting.provenance import finite, versions
from experiments.reporting.report import write_report
from experiments.reporting.result_file import RESULT, ResultFile
from planning.assembly_plan.plan_file import plan_to_dict
from planning.assembly_plan.planner import FixingPlan
from planning.operations.operation import Arrays
from planning.operations.phase_class import PhaseClass

STATE, FAILED_STATE, LOG, REPORT = "state.npz", "failed_state.npz", "log.npz", "report.html"
FILES = (RESULT, LOG, REPORT, STATE, FAILED_STATE)

REPEATED = "carried out again with fine time steps, as the solver failed at a coarse one."
ASLEEP = "A part that rests while nothing touches it sleeps: the force plate does not feel it then."


def write_infeasible(job: Job, fixing: FixingPlan, reason: str) -> None:
    """Write the result of an order that cannot be carried out."""
    result = _summary(job, fixing) | {
        "verdict": "failure",
        "steps": [],
        "failure": {"phase": "plan", "evidence": reason},
    }
    write_json(job.out / RESULT, result)
    _remove_former(job, RESULT)


class Keeper:
    """Keeps what a run has done, while it goes on: a watcher, and a context around the run.

    After every step the state is written and then the result, which names the state. What ends the
    run early finds both there, and the log is written, too.

    Args:
        job: What was asked for.
        fixing: Its plan.
        run: Where it begins.
    """

    def __init__(self, job: Job, fixing: FixingPlan, run: Run) -> None:
        self.job, self.fixing, self.run = job, fixing, run
        self.result = ResultFile(job.out, _summary(job, fixing))
        self.state: State = {}
        self._phase = ""

    def __enter__(self) -> Keeper:
        # The larger file first: if the disk is full, the former result stays.
        self._keep()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is not None:
            self.result.content["phase"] = self._phase
        self.result.__exit__(kind, error, traceback)
        if error is not None:
            with suppress(CellError):
                log = self.run.simulation.log.arrays()
                write_arrays(self.job.out / LOG, log, compressed=False)

    def phase(self, name: str) -> None:
        """Take note of a phase that is about to start."""
        self._phase = name

    def step(self, step: StepResult) -> None:
        """Write state and result after a step."""
        if self.run.failure is None:
            self._keep()

    def _keep(self) -> None:
        self.state = resumable_state(self.run)
        write_arrays(self.job.out / STATE, self.state)
        self.result.update(state=STATE, **_course(self.run))

    def finish(self, pictures: Pictures) -> None:
        """Write everything that a run leaves behind; remove what an earlier one has left."""
        job, run = self.job, self.run
        log = run.simulation.log.arrays()
        if run.failure is None:
            name, state = STATE, resumable_state(run)
        else:
            name, state = FAILED_STATE, failed_state(self.state, run)
        write_arrays(job.out / LOG, log)
        write_arrays(job.out / name, state)
        result = self.result.content | _course(run) | {"state": name, "verdict": run.verdict}
        write_report(
            job.out / REPORT,
            title=f"{job.product.name}: {job.command}",
            plan=plan_to_dict(self.fixing),
            result=result,
            pictures=pictures.taken,
            timeline=_timeline(run, log),
            plots=_plots(run, log),
            notes=_notes(run, pictures),
        )
        # Last: whoever finds a verdict finds the rest, too.
        self.result.update(**result)
        _remove_former(job, RESULT, LOG, name, REPORT)


def _remove_former(job: Job, *own: str) -> None:
    """Remove the files of an earlier run that this one has not replaced."""
    for name in FILES:
        if name not in own:
            (job.out / name).unlink(missing_ok=True)


def _summary(job: Job, fixing: FixingPlan) -> dict[str, Any]:
    start = {} if job.start is None else {"start": job.start}
    return {
        "command": job.command,
        "product": job.product.name,
        "order": list(fixing.order),
        "seed": job.seed,
        "verdict": "running",
        "config": finite(job.config.to_dict()),
        "versions": versions(),
        **start,
    }


def _course(run: Run) -> dict[str, Any]:
    """Return what ``result.json`` says of the course of a run so far."""
    simulation = run.simulation
    seconds = simulation.time - run.began
    course = {
        "steps": [_step(step) for step in run.steps],
        "real_time_factor": seconds / max(simulation.stepping_cpu, 1e-9),
        "sim_seconds": seconds,
        "disturbance": asdict(run.running.disturbance),
        "contact_links": simulation.cell.links.summary(simulation.root),
    }
    if run.failure is not None:
        failure = {"phase": run.failure.phase, "evidence": run.failure.evidence}
        course["failure"] = failure | {"state": FAILED_STATE}
    return course


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
