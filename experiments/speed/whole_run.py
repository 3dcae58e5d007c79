"""One ordinary run of an assembly: what each phase takes, and the state in which it starts.

The states are kept in a folder, `phases.json` and one file per phase, so that any phase can be run
again. They hold for one configuration, product, set of bodies and seed, and for operations that
yield the same phases: `resumed` refuses them otherwise.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import cast

from cell.errors import InputError
from cell.machines.driver import Driver
from cell.machines.gripper import Gripper
from cell.simulation.phase import Outcome, Phase, Sensed
from cell.simulation.simulation import Simulation
from cell.simulation.state import State, read_state, restore_state, save_state
from experiments.assembly.prepare import RunningCell
from experiments.reporting.output import write_arrays, write_json
from planning.operations.operation import Step
from planning.operations.phase_class import PhaseClass, class_of
from planning.operations.station import Station

INDEX = "phases.json"


class Outdated(InputError):
    """Start states that are missing, or that do not fit the cell or its operations any more."""


@dataclass(frozen=True)
class PhaseRun:
    """One phase of the run.

    Attributes:
        number: Of the phase in the run, from 0; its saved state has the same number.
        step: Number of its step in the plan.
        operation: Name of the operation of that step.
        kind: Which phase of its operation it is.
        name: As in the log, for example "motor: press".
        phase_class: Its class.
        sim_seconds: How long it lasted [s].
        cpu_seconds: CPU time in it [s]: stepping, commands, sensing, logging.
        planning_seconds: CPU time to build it, motion planning above all [s].
    """

    number: int
    step: int
    operation: str
    kind: str
    name: str
    phase_class: PhaseClass
    sim_seconds: float
    cpu_seconds: float
    planning_seconds: float


@dataclass(frozen=True)
class WholeRun:
    """A run whose states are in a folder.

    Attributes:
        folder: With the states.
        seed: Of the run.
        phases: In their order.
    """

    folder: Path
    seed: int
    phases: tuple[PhaseRun, ...]

    def state(self, number: int) -> State:
        """Return the saved state at the start of a phase."""
        return read_state(state_file(self.folder, number))


def state_file(folder: Path, number: int) -> Path:
    """Return where the state at the start of a phase is kept."""
    return folder / f"{number:03d}.npz"


def make_whole_run(
    folder: Path,
    running: RunningCell,
    steps: Sequence[Step],
    watch: Callable[[PhaseRun], None],
) -> WholeRun:
    """Run all steps from the beginning; keep the state at the start of each phase.

    Args:
        folder: Existing; earlier states in it are replaced.
        running: Fresh.
        steps: Of the plan.
        watch: Told of each phase when it is done.

    Raises:
        RunFailure: The run failed; the folder has no index then.
    """
    (folder / INDEX).unlink(missing_ok=True)
    done: list[PhaseRun] = []
    for number, step in enumerate(steps):
        running.go_on(step.operation)
        simulation, station = running.simulation, running.station
        # A step is begun again with what the planner knew before it.
        known = station.save()
        phases = _started(step, station)
        outcome: Outcome | None = None
        while True:
            start = time.process_time()
            try:
                phase = phases.send(outcome)
            except StopIteration:
                break
            planned = time.process_time()
            kind, before = class_of(phase, station.in_hand), simulation.steps
            write_arrays(state_file(folder, len(done)), save_state(simulation) | known)
            begun = time.process_time()
            outcome = simulation.run_phase(phase)
            cpu = time.process_time() - begun
            run = PhaseRun(
                number=len(done),
                step=number,
                operation=step.operation.name,
                kind=str(phase.kind.value),
                name=phase.name,
                phase_class=kind,
                sim_seconds=(simulation.steps - before) * simulation.time_step,
                cpu_seconds=cpu,
                planning_seconds=planned - start,
            )
            done.append(run)
            watch(run)
    rows = [asdict(run) | {"phase_class": run.phase_class.value} for run in done]
    write_json(folder / INDEX, {"seed": running.seed, "phases": rows})
    return WholeRun(folder, running.seed, tuple(done))


def read_whole_run(folder: Path, running: RunningCell) -> WholeRun:
    """Return the run of a cell whose states are in a folder.

    Raises:
        Outdated: There is none, or it is of another cell or seed than this one.
    """
    try:
        kept = json.loads((folder / INDEX).read_text(encoding="utf-8"))
        phases = tuple(
            PhaseRun(**row | {"phase_class": PhaseClass(row["phase_class"])})
            for row in kept["phases"]
        )
        run = WholeRun(folder, int(kept["seed"]), phases)
    except FileNotFoundError:
        raise Outdated(f"There are no start states in '{folder}'.") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise Outdated(f"The start states in '{folder}' cannot be read: {error}.") from error
    if run.seed != running.seed:
        raise Outdated(
            f"The start states in '{folder}' are of seed {run.seed}, not {running.seed}."
        )
    put_at_start(running.simulation, run, 0)
    return run


def put_at_start(simulation: Simulation, run: WholeRun, number: int) -> None:
    """Put a simulation where a phase starts.

    Raises:
        Outdated: The state is missing or of another cell.
    """
    try:
        restore_state(simulation, run.state(number))
    except InputError as reason:
        raise Outdated(str(reason)) from reason


def resumed(
    run: WholeRun, running: RunningCell, step: Step, wanted: Sequence[PhaseRun]
) -> Generator[tuple[PhaseRun, Phase], None, None]:
    """Yield wanted phases of one step again, in their order, with the simulation at their start.

    The operation builds its phases anew from what it senses. Those before a wanted one are not run:
    the simulation is put where they ended. Only a phase that hands one of its commands on to a
    wanted one is run again, as such a servo remembers how far it has come.

    Args:
        run: The whole run.
        running: Of the same cell; it may be left in any state.
        step: Which step; of the same plan.
        wanted: Phases of that step, one at least.

    Raises:
        Outdated: The states do not fit the cell or its operations any more.
    """
    running.switch(step.operation)
    simulation, station = running.simulation, running.station
    first = next(phase.number for phase in run.phases if phase.step == wanted[0].step)
    station.restore(run.state(first))
    phases = _started(step, station)
    outcome: Outcome | None = None
    earlier: Phase | None = None
    for number in range(first, wanted[-1].number + 1):
        put_at_start(simulation, run, number)
        if earlier is not None:
            outcome = Outcome(_sensed(simulation, run.phases[number - 1].sim_seconds), {})
        kept = run.phases[number]
        try:
            phase = phases.send(outcome)
        except StopIteration:
            raise Outdated(f"'{step.name}' ends before its phase '{kept.name}'.") from None
        if phase.name != kept.name:
            raise Outdated(f"'{step.name}' has '{phase.name}' in place of '{kept.name}'.")
        if kept in wanted:
            if earlier is not None and _handed_on(earlier, phase):
                put_at_start(simulation, run, number - 1)
                simulation.run_phase(earlier)
                put_at_start(simulation, run, number)
            yield kept, phase
        earlier = phase


def _started(step: Step, station: Station) -> Generator[Phase, Outcome | None, None]:
    return cast(Generator[Phase, Outcome | None, None], step.phases(station))


def _handed_on(earlier: Phase, phase: Phase) -> bool:
    return any(a is b for a in earlier.commands.values() for b in phase.commands.values())


def _sensed(simulation: Simulation, duration: float) -> Sensed:
    """Return what an operation senses at the end of a phase that is not run again."""
    context = simulation.context
    tools = [arm.tool for arm in simulation.cell.arms.values()]
    return Sensed(
        time=duration,
        step=round(duration / simulation.time_step),
        wrench={name: now - simulation.tare[name] for name, now in simulation.wrists.items()},
        grippers={tool.name: tool.read(context) for tool in tools if isinstance(tool, Gripper)},
        drivers={tool.name: tool.read(context) for tool in tools if isinstance(tool, Driver)},
        finished=True,
        X_WF=lambda frame: frame.CalcPoseInWorld(context),
    )
