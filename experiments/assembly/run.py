"""Run steps one after another and keep what is measured of them; a failure becomes a verdict."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from cell.errors import RunFailure
from cell.simulation.phase import Outcome, Phase, PhaseFailed, SolverFailed
from cell.simulation.simulation import Simulation
from cell.simulation.state import State
from experiments.assembly.prepare import RunningCell
from experiments.assembly.timeline import Timeline
from planning.operations.limits import FailedCheck
from planning.operations.measures import measure
from planning.operations.operation import PhaseRecord, Role, Step, StepRecord
from planning.operations.snapshot import Snapshot, take_snapshot
from planning.operations.station import Station


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
        records: What was recorded of each step of this run.
        steps: Results so far, first those of an earlier run that this one goes on from.
        failure: Why it stopped, if it did.
        placed: The truth when the part on the fixture was put there, if that was in an earlier run.
        began: Simulated time at the start of the first step [s].
        timeline: What each arm did in every phase that has ended.
    """

    running: RunningCell
    watchers: tuple[Watcher, ...] = ()
    records: list[StepRecord] = field(default_factory=list)
    steps: list[StepResult] = field(default_factory=list)
    failure: Failure | None = None
    placed: Snapshot | None = None
    began: float = 0.0
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
            if not self.steps:
                self.began = self.simulation.time
            result = self._step(step)
            self.steps.append(result)
            for watcher in self.watchers:
                watcher.step(result)
            if self.failure is not None:
                return
        self.running.go_on()

    def latest_placed(self) -> Snapshot | None:
        """Return the truth when the latest part had been put on the fixture.

        If that was before the first step there is: when the first step began.
        """
        for record in reversed(self.records):
            if record.step.operation.role is Role.FIX and record.end is not None:
                return record.end
        if self.placed is None and self.records:
            return self.records[0].start
        return self.placed

    def _step(self, step: Step) -> StepResult:
        started = time.process_time()
        record = self._record(step)
        self.records.append(record)
        self.running.go_on(step.operation)
        state = self.running.save()
        mark, bars = self.simulation.log.mark(), len(self.timeline.bars)
        self._carry_out(record)
        repeated = self._rejected and self.running.coarse
        if repeated:
            self.running.resume(state)
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
            record.base, record.placed = station.fixed[0], self.latest_placed() or now
        return record

    def _watched(self, record: StepRecord) -> Generator[Phase, Outcome, None]:
        """Yield the phases of a step on, with a record of each."""
        pending = record.step.phases(self.station)
        outcome: Outcome | None = None
        while True:
            self._start = self.running.save()
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
            key = phase.subject, phase.kind
            times = record.phases[key].times + 1 if key in record.phases else 1
            record.phases[key] = PhaseRecord(start, end, outcome.peak_force, phase.awake, times)
