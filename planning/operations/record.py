"""What is recorded of a run, phase by phase, for what is measured of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform

from cell.builder import Cell
from planning.operations.snapshot import Snapshot
from planning.operations.station import Placement

if TYPE_CHECKING:
    from planning.operations.operation import Step

Arrays = Mapping[str, np.ndarray]
Measured = dict[str, float]  # Quantity, with its SI unit in the name -> value.


@dataclass(frozen=True)
class PhaseRecord:
    """One phase that came to its end.

    Attributes:
        start, end: The truth before its first and after its last time step.
        peak_force: By arm name, largest force at its wrist, less the reading at the start [N].
        awake: Names of the parts that were: nothing acts on a part that sleeps.
    """

    start: Snapshot
    end: Snapshot
    peak_force: Mapping[str, float]
    awake: frozenset[str] = frozenset()


@dataclass
class StepRecord:
    """One step of an assembly, up to where it ended, well or not.

    Attributes:
        step: Which one.
        start, end: The truth around it.
        base: Name of the part that the fixture holds; None before one is placed.
        placed: The truth when it had been placed, or when the run began with it on the fixture.
        origin: X_WP from which the part that is moved was once taken to the fixture, if it was.
        placement: Where on the fixture the part that is moved was meant to go, if it was.
        phases: By subject and kind; each occurs once in a step.
    """

    step: Step
    start: Snapshot
    base: str | None = None
    placed: Snapshot | None = None
    origin: RigidTransform | None = None
    placement: Placement | None = None
    phases: dict[tuple[str, Enum], PhaseRecord] = field(default_factory=dict)
    end: Snapshot | None = None

    def of(self, subject: str, *kinds: Enum) -> list[PhaseRecord]:
        """Return those phases of a subject that ran, in the order of the kinds asked for."""
        keys = [(subject, kind) for kind in kinds]
        return [self.phases[key] for key in keys if key in self.phases]

    def last_awake(self, part: str) -> Snapshot | None:
        """Return the truth at the end of the latest phase in which a part was awake."""
        ends = [phase.end for phase in self.phases.values() if part in phase.awake]
        return max(ends, key=lambda end: end.time, default=None)


def rows_between(log: Arrays, start: float, end: float) -> dict[str, np.ndarray]:
    """Return the log's columns with the rows in (start, end] [s] only."""
    time = log["time"]
    inside = (time > start + 1e-9) & (time <= end + 1e-9)
    return {name: a[inside] for name, a in log.items() if not name.startswith("phase_")}


def rows_of(log: Arrays, phases: Sequence[PhaseRecord]) -> dict[str, np.ndarray]:
    """Return the log's rows from the start of the first to the end of the last of these phases."""
    return rows_between(log, phases[0].start.time, phases[-1].end.time)


def logged_poses(cell: Cell, part: str, q: np.ndarray) -> list[RigidTransform]:
    """Return X_WP of a part for rows (n, nq) of the plant's positions."""
    start = cell.parts[part].joint.position_start()
    return [
        RigidTransform(Quaternion(row[:4] / np.linalg.norm(row[:4])), row[4:])
        for row in q[:, start : start + 7]
    ]


def logged_speed(cell: Cell, part: str, v: np.ndarray) -> np.ndarray:
    """Return the speed (n,) of a part's origin for rows (n, nv) of the plant's velocities [m/s]."""
    start = cell.parts[part].joint.velocity_start()
    return np.linalg.norm(v[:, start + 3 : start + 6], axis=1)
