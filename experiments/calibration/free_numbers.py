"""The numbers of the jig that bench records decide, and those that they do not.

The prior is flat over the plausible range, of the number or of its logarithm. The ranges are
those that `cell.fixtures.soft_jig` states with its sources, wider where a real bag may be of
another make.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.calibration.bench import BenchTest

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FreeNumber:
    """A number that records decide.

    Attributes:
        path: In the configuration.
        unit: SI.
        low: Lower end of its plausible range.
        high: Upper end.
        log: Whether the prior is flat in its logarithm.
        soft: Whether it shows in the soft bag, or in the frozen one.
        sealed_only: Whether it shows only where no air gets under the specimen.
    """

    path: str
    unit: str
    low: float
    high: float
    log: bool
    soft: bool = False
    sealed_only: bool = False

    def shows_in(self, test: BenchTest) -> bool:
        """Whether a test depends on it."""
        soft = test.bag == "soft"
        return soft == self.soft and not (self.sealed_only and test.bag == "vented")

    def value(self, share: Array) -> Array:
        """Return values at shares 0 to 1 of the prior."""
        if self.log:
            return self.low * (self.high / self.low) ** share
        return self.low + (self.high - self.low) * share

    def share(self, value: Array) -> Array:
        """Return where values lie in the prior, 0 to 1."""
        if self.log:
            return np.log(value / self.low) / np.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


FREE = (
    FreeNumber("jig.soil.membrane_modulus", "N/m", 50.0, 400.0, log=True, soft=True),
    FreeNumber("jig.soil.initial_stretch", "", 1.0, 1.05, log=False, soft=True),
    FreeNumber("jig.jammed.modulus", "Pa", 10e6, 135e6, log=True),
    FreeNumber("jig.jammed.strength", "", 0.3, 3.0, log=True),
    FreeNumber("jig.jammed.touched_vented", "", 0.1, 0.6, log=True),
    FreeNumber("jig.jammed.squeeze", "m", -0.04e-3, 0.0, log=False),
    FreeNumber("jig.suction.strength", "Pa", 0.0, 90e3, log=False, sealed_only=True),
)

# What these tests leave as it is configured, and why.
NOT_DECIDED: Mapping[str, str] = {
    "jig.soil.friction_angle": "shows only in products with membrane_modulus (soft) and strength "
    "(frozen), which are therefore stated for the angle configured: shear box",
    "jig.jammed.friction": "taken from the header, of the pair: slide the specimen over the bag",
    "jig.jammed.touched_sealed": "hides behind the suction",
    "jig.jammed.modulus_exponent": "one vacuum: repeat at another",
    "jig.vacuum.time_constant": "read it off the pressure gauge",
}


def shown_in(tests: Sequence[BenchTest]) -> list[FreeNumber]:
    """Return the numbers that at least one of some tests depends on."""
    return [number for number in FREE if any(number.shows_in(test) for test in tests)]
