"""The force of an insertion over its depth."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.insert_shaft.measures import fit_of, insertion_curve
from planning.operations.insert_shaft.phases import SOFT
from planning.operations.operation import Arrays, StepRecord
from planning.operations.plot import Plot


def plots(cell: Cell, record: StepRecord, log: Arrays) -> list[Plot]:
    """Return the force along and across the axis, with the force at which the arm yields."""
    if not record.of(fit_of(record).hole, *SOFT):
        return []
    depth, force = insertion_curve(cell, record, log)
    curves = {
        "axial": (1e3 * depth, np.abs(force[:, 2])),
        "lateral": (1e3 * depth, np.hypot(force[:, 0], force[:, 1])),
    }
    level = "limit", cell.config.insertion.force_limit
    return [Plot(record.step.name, "depth [mm]", "force [N]", curves, level)]
