"""Torque over angle of a tightening."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.log_rows import rows_of
from planning.operations.operation import Arrays, StepRecord
from planning.operations.plot import Plot
from planning.operations.tighten_bolts.measures import thread_curve
from planning.operations.tighten_bolts.phases import DRIVEN, DrivePhase

# What a reader asks about the curves.
SPIKES = (
    "Torque of the spindle's motor, which moves masses, too. The spike at zero turns: as the "
    "thread catches, the spindle speeds up to run-down speed with the bolt on it. The spike below "
    "zero: it brakes to seating speed shortly before the head seats. The bolt clamps nothing then"
)
SEATING = "The head seats where the torque begins to rise; from there on it clamps"
LAST = np.pi / 4  # The tightening takes place within this angle before the trip [rad].


def plots(cell: Cell, record: StepRecord, log: Arrays) -> list[Plot]:
    """Return torque over angle from the catch of the thread, and the end of it, from the trip."""
    whole: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    end: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for bolt in record.step.parts:
        phases = record.of(bolt, *DRIVEN)
        if record.of(bolt, DrivePhase.TIGHTEN):
            rows = rows_of(log, phases)
            angle, _, clamp = thread_curve(cell, bolt, rows)
            torque = rows[f"{cell.driver.tool.name}_torque"][-len(clamp) :]
            last = angle > angle[-1] - LAST
            whole[bolt] = (angle - angle[0]) / (2 * np.pi), torque
            end[bolt] = (angle - angle[-1])[last] / (2 * np.pi), torque[last]
    if not whole:
        return []
    level = "clutch set to", cell.product.screws[record.step.parts[0]].torque
    labels = "angle [turns]", "torque [N m]"
    return [
        Plot(f"Tightening, from the thread's catch. {SPIKES}", *labels, whole, level),
        Plot(f"Tightening, up to the clutch's trip. {SEATING}", *labels, end, level),
    ]
