"""End conditions and guards as values: what they wait for can be read, written and replayed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import Frame

from cell.simulation.phase import Condition, Guard, Sensed, what_is_missing
from cell.simulation.vocabulary import in_programs

# What is read.


@in_programs
@dataclass(frozen=True)
class WristForce:
    """The force (3,) on the tool of an arm, less that at the latest taring, in W [N]."""

    arm: str

    def __call__(self, sensed: Sensed) -> np.ndarray:
        """Return the reading."""
        return sensed.wrench[self.arm][3:]

    @property
    def what(self) -> str:
        """What is read, for evidence."""
        return f"the force on the {self.arm} arm"


@in_programs
@dataclass(frozen=True)
class JawOpening:
    """The distance (1,) between the tip pads of a gripper [m]."""

    gripper: str

    def __call__(self, sensed: Sensed) -> np.ndarray:
        """Return the reading."""
        return np.array([sensed.grippers[self.gripper].opening])

    @property
    def what(self) -> str:
        """What is read, for evidence."""
        return "the opening of the jaws"


@in_programs
@dataclass(frozen=True)
class Height:
    """How high (1,) the origin of a frame Q, fixed in a frame F of a tool, is over W [m]."""

    frame: Frame
    X_FQ: RigidTransform = field(default_factory=RigidTransform)

    def __call__(self, sensed: Sensed) -> np.ndarray:
        """Return the reading."""
        return (sensed.X_WF(self.frame) @ self.X_FQ).translation()[2:]

    @property
    def what(self) -> str:
        """What is read, for evidence."""
        return f"the height of the {self.frame.name()}"


# End conditions.


@in_programs
@dataclass
class Steady:
    """A reading has stayed the same for a while. Serves one phase: it remembers what it has read.

    Attributes:
        read: Returns the reading (n,).
        band: How far it may go and still count as the same.
        duration: For how long [s].
    """

    read: Callable[[Sensed], np.ndarray]
    band: float
    duration: float
    _since: float = 0.0
    _last: np.ndarray | None = field(default=None)

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether it has; to be asked after every step."""
        here = self.read(sensed)
        if self._last is None or np.linalg.norm(here - self._last) > self.band:
            self._last, self._since = here, sensed.time
        return sensed.time - self._since >= self.duration

    def missing(self, sensed: Sensed) -> str:
        """Return what it is waiting for."""
        quiet = sensed.time - self._since >= self.duration
        return "" if quiet else f"{getattr(self.read, 'what', 'a reading')} has not come to rest"


@in_programs
@dataclass(frozen=True)
class PushesBack:
    """The surroundings push an arm's tool up with a force [N]."""

    arm: str
    force: float

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether they do."""
        return bool(sensed.wrench[self.arm][5] >= self.force)

    def missing(self, sensed: Sensed) -> str:
        """Return what it is waiting for."""
        felt = sensed.wrench[self.arm][5]
        return f"the {self.arm} arm is pushed up with {felt:.1f} N, not with {self.force:g} N"


@in_programs
@dataclass(frozen=True)
class BitPushedIn:
    """The bit pushes the spring of a driver's bit holder in with a force [N]."""

    driver: str
    force: float

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether it does."""
        return sensed.drivers[self.driver].push >= self.force

    def missing(self, sensed: Sensed) -> str:
        """Return what it is waiting for."""
        push = sensed.drivers[self.driver].push
        return f"the bit is pushed in with {push:.1f} N, not with {self.force:g} N"


@in_programs
@dataclass(frozen=True)
class Below:
    """A point of a tool is lower than a height over W [m]; ``otherwise``: what it means if not."""

    point: Height
    height: float
    otherwise: str = ""

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether it is."""
        return bool(self.point(sensed)[0] < self.height)

    def missing(self, sensed: Sensed) -> str:
        """Return what it is waiting for."""
        above = 1e3 * (self.point(sensed)[0] - self.height)
        high = f"the {self.point.frame.name()} is {above:.2f} mm too high"
        return f"{self.otherwise}: {high}" if self.otherwise else high


FIXED = "fixture fixed"  # The signal whose absence the fixture can explain.


@in_programs
@dataclass(frozen=True)
class Signal:
    """A device says yes: "fixture fixed", "fixture freed", or "NAME in bit" of a bolt."""

    name: str

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether it does."""
        return sensed.signal(self.name)

    def missing(self, sensed: Sensed) -> str:
        """Return what it is waiting for."""
        reason = sensed.lacking() if self.name == FIXED else ""
        return f"no signal '{self.name}'{f': {reason}' if reason else ''}"


@in_programs
@dataclass(frozen=True)
class All:
    """Every one of some conditions holds; one is asked only once those before it hold."""

    conditions: tuple[Condition, ...]

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether they do."""
        return all(condition(sensed) for condition in self.conditions)

    def missing(self, sensed: Sensed) -> str:
        """Return what the first that does not hold is waiting for."""
        for condition in self.conditions:
            if not condition(sensed):
                return what_is_missing(condition, sensed)
        return ""


@in_programs
@dataclass(frozen=True)
class Either:
    """One of some conditions holds."""

    conditions: tuple[Condition, ...]

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether one does."""
        return any(condition(sensed) for condition in self.conditions)


# Guards.


@in_programs
@dataclass(frozen=True)
class LostGrasp:
    """Fails when the jaws of a gripper are closer together than they can be about a part [m]."""

    gripper: str
    least: float

    def __call__(self, sensed: Sensed) -> str | None:
        """Return the evidence, if they are."""
        opening = sensed.grippers[self.gripper].opening
        return f"lost grasp: jaws at {1e3 * opening:.2f} mm" if opening < self.least else None


@in_programs
@dataclass(frozen=True)
class TooMuchForce:
    """Fails when the force on an arm's tool exceeds a limit [N]; ``what`` is said of it."""

    arm: str
    limit: float
    what: str

    def __call__(self, sensed: Sensed) -> str | None:
        """Return the evidence, if it does."""
        force = float(np.linalg.norm(sensed.wrench[self.arm][3:]))
        return f"{self.what} {force:.1f} N" if force > self.limit else None


@in_programs
@dataclass(frozen=True)
class FirstOf:
    """Fails when one of some guards does."""

    guards: tuple[Guard, ...]

    def __call__(self, sensed: Sensed) -> str | None:
        """Return the evidence of the first that does."""
        return next(filter(None, (guard(sensed) for guard in self.guards)), None)
