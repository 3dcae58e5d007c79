"""The vocabulary of execution: a phase commands the cell until its end condition holds.

An operation is a generator of phases; it receives the `Outcome` of each one back, so that the next
phase is built from what was sensed. Nothing here steps a simulator.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import Frame


class Motion(Protocol):
    """A timed joint trajectory from rest to rest."""

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        ...

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return joint angles (6,) [rad] and rates (6,) [rad/s]; the end holds, at rest."""
        ...


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


@dataclass(frozen=True)
class Follow:
    """A joint target that a function computes every step from what is sensed: a servo.

    Attributes:
        target: Returns joint angles (6,) and rates (6,).
    """

    target: Callable[[Sensed], tuple[np.ndarray, np.ndarray]]


ArmCommand = Motion | Impedance | Follow


@dataclass(frozen=True)
class Jaw:
    """Drive the gripper to an opening, pressing with a force once something is in between.

    Attributes:
        opening: Distance between the tip pads to aim at [m].
        force: Grip force per pad [N]; 0 to open.
    """

    opening: float
    force: float = 0.0


@dataclass(frozen=True)
class Sensed:
    """What the end condition of a phase may look at; everything is measured, nothing assumed.

    Attributes:
        time: Time in the phase [s].
        step: Steps in the phase.
        wrench: By arm name: (6,) torque [N m] and force [N] that the surroundings exert on the
            tool, in W, less the reading at the latest taring.
        jaw_opening: Distance between the tip pads [m].
        jaw_rate: Its rate [m/s].
        bit_push: Axial force of the driver's bit holder [N].
        spindle_torque: Torque of the driver's motor [N m].
        spindle_rate: [rad/s].
        finished: Whether every motion of the phase has come to its end.
        X_WF: Pose of a frame.
        X_WP: True pose of a part (for guards and verdicts; operations read the `PoseSensor`).
    """

    time: float
    step: int
    wrench: dict[str, np.ndarray]
    jaw_opening: float
    jaw_rate: float
    bit_push: float
    spindle_torque: float
    spindle_rate: float
    finished: bool
    X_WF: Callable[[Frame], RigidTransform]
    X_WP: Callable[[str], RigidTransform]


Condition = Callable[[Sensed], bool]


def motion_finished(sensed: Sensed) -> bool:
    """End condition: all motions are at their end."""
    return sensed.finished


def after(seconds: float) -> Condition:
    """End condition: the phase has lasted this long."""
    return lambda sensed: sensed.time >= seconds


@dataclass(frozen=True)
class Phase:
    """Commands that hold until the end condition does.

    Attributes:
        name: For the log and the verdict, for example "motor: press".
        until: End condition.
        timeout: The phase fails if it lasts longer [s].
        left, right: Command of each arm; None holds still.
        jaw: Gripper command; None keeps the last one.
        spindle: Driver speed about the bit's axis, positive tightens [rad/s]; None keeps it.
        guard: Returns a reason if the phase has failed, else None.
        start: Events at the start of the phase: functions of the simulation.
        every_step: Event after every step: thread catch, for example.
        awake: Names of the parts that are awake during the phase.
        fine_log: Log every step.
        tare: Whether the wrists read zero at the start; not in a phase that begins under load.
    """

    name: str
    until: Condition
    timeout: float
    left: ArmCommand | None = None
    right: ArmCommand | None = None
    jaw: Jaw | None = None
    spindle: float | None = None
    guard: Callable[[Sensed], str | None] | None = None
    start: tuple[Callable, ...] = ()
    every_step: Callable | None = None
    awake: frozenset[str] = frozenset()
    fine_log: bool = False
    tare: bool = True


@dataclass(frozen=True)
class Outcome:
    """What a finished phase hands back to the operation.

    Attributes:
        sensed: The last reading.
        peak_force: By arm name, largest force of the wrist wrench [N].
    """

    sensed: Sensed
    peak_force: dict[str, float]


class PhaseFailed(Exception):
    """A phase that timed out, tripped its guard or broke the solver: a verdict, not an error.

    Attributes:
        phase: Its name.
        evidence: Why, in one line.
    """

    def __init__(self, phase: str, evidence: str) -> None:
        super().__init__(f"{phase}: {evidence}")
        self.phase = phase
        self.evidence = evidence
