"""When part and jig have come to rest, and waiting longer would change nothing."""

from __future__ import annotations

from collections import deque

import numpy as np
from pydrake.multibody.tree import RigidBody

from experiments.paper.rig.stage import Observer

STILL = 1e-4  # [m/s] [A] A tenth of the speed at which a part is no longer said to rest.
WINDOW = 0.1  # [s] [A] What falls over doubles its speed in half of it.
LEVER = 0.02  # At which a rotation counts as motion [m] [A].


class Rest:
    """Tells whether part and jig rest; it is asked once per step.

    They do when both have been slower than `STILL` for `WINDOW` and were not faster in its second
    half than in its first: a part that is about to fall over begins slowly.

    Args:
        observer: Of part and jig.
    """

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self._steps = round(WINDOW / observer.stage.config.simulation.time_step)
        self._speeds: deque[float] = deque(maxlen=self._steps)

    def reached(self) -> bool:
        """Return whether they rest, after one more step."""
        stage = self._observer.stage
        self._speeds.append(max(self._speed(stage.part.body), self._speed(stage.jig_base.body)))
        if len(self._speeds) < self._steps:
            return False
        before, after = (half.max() for half in np.array_split(np.array(self._speeds), 2))
        return bool(before < STILL and after <= before)

    def _speed(self, body: RigidBody) -> float:
        V_WB = self._observer.stage.plant.EvalBodySpatialVelocityInWorld(
            self._observer.context, body
        )
        turning = LEVER * float(np.linalg.norm(V_WB.rotational()))
        return max(float(np.linalg.norm(V_WB.translational())), turning)
