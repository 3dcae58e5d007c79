"""Run operations one after another and keep what metrics need; a failure becomes a verdict."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, cast
from zipfile import BadZipFile

import numpy as np
from pydrake.math import RigidTransform

from cell.errors import CellError
from cell.simulation.phase import Outcome, Phase, PhaseFailed
from cell.simulation.simulation import Simulation
from cell.simulation.state import State, read_state, restore_state, save_state
from experiments.metrics.criteria import FailedCheck, failed_checks
from experiments.metrics.measure import measure
from experiments.metrics.record import OperationRecord, PhaseRecord
from experiments.metrics.snapshot import take_snapshot
from planning.operations.carry_out import phases
from planning.operations.sequence import Operation, fixed_after
from planning.operations.station import Station

DONE = "operations_done"  # In a saved state: names of the operations before it.
ORIGIN = "origin/"  # In a saved state: before the name of a part, where it was taken from.


@dataclass(frozen=True)
class StepResult:
    """How one operation went.

    Attributes:
        name: For example "insert plate".
        operation: Kind of the operation.
        verdict: "success" only if every phase ended as it should and every check holds.
        sim_seconds, cpu_seconds: Simulated time, and CPU time with planning in it [s].
        measured: Quantity -> value; SI units are in the names.
        failed_checks: What was measured outside of its limit.
    """

    name: str
    operation: str
    verdict: str
    sim_seconds: float
    cpu_seconds: float
    measured: dict[str, float]
    failed_checks: tuple[FailedCheck, ...]


@dataclass(frozen=True)
class Failure:
    """Why a run stopped early.

    Attributes:
        phase: The phase that failed, or before whose start no motion was found.
        evidence: Why, in one line.
        state: The saved state at the start of that phase.
    """

    phase: str
    evidence: str
    state: State


class Watcher(Protocol):
    """Follows a run."""

    def phase(self, name: str) -> None:
        """Take note of a phase that is about to start."""

    def step(self, step: StepResult) -> None:
        """Take note of a step that is done, well or not."""


@dataclass
class Run:
    """A run of operations on one simulation.

    Attributes:
        simulation: The running cell.
        station: The planner's view of it.
        watchers: Told of each phase before it starts and of each step when it is done.
        records: What was recorded of each operation, in the same order as ``steps``.
        steps: Results so far.
        failure: Why it stopped, if it did.
        done: Names of the operations before this run.
    """

    simulation: Simulation
    station: Station
    watchers: tuple[Watcher, ...] = ()
    records: list[OperationRecord] = field(default_factory=list)
    steps: list[StepResult] = field(default_factory=list)
    failure: Failure | None = None
    done: tuple[str, ...] = ()
    _phase: str = ""
    _start: State = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """Return "success" if every step succeeded, else "failure"."""
        return "success" if all(step.verdict == "success" for step in self.steps) else "failure"

    def run(self, operations: Sequence[Operation]) -> None:
        """Run the operations in order, up to the first one that cannot be carried through.

        An operation that ends with a check outside of its limit does not stop the run: what comes
        after it is worth knowing.
        """
        for operation in operations:
            step = self._step(operation)
            self.steps.append(step)
            for watcher in self.watchers:
                watcher.step(step)
            if self.failure is not None:
                return

    def _step(self, operation: Operation) -> StepResult:
        simulation, started = self.simulation, time.process_time()
        record = self._record(operation)
        self.records.append(record)
        try:
            simulation.run(self._watched(record))
        except PhaseFailed as error:
            self.failure = Failure(error.phase, error.evidence, self._start)
        except CellError as error:
            # A motion that cannot be planned is a verdict on the run, not bad input.
            self.failure = Failure(self._phase, str(error), self._start)
        record.end = take_snapshot(simulation)
        measured = measure(simulation.cell, record, simulation.log.arrays())
        failed = failed_checks(operation, measured) if self.failure is None else ()
        return StepResult(
            operation.name,
            operation.kind,
            "failure" if self.failure or failed else "success",
            record.end.time - record.start.time,
            time.process_time() - started,
            measured,
            failed,
        )

    def _record(self, operation: Operation) -> OperationRecord:
        now = take_snapshot(self.simulation)
        origin = self.station.origins.get(operation.parts[0])
        if not self.station.fixed:
            return OperationRecord(operation, now, origin=origin)
        placed = now
        for record in self.records:
            # The latest part that was placed, in this run or before it.
            if record.operation.kind == "pick_place":
                placed = record.end
            elif placed is now:
                placed = record.start
        return OperationRecord(operation, now, self.station.fixed[0], placed, origin)

    def _watched(self, record: OperationRecord) -> Generator[Phase, Outcome, None]:
        """Yield the phases of an operation on, with a record of each."""
        pending = cast(Generator[Phase, Outcome, None], phases(self.station, record.operation))
        outcome: Outcome | None = None
        while True:
            self._start = save_state(self.simulation)
            self._phase = f"{record.operation.name}: plan the next motion"
            try:
                phase = next(pending) if outcome is None else pending.send(outcome)
            except StopIteration:
                return
            self._phase = phase.name
            for watcher in self.watchers:
                watcher.phase(phase.name)
            start = take_snapshot(self.simulation)
            outcome = yield phase
            end = take_snapshot(self.simulation)
            record.phases[phase.name] = PhaseRecord(start, end, outcome.peak_force, phase.awake)


def go_on(run: Run, operations: Sequence[Operation], state: State) -> list[Operation]:
    """Put a fresh run where an earlier one ended; return the operations that are left.

    Args:
        run: Of the same product, with the same configuration and seed.
        operations: All operations of the plan.
        state: As `final_state` returned it.
    """
    done = [str(name) for name in state[DONE]]
    if done != [operation.name for operation in operations[: len(done)]]:
        raise CellError(
            f"The saved state is after {', '.join(done) or 'no operation'}; "
            f"the plan begins with {', '.join(operation.name for operation in operations)}."
        )
    restore_state(run.simulation, state)
    run.done = tuple(done)
    for operation in operations[: len(done)]:
        run.station.fixed = fixed_after(run.station.cell.product, run.station.fixed, operation)
    run.station.origins = {
        name.removeprefix(ORIGIN): RigidTransform(X_WP)
        for name, X_WP in state.items()
        if name.startswith(ORIGIN)
    }
    return list(operations[len(done) :])


def read_final_state(path: Path) -> State:
    """Read what `final_state` returned, from a file."""
    try:
        state = read_state(path)
    except (OSError, ValueError, BadZipFile) as error:
        raise CellError(f"Cannot read the saved state '{path}': {error}.") from error
    if DONE not in state:
        raise CellError(f"'{path}' is not the state.npz that a run ends with.")
    return state


def final_state(run: Run) -> State:
    """Return the state that a run ended in, the operations that led to it, and what is known."""
    names = [*run.done, *(step.name for step in run.steps)]
    origins = {f"{ORIGIN}{name}": X_WP.GetAsMatrix4() for name, X_WP in run.station.origins.items()}
    return {**save_state(run.simulation), **origins, DONE: np.array(names, dtype=str)}
