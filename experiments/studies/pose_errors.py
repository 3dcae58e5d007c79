"""Trials of single steps of an assembly with an error of stated size in every pose that is seen.

A first trial carries the assembly out without errors and keeps the state before each step. All
others start from one of these states, so each step is tried by itself, after good ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from cell.errors import InputError, UnknownName
from cell.products.loading import load_product
from cell.products.product import Product
from cell.simulation.simulation import Simulation
from cell.workpieces.parts import Parts
from experiments.assembly.custom_fixture import with_fixture_for
from experiments.assembly.prepare import RunningCell
from experiments.assembly.resume import SEED, go_on, read_resumable, resumable_state
from experiments.assembly.run import Run
from experiments.campaigns.assembly import outcome_of
from experiments.campaigns.trial import Outcome, Task
from experiments.reporting.output import write_arrays
from planning.assembly_plan.explain import stop_text
from planning.assembly_plan.planner import plan
from planning.operations.operation import NoOperation, Step
from planning.operations.sequence import steps
from planning.operations.station import Station
from planning.perception.belief import Estimate, Source

COMPONENTS = ("lateral", "height", "yaw", "tilt")
"""Of an error: along a random horizontal direction, up or down [m]; about the vertical, about a
random horizontal axis through the part's mass centre [rad]."""


@dataclass(frozen=True)
class PoseError:
    """An error of one size, whose direction differs from look to look and from part to part.

    Attributes:
        component: One of `COMPONENTS`.
        size: [m] or [rad].
        rng: Of the directions.
    """

    component: str
    size: float
    rng: np.random.Generator

    def draw(self) -> RigidTransform:
        """Return an error as a pose, in axes of the world about the part's mass centre."""
        angle, sign = self.rng.uniform(0.0, 2 * np.pi), self.rng.choice([-1.0, 1.0])
        level = np.array([np.cos(angle), np.sin(angle), 0.0])
        upright = np.array([0.0, 0.0, sign])
        if self.component in ("lateral", "height"):
            way = level if self.component == "lateral" else upright
            return RigidTransform(self.size * way)
        axis = upright if self.component == "yaw" else level
        return RigidTransform(RotationMatrix(AngleAxis(self.size, axis)), np.zeros(3))


@dataclass
class ErringSource:
    """Sees what another source sees, with an error that it does not know of.

    Attributes:
        source: The other one.
        parts: Whose mass centres errors turn about.
        error: That is made.
        duration: See `Source`.
    """

    source: Source
    parts: Parts
    error: PoseError
    duration: float = field(init=False)

    def __post_init__(self) -> None:
        self.duration = self.source.duration

    def look(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> dict[str, Estimate]:
        """Return what is seen now, each pose off by an error of its own."""
        seen = self.source.look(parts, known)
        return {n: replace(each, X_WP=self._off(n, each.X_WP)) for n, each in seen.items()}

    def _off(self, name: str, X_WP: RigidTransform) -> RigidTransform:
        p_WC = X_WP @ self.parts[name].part.mesh.center_mass
        about = RigidTransform(p_WC) @ self.error.draw() @ RigidTransform(-p_WC)
        return about @ X_WP

    def save(self) -> np.ndarray:
        """Return the state of the other source; directions are drawn once per trial."""
        return self.source.save()

    def restore(self, state: np.ndarray) -> None:
        """Return to a saved state of the other source."""
        self.source.restore(state)


@dataclass
class ErringCell(RunningCell):
    """A cell whose planner sees every pose with an error."""

    error: PoseError = field(
        default_factory=lambda: PoseError(COMPONENTS[0], 0.0, np.random.default_rng(0))
    )

    def _build(self, time_step: float) -> tuple[Simulation, Station]:
        simulation, station = super()._build(time_step)
        source = ErringSource(station.source, simulation.cell.parts, self.error)
        station.source = station.belief.source = source
        return simulation, station


def planned_steps(task: Task, order: str) -> tuple[Product, list[Step]]:
    """Return the product of a task and the steps of its assembly.

    Raises:
        NoOperation: The plan is infeasible, or no operation carries it out.
    """
    product = load_product(task.product)
    product.check_simulable()
    wanted = tuple(item.strip() for item in order.split(",")) if order else None
    fixing = plan(product, wanted, config=task.config)
    if fixing.stop is not None:
        raise NoOperation(stop_text(fixing))
    return product, steps(product, fixing)


def state_file(step: int) -> str:
    """Return the name of the file with the state before a step, counted from 0."""
    return f"before_{step}_state.npz"


def without_error(task: Task, *, order: str = "") -> Outcome:
    """Assemble a product, and keep the state before each step.

    Args:
        task: Product, configuration, seed of what is disturbed in all trials alike.
        order: Parts or groups, separated by commas; "" for the product's first one.
    """
    product, todo = planned_steps(task, order)
    run = Run(
        RunningCell(product, with_fixture_for(task.config, product, task.seed, todo), task.seed)
    )
    for number, step in enumerate(todo):
        write_arrays(task.file(state_file(number)), resumable_state(run), compressed=False)
        run.run([step])
        if run.failure is not None:
            break
    return outcome_of(run)


def with_error(
    task: Task,
    *,
    start: str = "",
    order: str = "",
    step: int = 0,
    component: str = COMPONENTS[0],
    size: float = 0.0,
) -> Outcome:
    """Carry out one step from its state in the run without errors, with errors in what is seen.

    Args:
        task: Product, configuration, seed of the directions of the errors.
        start: Key of the trial of `without_error`, in the same campaign's folder.
        order: As of that trial.
        step: Number of the step, from 0.
        component: One of `COMPONENTS`.
        size: Of the error [m] or [rad].

    Raises:
        InputError: There is no such component, step or state.
    """
    if component not in COMPONENTS:
        raise UnknownName("component of a pose error", component, COMPONENTS)
    product, todo = planned_steps(task, order)
    if not 0 <= step < len(todo):
        raise InputError(f"There is no step {step}; the steps are 0 to {len(todo) - 1}.")
    state = read_resumable(task.folder.parent / start / state_file(step))
    seed = int(state[SEED])
    error = PoseError(component, size, np.random.default_rng([task.seed, step]))
    config = with_fixture_for(task.config, product, seed, todo)
    run = Run(ErringCell(product, config, seed, error=error))
    left = go_on(run, todo, state)
    before = len(run.steps)
    run.run(left[:1])
    del run.steps[:before]  # How the steps before went is not what this trial is about.
    return outcome_of(run)
