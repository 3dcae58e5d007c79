"""``result.json``, ``log.npz``, ``report.html`` and saved states of a run."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from types import TracebackType
from typing import Any

from cell.errors import CellError
from cell.simulation.state import State
from experiments.assembly import figures
from experiments.assembly.job import Job
from experiments.assembly.pictures import Pictures
from experiments.assembly.resume import failed_state, resumable_state
from experiments.assembly.run import Run, StepResult
from experiments.reporting.output import write_arrays, write_json
from experiments.reporting.provenance import finite, versions
from experiments.reporting.quantities import shown_as
from experiments.reporting.report import write_report
from experiments.reporting.result_file import RESULT, ResultFile
from planning.assembly_plan.plan_file import plan_to_dict
from planning.assembly_plan.planner import FixingPlan
from planning.operations.operation import Step

STATE, FAILED_STATE, LOG, REPORT = "state.npz", "failed_state.npz", "log.npz", "report.html"
FILES = (RESULT, LOG, REPORT, STATE, FAILED_STATE)

REPEATED = "carried out again with fine time steps, as the solver failed at a coarse one."


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
        fixing: Its plan; None if nothing is planned.
        run: Where it begins.
        steps: All that it is to take, done or not.
    """

    def __init__(
        self, job: Job, fixing: FixingPlan | None, run: Run, steps: Sequence[Step]
    ) -> None:
        self.job, self.fixing, self.run, self.steps = job, fixing, run, steps
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
        # Replaced after the next step: not worth the time to compress it.
        write_arrays(self.job.out / STATE, self.state, compressed=False)
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
            plan={} if self.fixing is None else plan_to_dict(self.fixing),
            result=result,
            videos=pictures.videos,
            pictures=pictures.taken,
            timeline=figures.timeline(run, log),
            plots=figures.plots(run, log),
            notes=_notes(run, pictures),
            limits={step.name: step.limits for step in self.steps},
            phases=figures.phases(log),
        )
        # Last: whoever finds a verdict finds the rest, too.
        self.result.update(**result)
        _remove_former(job, RESULT, LOG, name, REPORT)


def _remove_former(job: Job, *own: str) -> None:
    """Remove the files of an earlier run that this one has not replaced."""
    for name in FILES:
        if name not in own:
            (job.out / name).unlink(missing_ok=True)


def _summary(job: Job, fixing: FixingPlan | None) -> dict[str, Any]:
    start = {} if job.start is None else {"start": job.start}
    return {
        "command": job.command,
        "product": job.product.name,
        "order": list((job.order or ()) if fixing is None else fixing.order),
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
        "recoveries": list(run.station.recoveries),
        "contact_links": simulation.cell.links.summary(simulation.root),
    }
    if run.failure is not None:
        failure = {"phase": run.failure.phase, "evidence": run.failure.evidence}
        course["failure"] = failure | {"state": FAILED_STATE}
    return course


def _step(step: StepResult) -> dict[str, Any]:
    return asdict(step) | {"failed_checks": [asdict(check) for check in step.failed_checks]}


def _notes(run: Run, pictures: Pictures) -> list[str]:
    notes = []
    if run.failure is not None:
        notes.append(f"Failed in '{run.failure.phase}': {run.failure.evidence}")
    notes += run.station.recoveries
    for step in run.steps:
        if step.repeated:
            notes.append(f"{step.name}: {REPEATED}")
        for check in step.failed_checks:
            shown = shown_as(check.quantity)
            part = check.quantity.rpartition("/")[0]
            notes.append(
                f"{step.name}: {f'{part} ' if part else ''}{shown.label} is "
                f"{shown.text(check.value)}, limit {shown.text(check.limit)}: {check.reason}"
            )
    if pictures.problem is not None:
        notes.append(f"No pictures: {pictures.problem}.")
    return notes
