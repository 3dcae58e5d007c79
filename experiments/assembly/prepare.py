"""From a product and its plan to a cell that is ready to run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.framework import DiagramBuilder

from cell.builder import add_cell
from cell.configuration.config import CellConfig
from cell.products.product import Product
from cell.simulation.simulation import Simulation
from experiments.assembly.replay import Replay
from planning.operations.station import Station
from planning.perception.belief import TruthSource


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


def running_cell(
    product: Product, config: CellConfig, seed: int, replay: Replay | None = None
) -> tuple[Simulation, Station, Disturbance]:
    """Build the disturbed cell, and the planner's undisturbed view of it.

    Args:
        product: What is assembled.
        config: Every number of the cell, as the planner believes it to be.
        seed: Seeds disturbance, sensor noise and sampling planners.
        replay: Where to show it, if at all.

    Returns:
        The running cell, the planner's view, and the disturbance between them.
    """
    builder = DiagramBuilder()
    disturbance = Disturbance.draw(config, seed)
    cell = add_cell(builder, disturbance.applied_to(config), product)
    if replay is not None:
        replay.add_to(builder, cell)
    simulation = Simulation(cell.with_diagram(builder.Build()))
    if replay is not None:
        replay.follow(simulation.root)
    source = TruthSource.of(simulation.cell, simulation.root, seed)
    station = Station(simulation.cell, simulation.root, source, seed, nominal=config)
    return simulation, station, disturbance
