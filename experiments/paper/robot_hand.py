"""The left arm's hand in a trial: it picks the part from the tray and brings it to the jig.

The disturbances are those of the rig, come by as a robot would: the part is not quite where the
look at the tray says, so that it sits wrong in the grasp, by what the jaws do not straighten, and
is not looked at again before it is placed; the jig is not quite where it was set down.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import cast

import numpy as np
from pydrake.math import RigidTransform

from cell.builder import Cell, build_cell
from cell.configuration.config import CellConfig
from cell.errors import CellError, RunFailure
from cell.products.product import Grasp, Product
from cell.simulation.events import rest_jig, wake_jig
from cell.simulation.phase import Condition, Outcome, Phase, PhaseFailed, Running, after
from cell.simulation.simulation import Simulation
from cell.simulation.state import State, save_state
from experiments.paper.postures import Posture, PushSpec
from experiments.paper.push_rule import push_line
from experiments.paper.rest import Rest
from experiments.paper.rig.stage import Observer, Stage
from experiments.paper.trial import (
    HOVER,
    READY_TIME,
    TrialDisturbance,
    gripped,
    held,
    planned_pose,
)
from experiments.speed.meter import Meter
from planning.operations.grasping import HandPhase
from planning.operations.phase_class import class_of
from planning.operations.pick_place.phases import PlacePhase, pick_place
from planning.operations.placement import anywhere
from planning.operations.push.phases import PushLine, approach, can_push, push
from planning.operations.station import Station
from planning.perception.belief import Estimate, TruthSource


class TrialPhase(Enum):
    """What a trial does besides the operations."""

    PICK_READY = "pick: ready"
    SETTLE = "settle"
    APPROACH = "approach"
    READY = "ready"
    COAST = "coast"


@dataclass
class DrawnSource:
    """Sees a part that is not quite where it is seen; in the hand, as its grasp says.

    Attributes:
        truth: What it would see otherwise.
        X_DrawnP: Pose of the part as it is seen in the part as it is.
        grasp: How the part will be held.
        station: Of the planner that looks; None until it is there.
        duration: See `planning.perception.belief.Source`.
    """

    truth: TruthSource
    X_DrawnP: RigidTransform
    grasp: Grasp
    station: Station | None = None
    duration: float = 0.0

    def look(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> dict[str, Estimate]:
        """Return where the planner takes parts to be."""
        seen, station = self.truth.look(parts, known), self.station
        if station is not None and station.held is not None:
            X_WP = station.tool_pose(station.holder, self.grasp.jaw) @ self.grasp.X_PJaw.inverse()
            return {name: replace(estimate, X_WP=X_WP) for name, estimate in seen.items()}
        return {
            name: replace(estimate, X_WP=estimate.X_WP @ self.X_DrawnP)
            for name, estimate in seen.items()
        }

    def save(self) -> np.ndarray:
        """Return the state of what it would see otherwise."""
        return self.truth.save()

    def restore(self, state: np.ndarray) -> None:
        """Return to a saved state."""
        self.truth.restore(state)


def presented(product: Product, posture: Posture) -> Product:
    """Return the product reduced to the posture's part, in the tray as the posture asks."""
    alone = gripped(product, posture)
    part = alone.parts[posture.part]
    assert part.X_TrayP is not None
    part = replace(part, X_TrayP=part.X_TrayP @ posture.X_PTurned)
    return replace(alone, parts={part.name: part})


@dataclass(frozen=True)
class RobotBench:
    """The cell with one part in its tray, for the trials of one posture.

    Attributes:
        cell: Built, with the jig free on the force plate.
        stage: What a trial looks at.
        posture: How the part is placed.
        push: What the place on the jig must leave room for, if anything.
    """

    cell: Cell
    stage: Stage
    posture: Posture
    push: PushSpec | None

    @staticmethod
    def build(
        config: CellConfig, product: Product, posture: Posture, push: PushSpec | None
    ) -> RobotBench:
        """Build it."""
        config = held(config, posture).with_changes({"workcell.jig_base_fixed": False})
        cell = build_cell(config, presented(product, posture))
        return RobotBench(cell, _stage(cell, posture.part), posture, push)

    def begin(self, disturbance: TrialDisturbance) -> RobotHand:
        """Put part and jig in their places, the arms at home."""
        simulation = Simulation(self.cell)
        X_WJ = disturbance.displaced(self.cell.X_WJ)
        self.cell.jig_base.set_down(simulation.root, X_WJ)
        truth = TruthSource.of(self.cell, simulation.root, disturbance.seed)
        source = DrawnSource(truth, disturbance.X_PDrawn.inverse(), self.posture.grasp)
        station = Station(self.cell, simulation.root, source, seed=disturbance.seed)
        source.station = station
        return RobotHand(self, simulation, station, Observer(self.stage, simulation.root))


def _stage(cell: Cell, part: str) -> Stage:
    """Return what a trial looks at, in the cell."""
    return Stage(
        config=cell.config,
        plant=cell.plant,
        scene_graph=cell.scene_graph,
        jig_base=cell.jig_base,
        fixture=cell.fixture,
        part=cell.parts[part],
        gripper=cell.gripper,
        wrist=cell.holder.wrist,
        force_plate=cell.force_plate,
    )


class RobotHand:
    """The left arm's hand in one trial: see `experiments.paper.trial.Hand`.

    Attributes:
        simulation: Of the cell.
        station: The planner's view of it.
        observer: Looks at part and jig, and records from the press on.
        planned: X_JP as aimed at, with the yaw that the planner chose.
        meter: CPU time spent stepping, by class of phase.
    """

    def __init__(
        self, bench: RobotBench, simulation: Simulation, station: Station, observer: Observer
    ) -> None:
        self.observer, self.meter = observer, Meter()
        self.simulation, self.station = simulation, station
        self._bench = bench
        self._name = bench.posture.part
        suits = anywhere if bench.push is None else self.leaves_room
        self._placing = _Pending(pick_place(station, self._name, bench.posture.up, suits=suits))
        self.planned = self._planned(0.0)

    def save(self) -> State:
        """Return the state of the cell and what the planner remembers."""
        return {**save_state(self.simulation), **self.station.save()}

    def press(self) -> None:
        """Fetch the part, press it into the bag and freeze it there."""
        self.wait("pick: ready", READY_TIME)
        self.observer.tare()
        self._place(last=PlacePhase.FIX)
        self.planned = self._planned(self.station.placements[self._name].yaw)

    def let_go(self) -> None:
        """Open the jaws and back off along the approach direction."""
        self._place(last=HandPhase.RETREAT)
        self.station.fixed = (self._name,)

    def approach(self, line: PushLine) -> None:
        """Come from above and behind, by a planned way."""
        self._run(Phase(TrialPhase.APPROACH, after(0.0), 1.0, start=(rest_jig,)))
        for phase in _Pending(approach(self.station, self._name, line)):
            self._run(phase)

    def push(self, line: PushLine) -> None:
        """Push along the line."""
        for phase in _Pending(push(self.station, self._name, line)):
            self._run(phase)

    def wait(self, phase: str, seconds: float) -> None:
        """Hold still."""
        self._hold(phase, after(seconds), seconds)

    def wait_for_rest(self, phase: str, longest: float) -> None:
        """Hold still until part and jig rest."""
        rest, over = Rest(self.observer), after(longest)
        self._hold(phase, lambda sensed: rest.reached() or over(sensed), longest)

    def _hold(self, phase: str, until: Condition, longest: float) -> None:
        awake = frozenset(self.station.fixed)
        kind, limit = TrialPhase(phase), longest + 1.0
        self._run(Phase(kind, until, limit, start=(wake_jig,), awake=awake))

    def _place(self, last: Enum) -> None:
        """Go on with placing the part, until a phase has ended; recorded from the press on."""
        for phase in self._placing:
            self.observer.recording |= phase.kind is PlacePhase.PRESS
            if self.observer.recording:
                awake, start = frozenset([self._name]), (wake_jig, *phase.start)
                outcome = self._run(replace(phase, subject="", start=start, awake=awake))
            else:
                outcome = self._run(replace(phase, subject="pick", start=(*phase.start, rest_jig)))
            self._placing.outcome = outcome
            if phase.kind is last:
                return

    def _run(self, phase: Phase) -> Outcome:
        """Run one phase, recorded; what the bag cannot hold is a verdict on the trial."""
        simulation, kind = self.simulation, class_of(phase, self.station.in_hand)
        self.observer.begin(phase.name, simulation.time)
        cpu, begun = simulation.stepping_cpu, simulation.time
        try:
            return simulation.run_phase(replace(phase, every_step=self._record))
        except CellError as error:
            raise self.observer.failure(str(error)) from error
        finally:
            self.meter.add(kind, simulation.stepping_cpu - cpu, simulation.time - begun)

    def _record(self, running: Running) -> None:
        self.observer.step(running.steps, running.time)

    def _planned(self, yaw: float) -> RigidTransform:
        """Return X_JP over the jig, turned by a yaw."""
        cell, posture = self._bench.cell, self._bench.posture
        height = cell.fixture.entry_height + HOVER
        part = cell.product.parts[posture.part]
        return planned_pose(part, posture, RigidTransform(), height, yaw)

    def leaves_room(self, X_WP: RigidTransform) -> bool:
        """Return whether the arm can push the part where it will stand."""
        bench = self._bench
        assert bench.push is not None
        line = push_line(bench.stage, self.simulation.root, bench.push, bench.cell.X_WJ, X_WP)
        return can_push(self.station, self._name, line)


class _Pending:
    """The phases of an operation that are still to come; each is built when it is asked for.

    Attributes:
        outcome: Of the phase that was run last: the operation is told of it.
    """

    def __init__(self, phases: Iterator[Phase]) -> None:
        self._phases = cast(Generator[Phase, Outcome | None, None], phases)
        self.outcome: Outcome | None = None

    def __iter__(self) -> Iterator[Phase]:
        return self

    def __next__(self) -> Phase:
        """Return the next phase; a motion that cannot be found is a verdict on the trial."""
        try:
            return self._phases.send(self.outcome)
        except RunFailure as error:
            raise PhaseFailed("plan", str(error)) from error
