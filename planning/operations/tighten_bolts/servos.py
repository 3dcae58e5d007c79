"""What the driver does by feel: it follows the sinking bolt, and stops when the clutch trips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.cad.screw_model import head_stiffness
from cell.products.joints import Screw
from cell.simulation.phase import Sensed
from cell.simulation.vocabulary import in_programs
from planning.motion.timing import JointMotion

FEED_GAIN = 0.02  # Feed speed per missing thrust [m/s per N] [A].
FEED_LIMIT = 0.02  # [m/s] [A]
CLUTCH_TIME = 0.002  # The clutch does not feel shorter shocks [s] [A].
# Turn from snug to tight of a joint that the whole speed suits [rad] [M]: M3, 0.5 N m, which ends
# 2 % above its torque.
SOFT_TURN = 0.1
SLOWEST = 1.0  # [rad/s] [A]: the last quarter of a millimetre takes seconds.


def seat_speed(screw: Screw, fastest: float) -> float:
    """Return the speed of the spindle while a screw is tightened [rad/s].

    A stiff joint is tight within a few degrees: in the time in which the clutch feels that a torque
    lasts it would rise far beyond it. The speed is in proportion to the turn that the joint takes.

    Args:
        screw: What is tightened.
        fastest: Of the spindle near a seat [rad/s].
    """
    force = screw.torque / (screw.nut_factor * screw.diameter)
    stretch = force / head_stiffness(1e3 * screw.diameter)
    turn = 2.0 * np.pi * stretch / screw.pitch
    return min(fastest, max(SLOWEST, fastest * turn / SOFT_TURN))


@in_programs
@dataclass
class Feed:
    """Servo of the driver's arm: sink so that the bit holder's spring pushes with a set force.

    Attributes:
        tool: Name of the driver.
        line: Motion straight down, as a path to be followed at the servo's own pace.
        length: Of that path [m].
        thrust: Wanted axial force on the bit [N].
        dt: Time step [s].
        progress: Time on the line reached so far [s].
    """

    tool: str
    line: JointMotion
    length: float
    thrust: float
    dt: float
    progress: float = 0.0

    def __call__(self, sensed: Sensed) -> tuple[np.ndarray, np.ndarray]:
        """Return the joint target for the next step."""
        missing = self.thrust - sensed.drivers[self.tool].push
        speed = float(np.clip(FEED_GAIN * missing, -FEED_LIMIT, FEED_LIMIT))
        rate = speed * self.line.duration / self.length
        self.progress = float(np.clip(self.progress + rate * self.dt, 0.0, self.line.duration))
        q, v = self.line.at(self.progress)
        return q, v * rate


@in_programs
@dataclass
class Clutch:
    """End condition: the spindle has kept up a torque; a shock does not trip it.

    Attributes:
        tool: Name of the driver.
        torque: To trip at [N m].
    """

    tool: str
    torque: float
    _reached: float | None = None

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether the clutch trips."""
        if sensed.drivers[self.tool].torque < self.torque:
            self._reached = None
        elif self._reached is None:
            self._reached = sensed.time
        # Times are multiples of the step, so half a microsecond only absorbs rounding.
        return self._reached is not None and sensed.time >= self._reached + CLUTCH_TIME - 5e-7

    def missing(self, sensed: Sensed) -> str:
        """Return what it is waiting for."""
        torque = sensed.drivers[self.tool].torque
        return f"the spindle turns with {torque:.2f} N m, not with {self.torque:g} N m"
