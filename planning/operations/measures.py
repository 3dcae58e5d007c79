"""What every step is measured for: forces under the jig, and whether the part on it moved."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.builder import Cell
from planning.operations.log_rows import rows_between
from planning.operations.operation import Arrays, Measured, StepRecord
from planning.operations.snapshot import Snapshot


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return what a step is judged by.

    Args:
        cell: The cell it ran in.
        record: Of the step.
        log: All columns so far.
    """
    assert record.end is not None
    if "time" not in log:  # Failed before the first sample.
        return {}
    rows = rows_between(log, record.start.time, record.end.time)
    measured = record.step.operation.measure(cell, record, log)
    measured |= force_plate_peaks(rows["force_plate"], log["force_plate"][0])
    return {name: value for name, value in measured.items() if np.isfinite(value)}


def named_of(part: str, measured: Measured) -> Measured:
    """Return quantities of one of several parts, with its name before theirs."""
    return {f"{part}/{name}": value for name, value in measured.items()}


def force_plate_peaks(wrench: np.ndarray, rest: np.ndarray) -> Measured:
    """Return the largest force and torque under the jig.

    Args:
        wrench: (n, 6) torque [N m] and force [N] over a step.
        rest: (6,) reading of the empty jig, taken off.
    """
    if not len(wrench):
        return {}
    peak = np.abs(wrench - rest).max(axis=0)
    return {
        "force_plate_peak_normal_N": float(peak[5]),
        "force_plate_peak_shear_N": float(np.hypot(peak[3], peak[4])),
        "force_plate_peak_torque_z_N_m": float(peak[2]),
    }


def angle_between(X_WA: RigidTransform, X_WB: RigidTransform) -> float:
    """Return the angle of the rotation from A to B [rad]."""
    return float(abs((X_WA.rotation().inverse() @ X_WB.rotation()).ToAngleAxis().angle()))


def moved(part: str, before: Snapshot, after: Snapshot) -> tuple[float, float]:
    """Return how far a part moved relative to the jig: distance [m] and angle [rad]."""
    X_JP0, X_JP1 = before.X_JP(part), after.X_JP(part)
    distance = np.linalg.norm(X_JP1.translation() - X_JP0.translation())
    return float(distance), angle_between(X_JP0, X_JP1)


def base_moved(record: StepRecord) -> Measured:
    """Return how far the part on the jig moved in a step, and since it was placed."""
    if record.end is None or record.base is None or record.placed is None:
        return {}
    now = moved(record.base, record.start, record.end)
    total = moved(record.base, record.placed, record.end)
    return {
        "base_moved_m": now[0],
        "base_moved_rad": now[1],
        "base_moved_since_placed_m": total[0],
        "base_moved_since_placed_rad": total[1],
    }
