"""How hard a push was, and how far it moved the jig."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.operation import Arrays, Measured, StepRecord
from planning.operations.push.phases import PushPhase


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return the largest force of the hand and the way of the jig."""
    measured: Measured = {}
    for push in record.of("", PushPhase.PUSH):
        way = push.end.X_WJ.translation() - push.start.X_WJ.translation()
        measured["hand_force_peak_N"] = push.peak_force[cell.holder.name]
        measured["displacement_m"] = float(np.hypot(way[0], way[1]))
    return measured
