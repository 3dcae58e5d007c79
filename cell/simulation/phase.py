"""The vocabulary of execution: a phase commands devices until its end condition holds.

An operation is a generator of phases; it receives the `Outcome` of each one back, so that the next
phase is built from what was sensed. Nothing here steps a simulator.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import Context

from cell.builder import Cell
from cell.errors import RunFailure
from cell.machines.driver import DriverReading
from cell.machines.gripper import GripperReading
from cell.simulation.vocabulary import in_programs


class Motion(Protocol):
    """A timed joint trajectory from rest to rest."""

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        ...

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return joint angles (n,) [rad] and rates (n,) [rad/s]; the end holds, at rest."""
        ...


@in_programs
@dataclass(frozen=True)
class Impedance:
    """Cartesian impedance of a frame C about a moving target D.

    Attributes:
        frame: A frame F of the tool.
        X_FC: Pose of the compliance centre C in F.
        X_WD: Target pose as a function of the time in the phase [s].
        stiffness: (6,) rotational [N m/rad], then translational [N/m], in the axes of W.
        limit: (6,) largest torque [N m] and force [N] of the spring, in the axes of W.
        bias: (6,) constant wrench added, in W: weight of what is carried.
    """

    frame: Frame
    X_FC: RigidTransform
    X_WD: Callable[[float], RigidTransform]
    stiffness: np.ndarray
    limit: np.ndarray
    bias: np.ndarray = field(default_factory=lambda: np.zeros(6))


@in_programs
@dataclass(frozen=True)
class Follow:
    """A joint target that a function computes every step from what is sensed: a servo.

    Attributes:
        target: Returns joint angles (n,) and rates (n,).
    """

    target: Callable[[Sensed], tuple[np.ndarray, np.ndarray]]


@in_programs
@dataclass(frozen=True)
class Jaw:
    """Drive a gripper to an opening, pressing with a force once something is in between.

    Attributes:
        opening: Distance between the tip pads to aim at [m].
        force: Grip force per pad [N]; 0 to open.
    """

    opening: float
    force: float = 0.0


@in_programs
@dataclass(frozen=True)
class Spin:
    """Turn a driver's spindle.

    Attributes:
        speed: About the bit's axis, positive tightens [rad/s].
    """

    speed: float


ArmCommand = Motion | Impedance | Follow
Command = ArmCommand | Jaw | Spin


@dataclass(frozen=True)
class Sensed:
    """What the end condition of a phase may look at; everything is measured, nothing assumed.

    Attributes:
        time: Time in the phase [s].
        step: Steps in the phase.
        wrench: By arm: (6,) torque [N m] and force [N] that the surroundings exert on its tool, in
            W, less the reading at the latest taring.
        grippers: By device: opening and its rate.
        drivers: By device: axial push, torque and speed of the spindle.
        finished: Whether every motion of the phase has come to its end.
        X_WF: Pose of a frame, from the joint encoders.
        signal: What a device says by name: "fixture fixed", "fixture freed", "NAME in bit".
        lacking: What keeps the fixture from holding, in words; "" if it holds, or cannot say.
    """

    time: float
    step: int
    wrench: Mapping[str, np.ndarray]
    grippers: Mapping[str, GripperReading]
    drivers: Mapping[str, DriverReading]
    finished: bool
    X_WF: Callable[[Frame], RigidTransform]
    signal: Callable[[str], bool] = field(default=lambda name: False)
    lacking: Callable[[], str] = field(default=lambda: "")


Condition = Callable[[Sensed], bool]
Guard = Callable[[Sensed], str | None]


class Running(Protocol):
    """What an event acts on: a running cell."""

    @property
    def cell(self) -> Cell:
        """The cell."""
        ...

    @property
    def root(self) -> Context:
        """Context of the diagram."""
        ...

    @property
    def steps(self) -> int:
        """Plant steps so far."""
        ...

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        ...


Event = Callable[[Running], None]


def what_is_missing(condition: Condition, sensed: Sensed) -> str:
    """Return what a condition that does not hold is waiting for; "" if it cannot say.

    A condition says so with a method ``missing(sensed)``.
    """
    missing: Callable[[Sensed], str] = getattr(condition, "missing", lambda sensed: "")
    return missing(sensed)


@in_programs
@dataclass(frozen=True)
class Finished:
    """End condition: all motions are at their end."""

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether they are."""
        return sensed.finished

    def missing(self, sensed: Sensed) -> str:
        """Return what it is waiting for."""
        return "" if sensed.finished else "a motion is not at its end"


@in_programs
@dataclass(frozen=True)
class After:
    """End condition: the phase has lasted this long [s]."""

    seconds: float

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether it has."""
        return sensed.time >= self.seconds


motion_finished = Finished()


def after(seconds: float) -> Condition:
    """End condition: the phase has lasted this long [s]."""
    return After(seconds)


@dataclass(frozen=True)
class Phase:
    """Commands that hold until the end condition does.

    Attributes:
        kind: Which phase of its operation it is; the member's value is its name in log and verdict.
        until: End condition.
        timeout: The phase fails if it lasts longer [s].
        subject: Name of the part it is about; "" for none.
        commands: By device name; an arm without one holds still, a tool keeps its last one.
        guard: Returns a reason if the phase has failed, else None.
        start: Events at the start of the phase.
        every_step: Event after every step.
        awake: Names of the parts that are awake during the phase.
        mating: Names of each pair that is being mated, or whose hold is tested, parts or a part and
            the fixture: their contact is computed in full.
        riding: Names of bolts that lie loose in a part that is carried or set down and touch
            nothing else: while they stick to it, they may be linked.
        fine_log: Log every step.
        tare: Whether the wrists read zero at the start; not in a phase that begins under load.
    """

    kind: Enum
    until: Condition
    timeout: float
    subject: str = ""
    commands: Mapping[str, Command] = field(default_factory=dict)
    guard: Guard | None = None
    start: tuple[Event, ...] = ()
    every_step: Event | None = None
    awake: frozenset[str] = frozenset()
    mating: frozenset[frozenset[str]] = frozenset()
    riding: frozenset[str] = frozenset()
    fine_log: bool = False
    tare: bool = True

    @property
    def name(self) -> str:
        """For the log and the verdict, for example "motor: press"."""
        return f"{self.subject}: {self.kind.value}" if self.subject else str(self.kind.value)


@dataclass(frozen=True)
class Outcome:
    """What a finished phase hands back to the operation.

    Attributes:
        sensed: The last reading.
        peak_force: By arm name, largest force of the wrist wrench [N].
    """

    sensed: Sensed
    peak_force: Mapping[str, float]


class PhaseFailed(RunFailure):
    """A phase that timed out, tripped its guard or left the state not finite.

    Attributes:
        phase: Its name.
        evidence: Why, in one line.
    """

    def __init__(self, phase: str, evidence: str) -> None:
        super().__init__(f"{phase}: {evidence}")
        self.phase = phase
        self.evidence = evidence


class SolverFailed(PhaseFailed):
    """A step of the plant that Drake's contact solver could not solve."""
