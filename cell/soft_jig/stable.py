"""Stepping a part that lies on an explicit bed of springs and dampers.

The soft bed's force on a part is known before the plant's step and constant during it. Such a
spring feeds energy into a light part, and the force of a hand that lets go is answered a step too
late: 20 N for 1 ms throw a 68 g plate off at 0.3 m/s. Two things prevent both.

The springs' stiffness is bounded so that k dt2 stays below the part's own inertia in the stiffest
mode. And the dampers act on the velocity that the part will have after the step (backward Euler),
predicted from its inertia, the bed's force and what else was felt to act on it in the step before.
Damping may then be as strong as the beads', and a hand with its inertia only makes it calmer: the
predicted force lags by dt (1 + c dt / m) there, which stays passive while k dt2 < m.

Spatial vectors have the angular part first, are about the part's origin P and in the jig frame J.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Largest k dt2 over inertia: below 1, where a lagging damper would feed a heavy hand's motion.
SAFE = 0.8


@dataclass(frozen=True)
class Springs:
    """The bed under a part: per point a cell, the part's height z over it, arm from P and area.

    Attributes:
        modulus: Of all [Pa/m].
    """

    cells: NDArray[np.int64]
    z: Array
    arms: Array
    areas: Array
    modulus: float


def cross_matrix(w: Array) -> Array:
    """Return [w] with [w] v = w x v."""
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def normal_rows(arms: Array) -> Array:
    """Return the rows (n, 6) that map a spatial velocity to the upward velocity at arms (n, 3)."""
    zero = np.zeros(len(arms))
    return np.column_stack([arms[:, 1], -arms[:, 0], zero, zero, zero, zero + 1.0])


def largest_stiffness(inertia: Array, arms: Array, areas: Array, dt: float) -> float:
    """Return the largest safe Winkler modulus, normal and tangential alike [Pa/m].

    Args:
        inertia: (6, 6) of the body.
        arms: (n, 3) from P to the points that touch [m].
        areas: (n,) [m2].
        dt: Step [s].
    """
    # The sum over all three directions of A j j', with j the row that gives a point's velocity.
    first, total = areas @ arms, float(areas.sum())
    second = arms.T @ (areas[:, None] * arms)
    cross = cross_matrix(first)
    square = np.trace(second) * np.eye(3) - second
    touched = np.block([[square, cross], [cross.T, total * np.eye(3)]])
    stiffest = np.linalg.eigvals(np.linalg.solve(inertia, touched)).real.max()
    return float(SAFE / (stiffest * dt**2))


@dataclass
class Carried:
    """What is remembered of a part that the bed carries, for the forces that others exert on it.

    Attributes:
        V: (6,) its velocity in the latest step.
        F: (6,) the bed's force on it in that step.
        known: Whether there was such a step.
    """

    V: Array = field(default_factory=lambda: np.zeros(6))
    F: Array = field(default_factory=lambda: np.zeros(6))
    known: bool = False

    def others(self, inertia: Array, V: Array, F_spring: Array, dt: float) -> Array:
        """Return the force (6,) of all else in the latest step; at first, what balances the bed."""
        if not self.known:
            return -F_spring
        return inertia @ (V - self.V) / dt - self.F

    def ahead(
        self, inertia: Array, rows: Array, spring: Array, damping: Array, V: Array, dt: float
    ) -> Array:
        """Return the velocity (6,) after the coming step.

        Args:
            inertia: (6, 6) of the part.
            rows: (n, 6) that map to the velocity at each point of contact.
            spring: (n,) elastic force there [N].
            damping: (n,) [N s/m].
            V: (6,) velocity now.
            dt: Step [s].
        """
        F_spring = rows.T @ spring
        pushed = inertia @ V + dt * (F_spring + self.others(inertia, V, F_spring, dt))
        damped = inertia + dt * rows.T @ (damping[:, None] * rows)
        return np.linalg.solve(damped, pushed).astype(float)

    def row(self) -> Array:
        """Return everything as one row (13,), for saving."""
        return np.concatenate([self.V, self.F, [float(self.known)]])

    @staticmethod
    def from_row(row: Array) -> Carried:
        """Undo `row`."""
        return Carried(row[:6].copy(), row[6:12].copy(), bool(row[12]))
