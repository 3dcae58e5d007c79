"""Torque over angle of a tightening."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.log_rows import rows_of
from planning.operations.operation import Arrays, StepRecord
from planning.operations.plot import Plot
from planning.operations.tighten_bolts.measures import thread_curve
from planning.operations.tighten_bolts.phases import DRIVEN

LAST = np.pi / 4  # The tightening takes place within this angle before the trip [rad].


def plots(cell: Cell, record: StepRecord, log: Arrays) -> list[Plot]:
    """Return torque over angle from the catch of the thread, and the end of it, from the trip."""
    whole: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    end: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for bolt in record.step.parts:
        phases = record.of(bolt, *DRIVEN)
        if len(phases) == len(DRIVEN):
            rows = rows_of(log, phases)
            angle, _, clamp = thread_curve(cell, bolt, rows)
            torque = rows[f"{cell.driver.tool.name}_torque"][-len(clamp) :]
            last = angle > angle[-1] - LAST
            whole[bolt] = (angle - angle[0]) / (2 * np.pi), torque
            end[bolt] = (angle - angle[-1])[last] / (2 * np.pi), torque[last]
    if not whole:
        return []
    level = "target", cell.product.screws[record.step.parts[0]].torque
    labels = "angle [turns]", "torque [N m]"
    return [
        Plot("Tightening, from the thread's catch", *labels, whole, level),
        Plot("Tightening, up to the clutch's trip", *labels, end, level),
    ]
