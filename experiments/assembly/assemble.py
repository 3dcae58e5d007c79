"""``soft-jig assemble``: plan a product, then assemble it in the twin, measured and reported."""

from __future__ import annotations

from rich.console import Console

from cell.errors import InputError
from experiments.assembly.job import Job
from experiments.assembly.pictures import Pictures
from experiments.assembly.prepare import RunningCell
from experiments.assembly.progress import Progress, result_table
from experiments.assembly.replay import Replay
from experiments.assembly.results import Keeper, write_infeasible
from experiments.assembly.resume import go_on, read_resumable
from experiments.assembly.run import Run
from planning.assembly_plan.explain import stop_text
from planning.assembly_plan.planner import FixingPlan, plan
from planning.operations.operation import NoOperation, Step
from planning.operations.sequence import steps


def run_job(job: Job) -> int:
    """Plan, run, measure and report; write result, log and report.

    Returns:
        0 if the whole assembly succeeded, else 1.

    Raises:
        InputError: Product, order or state cannot be used; nothing is written.
    """
    console = Console(quiet=job.quiet, highlight=False)
    job.product.check_simulable()
    start = None if job.start is None else read_resumable(job.start)
    fixing = plan(job.product, job.order, config=job.config)
    try:
        todo = _steps(job, fixing)
    except NoOperation as reason:
        console.print(str(reason), markup=False, soft_wrap=True)
        write_infeasible(job, fixing, str(reason))
        return 1
    replay = Replay(view=job.view, file=job.replay)
    if replay.url:
        console.print(f"Watch at {replay.url}", soft_wrap=True)
    run = Run(RunningCell(job.product, job.config, job.seed, replay))
    if start is not None:
        todo = go_on(run, todo, start)
    pictures = Pictures(run.running)
    progress = Progress(console, [step.name for step in todo])
    with Keeper(job, fixing, run) as keeper:
        with progress:
            run.watchers = (keeper, progress, pictures)
            run.run(todo)
        replay.save()
        keeper.finish(pictures)
    console.print(result_table(run.steps))
    if run.failure is not None:
        text = f"Failed in '{run.failure.phase}': {run.failure.evidence}"
        console.print(text, markup=False, soft_wrap=True)
    return 0 if run.verdict == "success" else 1


def _steps(job: Job, fixing: FixingPlan) -> list[Step]:
    """Return the steps of a feasible plan, up to the first of the operation wanted last.

    Raises:
        InputError: No step of the plan has the operation wanted last.
        NoOperation: The plan is infeasible, or no operation carries it out.
    """
    if fixing.stop is not None:
        raise NoOperation(stop_text(fixing))
    todo = steps(job.product, fixing)
    operations = [step.operation for step in todo]
    if job.last is None:
        return todo
    if job.last not in operations:
        known = ", ".join(dict.fromkeys(operation.name for operation in operations))
        raise InputError(f"The plan has no step with '{job.last.name}'. Its operations: {known}.")
    return todo[: operations.index(job.last) + 1]
