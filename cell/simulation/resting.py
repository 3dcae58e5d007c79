"""Parts that need not be awake any more fall asleep once they rest.

What was let go of rocks, slides or falls over for a while: sleep does not stop it on the way, and
what bears it stays awake with it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context

from cell.workpieces.parts import LoosePart, Parts

# A part that is slower rests [m/s] [A]: in a step of 2 ms it moves by 2 um.
AT_REST = 1e-3
# Motion is measured over this time [s] [A]: a part that only shivers from step to step stays there.
WINDOW = 0.02
LEVER = 0.02  # At which a rotation counts as a motion: half the size of a small part [m] [A].


class Resting:
    """Waits in one phase for the parts that are to sleep in it.

    Args:
        parts: Of the cell.
        root: Context of the diagram.
        awake: Names of the parts that are awake in the phase in any case.
        time_step: Of the plant [s].
    """

    def __init__(
        self, parts: Parts, root: Context, awake: frozenset[str], time_step: float
    ) -> None:
        self._parts, self._root, self._awake = parts, root, awake
        self._leaving = [p for p in parts if not p.asleep(root) and p.part.name not in awake]
        self._every = max(1, round(WINDOW / time_step))
        self._steps = 0
        self._before = [self._points(part) for part in self._leaving]
        self._wait(any(self._speed(part) > AT_REST for part in self._leaving))

    def step(self) -> None:
        """Look, after a step of the plant, whether all of them rest."""
        if not self._leaving:
            return
        self._steps += 1
        if self._steps % self._every == 0:
            now = [self._points(part) for part in self._leaving]
            ways = [np.abs(b - a).max() for a, b in zip(self._before, now, strict=True)]
            self._before = now
            self._wait(max(ways) > AT_REST * WINDOW)

    def _wait(self, moving: bool) -> None:
        if not moving:
            self._leaving = []
        staying = {part.part.name for part in self._leaving}
        self._parts.sleep_all_but(self._root, self._awake | staying)

    def _points(self, part: LoosePart) -> NDArray[np.float64]:
        """Return the mass centre and three points beside it (3, 4), in W [m]."""
        context = part.plant.GetMyContextFromRoot(self._root)
        X_WP, centre = part.X_WP(context), part.body.default_com()
        beside = np.hstack([np.zeros((3, 1)), LEVER * np.eye(3)])
        return np.asarray(X_WP @ (centre[:, None] + beside))

    def _speed(self, part: LoosePart) -> float:
        context = part.plant.GetMyContextFromRoot(self._root)
        way = part.body.CalcCenterOfMassTranslationalVelocityInWorld(context)
        turn = part.velocity(context)[:3]
        return max(float(np.linalg.norm(way)), LEVER * float(np.linalg.norm(turn)))
