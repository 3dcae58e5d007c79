"""Run steps one after another and keep what is measured of them; a failure becomes a verdict."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from cell.errors import InputError, RunFailure
from cell.simulation.phase import Outcome, Phase, PhaseFailed, SolverFailed
from cell.simulation.simulation import Simulation
from cell.simulation.state import State, read_state, restore_state, save_state
from experiments.assembly.prepare import RunningCell
from experiments.assembly.timeline import Timeline
from planning.operations.limits import FailedCheck
from planning.operations.measures import measure
from planning.operations.operation import PhaseRecord, Role, Step, StepRecord
from planning.operations.snapshot import take_snapshot
from planning.operations.station import Station

DONE = "operations_done"  # In a saved state: names of the steps before it.


@dataclass(frozen=True)
class StepResult:
    """How one step went.

    Attributes:
        name: For example "insert plate".
        operation: Name of its operation.
        verdict: "success" only if every phase ended as it should and every check holds.
        sim_seconds, cpu_seconds: Simulated time, and CPU time with planning in it [s].
        measured: Quantity -> value; SI units are in the names.
        failed_checks: What was measured outside of its limit.
        repeated: Whether it was carried out again with fine steps, as the solver failed at a coarse
            one.
    """

    name: str
    operation: str
    verdict: str
    sim_seconds: float
    cpu_seconds: float
    measured: dict[str, float]
    failed_checks: tuple[FailedCheck, ...]
    repeated: bool = False


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
    """A run of steps on one simulation.

    Attributes:
        running: The cell.
        watchers: Told of each phase before it starts and of each step when it is done.
        records: What was recorded of each step, in the same order as ``steps``.
        steps: Results so far.
        failure: Why it stopped, if it did.
        done: Names of the steps before this run.
        timeline: What each arm did in every phase that has ended.
    """

    running: RunningCell
    watchers: tuple[Watcher, ...] = ()
    records: list[StepRecord] = field(default_factory=list)
    steps: list[StepResult] = field(default_factory=list)
    failure: Failure | None = None
    done: tuple[str, ...] = ()
    timeline: Timeline = field(init=False)
    _phase: str = ""
    _start: State = field(default_factory=dict)
    _rejected: bool = False

    def __post_init__(self) -> None:
        self.timeline = Timeline(self.simulation.cell.arms)

    @property
    def simulation(self) -> Simulation:
        """That runs at present."""
        return self.running.simulation

    @property
    def station(self) -> Station:
        """The planner's view of it."""
        return self.running.station

    @property
    def verdict(self) -> str:
        """Return "success" if every step succeeded, else "failure"."""
        return "success" if all(step.verdict == "success" for step in self.steps) else "failure"

    def run(self, steps: Sequence[Step]) -> None:
        """Run the steps in order, up to the first one that cannot be carried through.

        A step that ends with a check outside of its limit does not stop the run: what comes after
        it is worth knowing.
        """
        for step in steps:
            result = self._step(step)
            self.steps.append(result)
            for watcher in self.watchers:
                watcher.step(result)
            if self.failure is not None:
                return
        self.running.go_on()

    def _step(self, step: Step) -> StepResult:
        started = time.process_time()
        record = self._record(step)
        self.records.append(record)
        self.running.go_on(step.operation)
        state, mark, bars = save_run(self), self.simulation.log.mark(), len(self.timeline.bars)
        self._carry_out(record)
        repeated = self._rejected and self.running.coarse
        if repeated:
            restore_state(self.simulation, state)
            self.station.restore(state)
            self.simulation.log.cut(mark)
            del self.timeline.bars[bars:]
            record.phases.clear()
            self.failure = None
            self.running.go_on()
            self._carry_out(record)
        simulation, station = self.simulation, self.station
        record.end = take_snapshot(simulation)
        record.placement = station.placements.get(step.parts[0])
        measured = measure(simulation.cell, record, simulation.log.arrays())
        failed = step.failed_checks(measured) if self.failure is None else ()
        return StepResult(
            step.name,
            step.operation.name,
            "failure" if self.failure or failed else "success",
            record.end.time - record.start.time,
            time.process_time() - started,
            measured,
            failed,
            repeated,
        )

    def _carry_out(self, record: StepRecord) -> None:
        """Run the phases of a step; keep why they ended early, if they did."""
        self._rejected = False
        try:
            self.simulation.run(self._watched(record))
        except PhaseFailed as error:
            self.failure = Failure(error.phase, error.evidence, self._start)
            self._rejected = isinstance(error, SolverFailed)
        except RunFailure as error:
            # A motion that cannot be planned is a verdict on the run, not bad input.
            self.failure = Failure(self._phase, str(error), self._start)

    def _record(self, step: Step) -> StepRecord:
        now, station = take_snapshot(self.simulation), self.station
        record = StepRecord(step, now, origin=station.origins.get(step.parts[0]))
        if station.fixed:
            record.base, record.placed = station.fixed[0], now
            for earlier in self.records:
                # The latest part that was placed, in this run or before it.
                if earlier.step.operation.role is Role.FIX:
                    record.placed = earlier.end
                elif record.placed is now:
                    record.placed = earlier.start
        return record

    def _watched(self, record: StepRecord) -> Generator[Phase, Outcome, None]:
        """Yield the phases of a step on, with a record of each."""
        pending = record.step.phases(self.station)
        outcome: Outcome | None = None
        while True:
            self._start = save_run(self)
            self._phase = f"{record.step.name}: plan the next motion"
            try:
                phase = next(pending) if outcome is None else pending.send(outcome)
            except StopIteration:
                return
            self._phase = phase.name
            for watcher in self.watchers:
                watcher.phase(phase.name)
            start, in_hand = take_snapshot(self.simulation), self.station.in_hand
            outcome = yield phase
            end = take_snapshot(self.simulation)
            self.timeline.add(record.step.name, phase, in_hand, (start.time, end.time))
            record.phases[phase.subject, phase.kind] = PhaseRecord(
                start, end, outcome.peak_force, phase.awake
            )


def save_run(run: Run) -> State:
    """Return the state of the simulation and all that the planner remembers."""
    return {**save_state(run.simulation), **run.station.save()}


def go_on(run: Run, steps: Sequence[Step], state: State) -> list[Step]:
    """Put a fresh run where an earlier one ended; return the steps that are left.

    Args:
        run: Of the same product, with the same configuration and seed.
        steps: All steps of the plan.
        state: As `final_state` returned it.

    Raises:
        InputError: The state is not that after the first steps.
    """
    done = [str(name) for name in state[DONE]]
    if done != [step.name for step in steps[: len(done)]]:
        raise InputError(
            f"The saved state is after {', '.join(done) or 'no operation'}; "
            f"the plan begins with {', '.join(step.name for step in steps)}."
        )
    restore_state(run.simulation, state)
    run.station.restore(state)
    run.done = tuple(done)
    return list(steps[len(done) :])


def read_final_state(path: Path) -> State:
    """Read what `final_state` returned, from a file.

    Raises:
        InputError: It cannot be read, or is something else.
    """
    state = read_state(path)
    if DONE not in state:
        raise InputError(f"'{path}' is not the state.npz that a run ends with.")
    return state


def final_state(run: Run) -> State:
    """Return the state that a run ended in, and the names of the steps that led to it."""
    names = [*run.done, *(step.name for step in run.steps)]
    return {**save_run(run), DONE: np.array(names, dtype=str)}
