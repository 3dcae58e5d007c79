"""Simulation of a rig: commands to hand, jaws and fixture; forces and poses are recorded."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from cell.errors import RunFailure
from experiments.paper.rig.rig import HandPose, Rig
from experiments.paper.rig.stage import Observer
from experiments.speed.meter import Meter
from planning.operations.phase_class import classify
from planning.operations.stroke import Stroke


@dataclass(frozen=True)
class Path:
    """Joint targets of the carriage over time, starting from rest.

    Attributes:
        at: Returns positions (5,) and rates (5,) at a time [s].
        duration: After which the end position is held [s].
    """

    at: Callable[[float], tuple[np.ndarray, np.ndarray]]
    duration: float


def smooth_path(q0: np.ndarray, q1: np.ndarray, speed: float) -> Path:
    """Return the straight joint path from rest to rest with a mean speed of the fastest slide.

    A rotation counts as a slide at a lever arm of 0.1 m.

    Args:
        q0: (5,) start.
        q1: (5,) end.
        speed: [m/s].
    """
    way = float(np.max(np.abs(q1 - q0) * np.array([1.0, 1.0, 1.0, 0.1, 0.1])))
    duration = max(way / speed, 0.05)

    def at(t: float) -> tuple[np.ndarray, np.ndarray]:
        s = min(t / duration, 1.0)
        return q0 + (3 - 2 * s) * s**2 * (q1 - q0), 6 * s * (1 - s) / duration * (q1 - q0)

    return Path(at, duration)


def stroke_path(q0: np.ndarray, q1: np.ndarray, speed: float, acceleration: float) -> Path:
    """Return the straight path of a push: uniform acceleration [m/s2], then an abrupt stop."""
    way = float(np.linalg.norm((q1 - q0)[:3]))
    direction = (q1 - q0) / way
    stroke = Stroke(way, speed, acceleration)

    def at(t: float) -> tuple[np.ndarray, np.ndarray]:
        distance, rate = stroke.at(t)
        return q0 + distance * direction, rate * direction

    return Path(at, stroke.duration)


class RigSimulation:
    """A running rig.

    Args:
        rig: A built rig.
        X_WJ: Initial pose of the jig.
        X_WP: Initial pose of the part, on the stand.
        pose: Initial pose of the hand.

    Attributes:
        root: Context of the diagram.
        observer: Of part and jig.
        stepping_cpu: CPU seconds spent stepping so far.
        meter: The same by class of what goes on.
    """

    def __init__(
        self, rig: Rig, X_WJ: RigidTransform, X_WP: RigidTransform, pose: HandPose
    ) -> None:
        self.rig = rig
        self.simulator = Simulator(rig.diagram)
        self.simulator.set_monitor(rig.monitor)
        self.root: Context = self.simulator.get_mutable_context()
        self.observer = Observer(rig, self.root)
        self.stepping_cpu = 0.0
        self.meter = Meter()
        self.steps = 0
        self.pose = pose
        self._jaws_move = False
        rig.set_up(self.root, X_WJ, X_WP, rig.joints(pose))
        self.simulator.Initialize()

    @property
    def time_step(self) -> float:
        """Time step of the plant [s]."""
        return self.rig.config.simulation.time_step

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.steps * self.time_step

    # Commands.

    def begin(self, name: str) -> None:
        """Start a phase; the log and failures name it."""
        self._jaws_move = False
        self.observer.begin(name, self.time)

    def jaws(self, opening: float, force: float = 0.0) -> None:
        """Drive the tip pads to an opening [m], pressing with a force per pad [N] there."""
        self._jaws_move = True
        self.rig.gripper.command(self.root, opening, force)

    def press_with_part(self) -> None:
        """Tell the fixture to receive the part."""
        self.rig.fixture.receive(self.root, self.rig.part.body, self.rig.part.part.mesh)

    def fix(self) -> None:
        """Tell the fixture to begin to hold the part."""
        self.rig.fixture.fix(self.root)

    @property
    def fixed(self) -> bool:
        """Whether the fixture holds at its full strength."""
        return self.rig.fixture.fixed(self.root)

    def lower_palm(self) -> None:
        """Bring the palm down to where the real hand has it."""
        if self.rig.palm:
            self.rig.palm.come_down(self.root)

    def sleep(self) -> None:
        """Lock part and jig in place while nothing touches them, to save computation."""
        self.rig.sleeper.put_to_sleep(self.root, self.rig.part.body)
        self.rig.jig_base.sleep(self.root)

    def wake(self) -> None:
        """Release part and jig; from now on the contact that is put to the test is full."""
        tested = frozenset([self.rig.part.part.name, self.rig.fixture.name])
        self.rig.links.intend(self.root, mating=frozenset([tested]))
        self.rig.jig_base.wake(self.root)
        self.rig.sleeper.wake(self.root, self.rig.part.body)

    def wait(self, seconds: float) -> None:
        """Step without new commands [s]."""
        for _ in range(round(seconds / self.time_step)):
            self.step()

    def move(self, goal: HandPose, speed: float) -> None:
        """Move the hand to a pose; the mean speed is that of the fastest slide [m/s]."""
        start, self.pose = self.rig.joints(self.pose), goal
        self.follow(smooth_path(start, self.rig.joints(goal), speed))

    def push(self, goal: HandPose, speed: float, acceleration: float) -> None:
        """Move the hand straight to a pose, with an abrupt stop at the end."""
        start, self.pose = self.rig.joints(self.pose), goal
        self.follow(stroke_path(start, self.rig.joints(goal), speed, acceleration))

    def lower(self, speed: float, farthest: float, force: float) -> bool:
        """Lower the hand until the upward force on it reaches a limit.

        Args:
            speed: [m/s].
            farthest: Largest distance [m].
            force: Limit [N].

        Returns:
            Whether the limit was reached.
        """
        start = self.pose
        hanging = self.observer.latest[5]  # The reading includes the weight of the part.
        for k in range(1, round(farthest / speed / self.time_step) + 1):
            depth = speed * k * self.time_step
            self.pose = HandPose(start.p_WT - [0, 0, depth], start.turn, start.tilt)
            q = self.rig.joints(self.pose)
            self.rig.drive.set_target(self.root, q, np.array([0, 0, -speed, 0, 0]))
            self.step(moves=True)
            if self.observer.latest[5] - hanging >= force:
                self.rig.drive.set_target(self.root, q, np.zeros(5))
                return True
        return False

    def follow(self, path: Path) -> None:
        """Drive the carriage along a path."""
        for k in range(1, round(path.duration / self.time_step) + 2):
            # The implicit drive reaches the target at the end of the step.
            self.rig.drive.set_target(self.root, *path.at(k * self.time_step))
            self.step(moves=True)

    # Stepping.

    def step(self, *, moves: bool = False) -> None:
        """Advance the simulation by one step and record it.

        Args:
            moves: Whether the hand is on its way; jaws that were told to move in the present phase
                count as well.

        Raises:
            PhaseFailed: The part fell off, the fixture cannot hold its imprint, the solver failed
                or the state is not finite.
        """
        awake = not self.rig.jig_base.asleep(self.root)  # It sleeps when the part does.
        start = time.process_time()
        self.steps += 1
        try:
            self.simulator.AdvanceTo(self.time)
        except RunFailure as error:
            # An imprint that cannot be meshed is a verdict on the trial.
            raise self.observer.failure(str(error)) from error
        except RuntimeError as error:
            raise self.observer.failure(f"solver failure: {str(error).splitlines()[0]}") from error
        self.observer.step(self.steps, self.time)
        spent = time.process_time() - start
        self.stepping_cpu += spent
        kind = classify(moves=moves or self._jaws_move, awake=awake)
        self.meter.add(kind, spent, self.time_step)
