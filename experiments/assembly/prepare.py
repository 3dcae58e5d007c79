"""From a product and its plan to a cell that is ready to run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.systems.framework import DiagramBuilder

from cell.builder import add_cell
from cell.configuration.config import CellConfig
from cell.errors import InputError
from cell.monitor import join_monitors
from cell.products.product import Product
from cell.simulation.settling import settle
from cell.simulation.simulation import Simulation
from cell.simulation.state import State, hand_over, restore_state, save_state
from experiments.assembly.film import Film
from experiments.assembly.replay import Replay
from planning.operations.operation import Operation
from planning.operations.station import Station
from planning.perception.sources import source_of

TIME_STEP = "time_step"  # In a saved state: of the simulation that it was taken of.


@dataclass(frozen=True)
class Disturbance:
    """How far the tray is from where the planner believes it to be.

    Attributes:
        x, y: [m].
        yaw_deg: About the vertical [deg].
    """

    x: float
    y: float
    yaw_deg: float

    @staticmethod
    def draw(config: CellConfig, seed: int) -> Disturbance:
        """Draw one from the seed; the stream is separate from that of the sensor noise."""
        rng = np.random.default_rng([seed, 1])
        sigma = config.disturbance
        x, y = rng.normal(scale=sigma.tray_position_sigma, size=2)
        turn = rng.normal(scale=sigma.tray_yaw_sigma_deg)
        return Disturbance(float(x), float(y), float(turn))

    def applied_to(self, config: CellConfig) -> CellConfig:
        """Return the configuration with the tray where it really is."""
        nominal = config.workcell
        x, y, z = nominal.p_WT
        tray = replace(
            nominal,
            p_WT=(x + self.x, y + self.y, z),
            tray_yaw_deg=nominal.tray_yaw_deg + self.yaw_deg,
        )
        return replace(config, workcell=tray)


@dataclass
class RunningCell:
    """A cell that runs, and the planner's view of it, at the time step that an operation allows.

    Drake's plant has one time step for good: for each there is a cell of its own, built when it is
    first needed, to which the state is handed over.

    Attributes:
        product: What is assembled.
        config: Every number of the cell, as the planner believes it to be.
        seed: Seeds disturbance, sensor noise and sampling planners.
        replay: Where it is shown; None: nowhere.
        film: Keeps the surfaces of the jig; None: they are not wanted.
        disturbance: How far the cell is from what the planner takes it for.
        simulation: That runs at present.
        station: The planner's view of it.
    """

    product: Product
    config: CellConfig
    seed: int
    replay: Replay | None = None
    film: Film | None = None
    disturbance: Disturbance = field(init=False)
    simulation: Simulation = field(init=False)
    station: Station = field(init=False)
    _built: dict[float, tuple[Simulation, Station]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.disturbance = Disturbance.draw(self.config, self.seed)
        self._switch(self.config.simulation.time_step)
        settle(self.simulation)

    @property
    def coarse(self) -> bool:
        """Whether the present simulation takes coarse steps."""
        return self.simulation.time_step > self.config.simulation.time_step

    def switch(self, operation: Operation) -> None:
        """Let the present simulation be that at the time step of an operation, as it was left."""
        steps = self.config.simulation
        self._switch(steps.coarse_time_step if operation.coarse else steps.time_step)

    def resume(self, state: State) -> None:
        """Go on where a saved state was taken, at the time step of the simulation at that time.

        Raises:
            InputError: It is of another cell.
        """
        steps, time_step = self.config.simulation, float(state[TIME_STEP])
        if time_step not in (steps.time_step, steps.coarse_time_step):
            raise InputError(f"The saved state is of another time step: {time_step:g} s.")
        self._switch(time_step)
        restore_state(self.simulation, state)
        self.station.restore(state)

    def save(self) -> State:
        """Return the state of the simulation and all that the planner remembers, for `resume`."""
        time_step = np.array(self.simulation.time_step)
        return {**save_state(self.simulation), **self.station.save(), TIME_STEP: time_step}

    def go_on(self, operation: Operation | None = None) -> None:
        """Go on at the time step of an operation; with none given, at the configured one."""
        simulation, station = self.simulation, self.station
        if operation is None:
            self._switch(self.config.simulation.time_step)
        else:
            self.switch(operation)
        if self.simulation is not simulation:
            hand_over(simulation, self.simulation)
            self.station.restore(station.save())

    def _switch(self, time_step: float) -> None:
        if time_step not in self._built:
            self._built[time_step] = self._build(time_step)
        self.simulation, self.station = self._built[time_step]

    def _build(self, time_step: float) -> tuple[Simulation, Station]:
        """Build the disturbed cell, and the planner's undisturbed view of it."""
        config = replace(
            self.config, simulation=replace(self.config.simulation, time_step=time_step)
        )
        builder = DiagramBuilder()
        cell = add_cell(builder, self.disturbance.applied_to(config), self.product)
        if self.replay is not None:
            self.replay.add_to(builder, cell)
        simulation = Simulation(cell.with_diagram(builder.Build()))
        followers = [each for each in (self.replay, self.film) if each is not None]
        monitors = [each.follow(simulation) for each in followers]
        joined = join_monitors(simulation.cell.monitor, *filter(None, monitors))
        simulation.simulator.set_monitor(joined)
        cell, root = simulation.cell, simulation.root
        source, expected = source_of(cell, root, config, self.seed)
        # Planning does not depend on the time step.
        known = next((station.model for _, station in self._built.values()), None)
        station = Station(cell, root, source, self.seed, nominal=config, planning_copy=known)
        station.belief.estimates |= expected
        return simulation, station
