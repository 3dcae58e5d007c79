"""How fast a push goes: an even speed-up from rest, then steady, then a dead stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Stroke:
    """Distance over time.

    Attributes:
        way: Length [m], above 0.
        speed: Reached if the way is long enough [m/s].
        acceleration: From rest [m/s2].
    """

    way: float
    speed: float
    acceleration: float

    @property
    def top(self) -> float:
        """Largest speed [m/s]."""
        return self.acceleration * self._ramp

    @property
    def duration(self) -> float:
        """Time until the dead stop [s]."""
        return self._ramp + (self.way - self.top * self._ramp / 2) / self.top

    def at(self, t: float) -> tuple[float, float]:
        """Return the distance gone [m] and the speed [m/s]; from the end on, at rest."""
        if t >= self.duration:
            return self.way, 0.0
        fast = min(t, self._ramp)
        return self.acceleration * fast**2 / 2 + self.top * (t - fast), self.acceleration * fast

    @property
    def _ramp(self) -> float:
        full = float(np.sqrt(2 * self.way / self.acceleration))
        return min(self.speed / self.acceleration, full)
