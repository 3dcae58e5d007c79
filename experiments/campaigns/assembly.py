"""The experiment "assemble": a trial is one whole assembly, or one up to an operation."""

from __future__ import annotations

from cell.errors import InputError
from cell.products.loading import load_product
from experiments.assembly.custom_fixture import with_fixture_for
from experiments.assembly.prepare import RunningCell
from experiments.assembly.resume import failed_state, resumable_state
from experiments.assembly.run import Run, StepResult
from experiments.campaigns.trial import Outcome, Task
from experiments.reporting.output import write_arrays
from planning.assembly_plan.explain import stop_text
from planning.assembly_plan.planner import plan
from planning.operations.operation import NoOperation, Step
from planning.operations.registry import operation_named
from planning.operations.sequence import steps


def assemble(task: Task, *, order: str = "", last: str = "") -> Outcome:
    """Plan and assemble a product.

    A run that fails leaves a state to go on from, as `soft-jig assemble` does: ``failed_state.npz``
    if a phase failed, ``state.npz`` if something was measured outside of its limit.

    Args:
        task: Product, configuration, seed.
        order: Parts or groups, separated by commas; "" for the product's first one.
        last: Name of the operation to stop after; "" for the whole assembly.
    """
    product = load_product(task.product)
    product.check_simulable()
    wanted = tuple(item.strip() for item in order.split(",")) if order else None
    fixing = plan(product, wanted, config=task.config)
    if fixing.stop is not None:
        return Outcome(False, phase="plan", evidence=stop_text(fixing))
    try:
        todo = _up_to(steps(product, fixing), last)
    except NoOperation as reason:
        return Outcome(False, phase="plan", evidence=str(reason))
    try:
        config = with_fixture_for(task.config, product, task.seed, todo)
    except InputError as reason:  # It cannot hold what the plan fixes.
        return Outcome(False, phase="plan", evidence=str(reason))
    run = Run(RunningCell(product, config, task.seed))
    before = _BeforeStep(run)
    run.watchers = (before,)
    run.run(todo)
    if run.failure is not None:
        write_arrays(task.file("failed_state.npz"), failed_state(before.state, run))
    elif run.verdict != "success":
        write_arrays(task.file("state.npz"), resumable_state(run))
    return outcome_of(run)


class _BeforeStep:
    """Keeps the state before the present step of a run, from which it can be run again."""

    def __init__(self, run: Run) -> None:
        self.run, self.state = run, resumable_state(run)

    def phase(self, name: str) -> None:
        """Phases do not matter."""

    def step(self, step: StepResult) -> None:
        """Take the state after a step that was carried through."""
        if self.run.failure is None:
            self.state = resumable_state(self.run)


def _up_to(todo: list[Step], last: str) -> list[Step]:
    """Return the steps up to the first with an operation; all if there is none of that name."""
    if not last:
        return todo
    operations = [step.operation for step in todo]
    wanted = operation_named(last)
    return todo[: operations.index(wanted) + 1] if wanted in operations else todo


def outcome_of(run: Run) -> Outcome:
    """Return what came out of a run; the name of a quantity begins with that of its step."""
    measured = {
        f"{step.name}/{name}": value for step in run.steps for name, value in step.measured.items()
    }
    phase, evidence = "", ""
    if run.failure is not None:
        phase, evidence = run.failure.phase, run.failure.evidence
    elif run.verdict != "success":
        step = next(step for step in run.steps if step.verdict != "success")
        phase, evidence = f"{step.name}: checks", _failed_checks(step)
    return Outcome(run.verdict == "success", measured, phase, evidence)


def _failed_checks(step: StepResult) -> str:
    texts = []
    for check in step.failed_checks:
        value = "not measured" if check.value is None else f"{check.value:.4g}"
        texts.append(f"{check.quantity} is {value}, limit {check.limit:.4g}: {check.reason}")
    return "; ".join(texts)
