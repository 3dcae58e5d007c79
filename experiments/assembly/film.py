"""The surfaces that the jig's bag takes in a run, kept as they change."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from pydrake.systems.framework import Context, EventStatus

from cell.fixtures.soft_jig import SoftJig
from cell.fixtures.soft_jig.soft.bed import Bed
from cell.simulation.simulation import Simulation

SURFACE_PERIOD = 0.1  # Between two surfaces at least [s] [A].

Monitor = Callable[[Context], EventStatus | None]  # Called after each step of a simulation.


@dataclass
class Film:
    """Collects the surface of a soft jig each time it has changed; of other fixtures, nothing.

    Attributes:
        surfaces: Time [s] from which each was there, and the bed with it, in order.
    """

    surfaces: list[tuple[float, Bed]] = field(default_factory=list)

    def follow(self, simulation: Simulation) -> Monitor | None:
        """Keep the present surface; return what has to be called after each step."""
        jig = simulation.cell.fixture
        if not isinstance(jig, SoftJig):
            return None

        def watch(root: Context) -> None:
            self._keep(root.get_time(), jig.memory(root).bed)

        if not self.surfaces:
            watch(simulation.root)
        return watch

    def _keep(self, time: float, bed: Bed) -> None:
        # Time that goes back is that of a step that is carried out again.
        while len(self.surfaces) > 1 and self.surfaces[-1][0] > time:
            self.surfaces.pop()
        if self.surfaces:
            last, kept = self.surfaces[-1]
            early = time - last < SURFACE_PERIOD - 1e-6
            if early or np.array_equal(kept.heights, bed.heights):
                return
        self.surfaces.append((time, copy.deepcopy(bed)))
