"""What was recorded of a run, phase by phase, for the metrics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform

from cell.builder import Cell
from experiments.metrics.snapshot import Snapshot
from planning.operations.sequence import Operation

Arrays = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class PhaseRecord:
    """One phase that came to its end.

    Attributes:
        start, end: The truth before its first and after its last step.
        peak_force: Largest force at each wrist, less the reading at the start [N].
        awake: Names of the parts that were: nothing acts on a part that sleeps.
    """

    start: Snapshot
    end: Snapshot
    peak_force: Mapping[str, float]
    awake: frozenset[str] = frozenset()


@dataclass
class OperationRecord:
    """One operation, up to where it ended, well or not.

    Attributes:
        operation: Which one.
        start, end: The truth around it.
        base: Name of the part that the jig holds; None before one is placed.
        placed: The truth when it had been placed, or when the run began with it on the jig.
        origin: X_WP from which the part that is moved was once taken to the jig, if it was.
        phases: By name; a name occurs once in an operation.
    """

    operation: Operation
    start: Snapshot
    base: str | None = None
    placed: Snapshot | None = None
    origin: RigidTransform | None = None
    phases: dict[str, PhaseRecord] = field(default_factory=dict)
    end: Snapshot | None = None

    def named(self, part: str, *names: str) -> list[PhaseRecord]:
        """Return those of the phases "<part>: <name>" that ran, in the order of the names."""
        keys = [f"{part}: {name}" for name in names]
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


def rows_of(log: Arrays, phases: list[PhaseRecord]) -> dict[str, np.ndarray]:
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
    """Return the speed (n,) of a part's origin for rows (n, nv) of the plant's velocities."""
    start = cell.parts[part].joint.velocity_start()
    return np.linalg.norm(v[:, start + 3 : start + 6], axis=1)
