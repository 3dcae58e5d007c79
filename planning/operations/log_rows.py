"""Rows of the log: those of a step or of some phases, and what they say of a part."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform

from cell.builder import Cell
from planning.operations.operation import Arrays, PhaseRecord


def rows_between(log: Arrays, start: float, end: float) -> dict[str, np.ndarray]:
    """Return the log's columns with the rows in (start, end] [s] only."""
    time = log["time"]
    inside = (time > start + 1e-9) & (time <= end + 1e-9)
    return {name: a[inside] for name, a in log.items() if not name.startswith("phase_")}


def rows_of(log: Arrays, phases: Sequence[PhaseRecord]) -> dict[str, np.ndarray]:
    """Return the log's rows of these phases, in the order of time."""
    time = log["time"]
    spans = [(phase.start.time + 1e-9, phase.end.time + 1e-9) for phase in phases]
    inside = np.any([(time > start) & (time <= end) for start, end in spans], axis=0)
    return {name: a[inside] for name, a in log.items() if not name.startswith("phase_")}


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
