"""Targets of a soft hand: where it is drawn to over the time of a phase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from cell.simulation.vocabulary import in_programs
from planning.operations.grasping import raised


@in_programs
@dataclass(frozen=True)
class There:
    """A target that stays.

    Attributes:
        X_WD: Where.
    """

    X_WD: RigidTransform

    def __call__(self, t: float) -> RigidTransform:
        """Return the target at a time [s]."""
        return self.X_WD


@in_programs
@dataclass(frozen=True)
class Descent:
    """A target that goes straight down to a seat and beyond.

    Attributes:
        X_WSeat: Where it would be seated.
        times: (n,) rising from 0 [s].
        heights: (n,) over the seat at these times [m]; straight between them.
    """

    X_WSeat: RigidTransform
    times: np.ndarray
    heights: np.ndarray

    def __call__(self, t: float) -> RigidTransform:
        """Return the target at a time [s]."""
        return raised(self.X_WSeat, float(np.interp(t, self.times, self.heights)))


@in_programs
@dataclass(frozen=True)
class Spiral:
    """A target on an Archimedean spiral of constant speed about a vertical axis.

    With pitch p the arc length is s = p angle^2 / (4 pi), so the angle is sqrt(4 pi s / p).

    Attributes:
        X_WMiddle: Where it begins.
        pitch: Between two turns [m].
        speed: [m/s].
    """

    X_WMiddle: RigidTransform
    pitch: float
    speed: float

    def __call__(self, t: float) -> RigidTransform:
        """Return the target at a time [s]."""
        angle = np.sqrt(4 * np.pi * self.speed * t / self.pitch)
        radius = self.pitch * angle / (2 * np.pi)
        offset = radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        X = self.X_WMiddle
        return RigidTransform(X.rotation(), X.translation() + offset)
