"""``soft-jig assemble``: plan a product, then assemble it in the twin, measured and reported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from rich.console import Console

from cell.errors import InputError
from experiments.assembly.custom_fixture import with_fixture_for
from experiments.assembly.film import Film
from experiments.assembly.films import write_films
from experiments.assembly.job import Job
from experiments.assembly.pictures import Pictures
from experiments.assembly.prepare import RunningCell
from experiments.assembly.program_files import write_program
from experiments.assembly.progress import Progress, result_table
from experiments.assembly.recording import check_recordable
from experiments.assembly.replay import Replay
from experiments.assembly.results import Keeper, write_infeasible
from experiments.assembly.resume import go_on, read_resumable
from experiments.assembly.run import Run
from planning.assembly_plan.explain import stop_text
from planning.assembly_plan.planner import FixingPlan, plan
from planning.operations.operation import NoOperation, Step
from planning.operations.program import Program, Transcript
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
    if job.record is not None:
        check_recordable()
    if job.program is not None and job.start is not None:
        raise InputError("A program begins with the first step: leave out --program or --start.")
    start = None if job.start is None else read_resumable(job.start)
    fixing = plan(job.product, job.order, config=job.config)
    try:
        todo = planned = _steps(job, fixing)
    except NoOperation as reason:
        console.print(str(reason), markup=False, soft_wrap=True)
        write_infeasible(job, fixing, str(reason))
        return 1
    job = replace(job, config=with_fixture_for(job.config, job.product, job.seed, todo))
    replay = Replay(view=job.view, file=job.replay)
    if replay.url:
        console.print(f"Watch at {replay.url}", soft_wrap=True)
    film = Film() if job.record or job.video else None
    run = Run(RunningCell(job.product, job.config, job.seed, replay, film))
    if start is not None:
        todo = go_on(run, todo, start)
    transcript = Transcript(job.product)
    if job.program is not None:
        todo = [transcript.of(step) for step in todo]
    code = _carry_out(job, run, todo, fixing, planned)
    if job.program is not None:
        problem = write_program(job.program, job, fixing.order, run, transcript)
        if problem is not None:
            console.print(f"No program: {problem}.", markup=False, soft_wrap=True)
    return code


def run_program(job: Job, data: Mapping[str, Any]) -> int:
    """Carry out a program in the twin; write result, log and report.

    Args:
        job: Its product, configuration and seed.
        data: Of the program.

    Returns:
        0 if everything succeeded, else 1.

    Raises:
        InputError: It is the program of another product; nothing is written.
    """
    job.product.check_simulable()
    todo = Program(job.product, data).steps()
    run = Run(RunningCell(job.product, job.config, job.seed))
    if run.simulation.identity["product"] != data["identity"]:
        raise InputError(
            f"The program is of another product: {data['identity']}, "
            f"not {run.simulation.identity['product']}."
        )
    return _carry_out(job, run, todo, None, todo)


def _carry_out(
    job: Job, run: Run, todo: Sequence[Step], fixing: FixingPlan | None, steps: Sequence[Step]
) -> int:
    """Run the steps that are left of all, keep what they leave behind, and say how they went.

    Returns:
        The exit code.
    """
    console, pictures = Console(quiet=job.quiet, highlight=False), Pictures(run.running)
    progress, running = Progress(console, [step.name for step in todo]), run.running
    with Keeper(job, fixing, run, steps) as keeper:
        with progress:
            run.watchers = (keeper, progress, pictures)
            run.run(todo)
        if running.replay is not None:
            running.replay.save()
        if running.film is not None:
            write_films(job, run, running.film, pictures)
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
