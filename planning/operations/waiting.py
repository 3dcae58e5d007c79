"""Waiting for what is measured: end conditions that hold once a reading has come to rest.

A fixed time would be too long in most cases and too short in the worst one. A condition serves one
phase, for it remembers what it has read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from cell.simulation.phase import Condition, Sensed

QUIET_TIME = 0.03  # What has not changed for this long is at rest [s] [A].
STEADY_FORCE = 0.2  # Change of a wrist's force that does not count [N] [A].
STEADY_OPENING = 5e-5  # Change of the jaws' opening that does not count [m] [A].


@dataclass
class Steady:
    """End condition: a reading has stayed the same for a while.

    Attributes:
        read: Returns the reading (n,).
        band: How far it may go and still count as the same.
        duration: For how long [s].
    """

    read: Callable[[Sensed], np.ndarray]
    band: float
    duration: float = QUIET_TIME
    _since: float = 0.0
    _last: np.ndarray | None = field(default=None)

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether it has; to be asked after every step."""
        here = self.read(sensed)
        if self._last is None or np.linalg.norm(here - self._last) > self.band:
            self._last, self._since = here, sensed.time
        return sensed.time - self._since >= self.duration


def steady_wrist(arm: str) -> Steady:
    """Return the condition that an arm's wrist feels a steady force."""
    return Steady(lambda sensed: sensed.wrench[arm][3:], STEADY_FORCE)


def at_rest(arm: str) -> Condition:
    """Return the condition that an arm's motion has ended and it does not swing any more."""
    steady = steady_wrist(arm)
    return lambda sensed: sensed.finished and steady(sensed)


def steady_jaws(gripper: str) -> Steady:
    """Return the condition that the jaws have come to rest: open, or on what is in between."""
    return Steady(lambda sensed: np.array([sensed.grippers[gripper].opening]), STEADY_OPENING)
