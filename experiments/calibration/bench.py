"""The tests of a jig on a bench, as the twin carries them out: the experiment "bench".

A standing cylinder is pressed into the soft bag; or it is pressed in and frozen, and then pushed
and, from the same state again, pulled. Curves are reduced to mean forces between fixed
displacements, which is the work between them over the way: every sample counts, noise averages out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cell.errors import UnknownName
from cell.fixtures.soft_jig import JigParameters
from cell.fixtures.soft_jig.soft.bed import Bed
from experiments.campaigns.trial import Outcome, Task
from experiments.jig.curves import Curve
from experiments.jig.element_rig import ElementRig
from experiments.jig.element_tests import PUSH_HEIGHT, SIDEWAYS, SPEED, UP, pressed
from experiments.jig.specimens import Prism
from experiments.reporting.output import write_arrays

Array = NDArray[np.float64]

# Quasi-static: what the bed's viscosity adds at this speed is below 2 % [D].
PRESS_SPEED = 0.005  # [m/s]
# How fast the pump draws does not matter to a bed that has frozen, but to the time that it takes.
PUMP_TIME = 0.05  # [s]
SETTLE = 0.1  # After freezing, and again half of it after letting go [s].
# Displacements between which forces are averaged [m]: dense where curves bend.
FROZEN_EDGES = (0.05e-3, 0.15e-3, 0.3e-3, 0.6e-3, 1.0e-3, 2.0e-3)
PRESS_EDGES = (1e-3, 2.5e-3, 5e-3, 7.5e-3, 10e-3, 12.5e-3, 15e-3, 17.5e-3, 20e-3)
# Of the spring that drags: the last edge, and what it stretches by under 40 N [m].
WAY = 0.004


@dataclass(frozen=True)
class BenchTest:
    """A test.

    Attributes:
        name: In the header of a record.
        action: "press", "push" or "pull".
        bag: "soft"; or frozen, "vented" or "sealed" as air reaches the gap under the part or not.
    """

    name: str
    action: str
    bag: str

    @property
    def edges(self) -> tuple[float, ...]:
        """Displacements between which forces are averaged [m]."""
        return PRESS_EDGES if self.action == "press" else FROZEN_EDGES


BAGS = ("soft", "vented", "sealed")
FROZEN = [(action, bag) for action in ("push", "pull") for bag in BAGS[1:]]
TESTS = {
    test.name: test
    for test in (
        BenchTest("press", "press", "soft"),
        *(BenchTest(f"{action} {bag}", action, bag) for action, bag in FROZEN),
    )
}


def force_name(action: str, low: float, high: float) -> str:
    """Return the name of the mean force between two displacements [m]."""
    return f"{action}_{low * 1e3:g}_to_{high * 1e3:g}_mm_N"


def mean_forces(test: BenchTest, curve: Curve) -> dict[str, float]:
    """Return the mean force [N] between every two edges of a test that a curve reaches, by name.

    Where the displacement falls back, as after a slip, its largest value so far counts.
    """
    way, found = np.maximum.accumulate(curve.displacement), {}
    for low, high in pairwise(test.edges):
        if way[0] <= low and high <= way[-1] * (1 + 1e-9):
            x = np.concatenate([[low], way[(way > low) & (way < high)], [high]])
            work = np.trapezoid(np.interp(x, way, curve.force), x)
            found[force_name(test.action, low, high)] = float(work / (high - low))
    return found


def bench(
    task: Task,
    *,
    bag: str = "vented",
    depth: float = 0.010,
    height: float = PUSH_HEIGHT,
    radius: float = Prism.radius,
    length: float = Prism.length,
    mass: float = Prism.mass,
    friction: float = Prism.friction,
) -> Outcome:
    """Carry out the tests of a bag on a standing cylinder; measure mean forces, keep the curves.

    Args:
        task: With the settings; nothing in it is random.
        bag: One of `BAGS`.
        depth: To which the cylinder is pressed below the apex of the bag [m].
        height: Of the push, above the apex [m].
        radius: Of the cylinder [m].
        length: Of the cylinder [m].
        mass: Of the cylinder [kg].
        friction: Between membrane and cylinder.
    """
    if bag not in BAGS:
        raise UnknownName("bag", bag, BAGS)
    part = Prism(radius, length, mass, friction=friction)
    steps = task.config.simulation.time_step, task.config.simulation.contact_approximation
    curves = simulate(task.config.jig, bag, part, depth, height, steps)
    measured, arrays = {}, {}
    for test in TESTS.values():
        if test.bag == bag:
            curve = curves[test.action]
            measured |= mean_forces(test, curve)
            arrays[test.action] = np.column_stack([curve.displacement, curve.force])
    write_arrays(task.file("curves.npz"), arrays)
    return Outcome(True, measured)


def simulate(
    jig: JigParameters,
    bag: str,
    part: Prism,
    depth: float,
    height: float = PUSH_HEIGHT,
    steps: tuple[float, str] = (1e-3, "lagged"),
) -> dict[str, Curve]:
    """Return force over displacement of each action on a bag.

    Args:
        jig: With the vacuum of the test.
        bag: One of `BAGS`.
        part: Its friction is that of the pair.
        depth: To which it is pressed [m].
        height: Of the push, above the apex [m].
        steps: Time step [s] and contact approximation.
    """
    if bag == "soft":
        return {"press": pressed(Bed(jig.bag, jig.soil), part, depth, PRESS_SPEED, steps[0])}
    # The mean of equal frictions is that of the pair.
    jig = replace(
        jig,
        jammed=replace(jig.jammed, friction=part.friction),
        vacuum=replace(jig.vacuum, time_constant=PUMP_TIME),
        suction=replace(jig.suction, enabled=bag == "sealed"),
    )
    rig = ElementRig(jig, part, time_step=steps[0], approximation=steps[1])
    rig.lower_to(depth, speed=0.04)
    rig.jam(SETTLE)
    rig.let_go(SETTLE / 2)
    held, curves = rig.saved(), {}
    for action, at, direction in (("push", height + depth, SIDEWAYS), ("pull", part.length, UP)):
        rig.restore(held)
        drag = rig.drag(np.array([0.0, 0.0, at]), direction, WAY, SPEED)
        curves[action] = Curve(drag.way, drag.force)
    return curves
