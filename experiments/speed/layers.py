"""Where the time of a phase goes, by layer; all in CPU seconds per simulated second.

- geometry: the plant's question to the scene graph for all contact surfaces
  (`ComputeContactSurfacesWithFallback`), asked again in a copy of the Context.
- constraints: what the plant's constraints that are active (threads, the bit in its socket, coupled
  jaws, the springs of contact links) add to a step without contact: such a step with them less one
  without. In contact, where the solver iterates, their true share is larger. It is not measured in
  contact: a solver that loses what holds a bolt there takes longer, not shorter.
- solver: the rest of what Drake's `Simulator` takes without the monitor: forming and solving the
  contact problem, multibody dynamics, the drives and the bookkeeping of the diagram.
- Python: the monitor (fixture, threads, contact links) and what a phase does around a step:
  commands, sensing with the outputs of the plant that it asks for, conditions, logging.

The sum is measured as it is; geometry and constraints are probed after a few of the steps.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, EventStatus

from cell.builder import Cell
from cell.monitor import Monitor
from cell.simulation.phase import Follow, Phase, Running, after
from cell.simulation.simulation import Simulation
from cell.simulation.state import State, restore_state
from experiments.speed.calibration import Kernel

LAYERS: tuple[str, ...] = ("geometry", "constraints", "solver", "Python")
PROBES = 3  # In a window.
EVALUATIONS = 7  # Of what is probed; the least counts: the first fill caches [M].


@dataclass(frozen=True)
class Cost:
    """What a phase costs.

    Attributes:
        layers: CPU seconds per simulated second, by the names in `LAYERS`.
        kernel: CPU time of an iteration of the calibration kernel meanwhile [s].
    """

    layers: dict[str, float]
    kernel: float

    @property
    def total(self) -> float:
        """CPU seconds per simulated second."""
        return sum(self.layers.values())


class TimedMonitor:
    """A cell's monitor that counts its CPU time.

    Attributes:
        cpu: So far [s].
    """

    def __init__(self, monitor: Monitor) -> None:
        self._monitor = monitor
        self.cpu = 0.0

    def __call__(self, root: Context) -> EventStatus:
        """Do what the cell's monitor does."""
        start = time.process_time()
        try:
            return self._monitor(root)
        finally:
            self.cpu += time.process_time() - start


def measure_phase(
    simulation: Simulation,
    monitor: TimedMonitor,
    state: State,
    phase: Phase,
    window: float,
    repeats: int,
    kernel: Kernel,
) -> Cost:
    """Return the cost of the beginning of a phase: that of the fastest of some repeats.

    Args:
        simulation: Of the cell, stepped with the timed monitor; it may be in any state.
        monitor: That one.
        state: In which the phase starts.
        phase: Is run from there each time; what it remembers is not changed.
        window: How long to run it [s]; it may end before.
        repeats: How often, in turn with the kernel.
        kernel: The calibration kernel.
    """
    costs = []
    for _ in range(repeats):
        iteration = kernel.time()
        restore_state(simulation, state)
        begun, stepped, watched = simulation.steps, simulation.stepping_cpu, monitor.cpu
        start = time.process_time()
        simulation.run_phase(beginning(phase, window))
        total = time.process_time() - start
        stepped, watched = simulation.stepping_cpu - stepped, monitor.cpu - watched
        seconds = (simulation.steps - begun) * simulation.time_step
        python = total - stepped + watched
        costs.append((total / seconds, python / seconds, iteration))
    total, python, _ = min(costs)
    restore_state(simulation, state)
    geometry, constraints = _probed(simulation, phase, window)
    layers = {
        "geometry": geometry,
        "constraints": constraints,
        "solver": total - python - geometry - constraints,
        "Python": python,
    }
    return Cost(layers, min(iteration for *_, iteration in costs))


def beginning(phase: Phase, window: float) -> Phase:
    """Return a phase that ends after a window [s] at the latest.

    Conditions and servos that remember something are small objects: it has copies of its own.
    """
    until, over = copy.copy(phase.until), after(window)
    commands = {
        device: replace(command, target=copy.copy(command.target))
        if isinstance(command, Follow)
        else command
        for device, command in phase.commands.items()
    }
    return replace(
        phase,
        until=lambda sensed: until(sensed) or over(sensed),
        guard=copy.copy(phase.guard),
        commands=commands,
    )


def _probed(simulation: Simulation, phase: Phase, window: float) -> tuple[float, float]:
    """Run the beginning of a phase once more; return what geometry and constraints cost in it."""
    found: list[tuple[float, float]] = []
    every = max(1, round(window / simulation.time_step / PROBES))
    begun = simulation.steps

    def look(running: Running) -> None:
        if phase.every_step is not None:
            phase.every_step(running)
        if (running.steps - begun) % every == 1 % every:
            found.append(probe(simulation.cell, running.root))

    simulation.run_phase(replace(beginning(phase, window), every_step=look))
    geometry, constraints = np.mean(found, axis=0) / simulation.time_step
    return float(geometry), float(constraints)


def probe(cell: Cell, root: Context) -> tuple[float, float]:
    """Return the CPU time [s] in a step for geometry, and for active constraints.

    Args:
        cell: The cell.
        root: Context of the diagram; it is not changed.
    """
    plant, scene_graph = cell.plant, cell.scene_graph
    copied, result = root.Clone(), root.Clone()
    context = plant.GetMyMutableContextFromRoot(copied)
    state = plant.GetMyMutableContextFromRoot(result).get_mutable_state()
    x = plant.GetPositionsAndVelocities(context).copy()

    def anew() -> None:
        plant.SetPositionsAndVelocities(context, x)

    def step() -> None:
        plant.CalcForcedUnrestrictedUpdate(context, state)

    def surfaces() -> None:
        query = plant.get_geometry_query_input_port().Eval(context)
        query.ComputeContactSurfacesWithFallback(plant.get_contact_surface_representation())

    geometry = _least_cpu(surfaces, anew)
    filters = scene_graph.collision_filter_manager(scene_graph.GetMyMutableContextFromRoot(copied))
    everything = [
        geometry_id
        for index in map(BodyIndex, range(plant.num_bodies()))
        for geometry_id in plant.GetCollisionGeometriesForBody(plant.get_body(index))
    ]
    filters.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(everything)))
    tied = _least_cpu(step, anew)
    for constraint in plant.GetConstraintIds():
        plant.SetConstraintActiveStatus(context, constraint, False)
    return geometry, max(tied - _least_cpu(step, anew), 0.0)


def _least_cpu(work: Callable[[], None], anew: Callable[[], None]) -> float:
    """Return the least CPU time [s] of some evaluations, each of a state that counts as new."""

    def once() -> float:
        anew()
        start = time.process_time()
        work()
        return time.process_time() - start

    return min(once() for _ in range(EVALUATIONS))


def mean_cost(costs: Iterable[tuple[Cost, float]]) -> tuple[dict[str, float], dict[str, float]]:
    """Return the mean of some costs by layer, and the same as ratios to the kernel.

    Args:
        costs: Each with its weight: simulated time [s].
    """
    known = list(costs)
    weights = np.array([weight for _, weight in known])
    rows = np.array([[cost.layers[layer] for layer in LAYERS] for cost, _ in known])
    kernels = np.array([cost.kernel for cost, _ in known])
    cpu = weights @ rows / weights.sum()
    ratio = weights @ (rows / kernels[:, None]) / weights.sum()
    means = [dict(zip(LAYERS, row.tolist(), strict=True)) for row in (cpu, ratio)]
    return means[0], means[1]
