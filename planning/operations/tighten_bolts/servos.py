"""What the driver does by feel: it follows the sinking bolt, and stops when the clutch trips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.simulation.phase import Sensed
from cell.simulation.vocabulary import in_programs
from planning.motion.timing import JointMotion

FEED_GAIN = 0.02  # Feed speed per missing thrust [m/s per N] [A].
FEED_LIMIT = 0.02  # [m/s] [A]
CLUTCH_TIME = 0.002  # The clutch does not feel shorter shocks [s] [A].


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
