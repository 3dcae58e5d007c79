"""The left arm's hand in a trial: it picks the part from the tray and brings it to the jig.

The disturbances are those of the rig, come by as a robot would: the part is not quite where the
look at the tray says, so that it sits wrong in the grasp, by what the jaws do not straighten, and
is not looked at again before it is placed; the jig is not quite where it was set down.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from typing import cast

from pydrake.math import RigidTransform

from cell.builder import Cell, build_cell
from cell.configuration.config import CellConfig
from cell.errors import CellError
from cell.fixtures.soft_jig import SurfaceSamples
from cell.products.product import Product
from cell.simulation.events import rest_jig, wake_jig
from cell.simulation.phase import Outcome, Phase, PhaseFailed, after
from cell.simulation.simulation import Simulation
from experiments.paper.postures import Posture, Push
from experiments.paper.push_rule import push_line
from experiments.paper.rig.stage import Observer, Stage
from experiments.paper.trial import HOVER, READY_TIME, Disturbance, planned_pose
from planning.operations.measures import angle_between
from planning.operations.pick_place.phases import pick_place
from planning.operations.placement import YAWS, anywhere
from planning.operations.push.phases import PushLine, approach, can_push, push
from planning.operations.station import Station

ON_JIG = "press"  # The first phase with the part on the jig.


def presented(product: Product, posture: Posture) -> Product:
    """Return the product reduced to the posture's part, in the tray as the posture asks."""
    part = product.parts[posture.part]
    assert part.X_TrayP is not None
    part = replace(part, X_TrayP=part.X_TrayP @ posture.X_PTurned, grasps=(posture.grasp,))
    return replace(product, parts={part.name: part}, groups={}, fasteners={}, fits=())


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
    push: Push | None

    @staticmethod
    def build(
        config: CellConfig, product: Product, posture: Posture, push: Push | None
    ) -> RobotBench:
        """Build it."""
        config = replace(config, workcell=replace(config.workcell, jig_base_fixed=False))
        cell = build_cell(config, presented(product, posture))
        return RobotBench(cell, _stage(cell, posture.part), posture, push)

    def _sensor(
        self, simulation: Simulation, station: Station, disturbance: Disturbance
    ) -> Callable[[str], RigidTransform]:
        """Return what the planner takes for the pose of the part."""
        grasp, X_DrawnP = self.posture.grasp, disturbance.X_PDrawn.inverse()

        def sense(part: str) -> RigidTransform:
            if station.held is not None:
                return station.pose("left", grasp.jaw) @ grasp.X_PJaw.inverse()
            return simulation.sense(part) @ X_DrawnP

        return sense

    def begin(self, disturbance: Disturbance) -> RobotHand:
        """Put part and jig in their places, the arms at home."""
        simulation = Simulation(self.cell, disturbance.seed)
        X_WJ = disturbance.displaced(self.cell.X_WJ)
        self.cell.jig_base.reset(simulation.root, X_WJ)
        station = Station(self.cell, simulation.context, simulation.sense, seed=disturbance.seed)
        station.sense = self._sensor(simulation, station, disturbance)
        return RobotHand(self, simulation, station, Observer(self.stage, simulation.root))


def _stage(cell: Cell, part: str) -> Stage:
    """Return what a trial looks at, in the cell."""
    return Stage(
        config=cell.config,
        plant=cell.plant,
        scene_graph=cell.scene_graph,
        jig_base=cell.jig_base,
        soft_jig=cell.soft_jig,
        part=cell.parts[part],
        samples=SurfaceSamples.of(part, cell.product.parts[part].mesh),
        gripper=cell.gripper,
        wrist=cell.wrists["left"],
        force_plate=cell.force_plate,
    )


class RobotHand:
    """The left arm's hand in one trial: see `experiments.paper.trial.Hand`.

    Attributes:
        simulation: Of the cell.
        station: The planner's view of it.
        observer: Looks at part and jig, and records from the press on.
        planned: X_JP as aimed at, with the yaw that the planner chose.
    """

    def __init__(
        self, bench: RobotBench, simulation: Simulation, station: Station, observer: Observer
    ) -> None:
        self.observer = observer
        self.simulation, self.station = simulation, station
        self._bench = bench
        self._name = bench.posture.part
        suits = anywhere if bench.push is None else self.leaves_room
        self._placing = _Pending(pick_place(station, self._name, bench.posture.up, suits=suits))
        self.planned = self._planned(0.0)

    def press(self) -> None:
        """Fetch the part, press it into the bag and freeze it there."""
        self.wait("pick: ready", READY_TIME)
        self.observer.tare()
        self._place(last="jam")
        X_JP = self.observer.X_JP
        self.planned = min(map(self._planned, YAWS), key=lambda X: angle_between(X, X_JP))

    def let_go(self) -> None:
        """Open the jaws and back off along the approach direction."""
        self._place(last="retreat")
        self.station.fixed = (self._name,)

    def approach(self, line: PushLine) -> None:
        """Come from above and behind, by a planned way."""
        self._run(Phase("approach", after(0.0), 1.0, start=(rest_jig,)))
        for phase in _Pending(approach(self.station, self._name, line)):
            self._run(phase)

    def push(self, line: PushLine) -> None:
        """Push along the line."""
        for phase in _Pending(push(self.station, self._name, line)):
            self._run(phase)

    def wait(self, phase: str, seconds: float) -> None:
        """Hold still."""
        awake = frozenset(self.station.fixed)
        self._run(Phase(phase, after(seconds), seconds + 1.0, start=(wake_jig,), awake=awake))

    def _place(self, last: str) -> None:
        """Go on with placing the part, until a phase has ended."""
        for phase in self._placing:
            name = phase.name.removeprefix(f"{self._name}: ")
            self.observer.recording |= name == ON_JIG
            if self.observer.recording:
                awake, start = frozenset([self._name]), (wake_jig, *phase.start)
                phase = replace(phase, name=name, start=start, awake=awake)
            else:
                phase = replace(phase, name=f"pick: {name}", start=(*phase.start, rest_jig))
            self._placing.outcome = self._run(phase)
            if name == last:
                return

    def _run(self, phase: Phase) -> Outcome:
        """Run one phase, recorded; what the bag cannot hold is a verdict on the trial."""
        self.observer.begin(phase.name, self.simulation.time)
        try:
            return self.simulation.run_phase(replace(phase, every_step=self._record))
        except CellError as error:
            raise self.observer.failure(str(error)) from error

    def _record(self, simulation: Simulation) -> None:
        self.observer.step(simulation.steps, simulation.time)

    def _planned(self, yaw: float) -> RigidTransform:
        """Return X_JP over the jig, turned by a yaw."""
        cell, posture = self._bench.cell, self._bench.posture
        height = cell.config.jig.bag.cap_height + HOVER
        part = cell.product.parts[posture.part]
        return planned_pose(part, posture, RigidTransform(), height, yaw)

    def leaves_room(self, X_WP: RigidTransform) -> bool:
        """Return whether the arm can push the part where it will stand."""
        bench = self._bench
        assert bench.push is not None
        line = push_line(bench.stage, bench.push, bench.cell.X_WJ, X_WP)
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
        except CellError as error:
            raise PhaseFailed("plan", str(error)) from error
