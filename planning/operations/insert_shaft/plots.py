"""The force of an insertion over its depth."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.insert_shaft.phases import mating_of
from planning.operations.mating import SOFT
from planning.operations.mating_measures import insertion_curve
from planning.operations.operation import Arrays, StepRecord
from planning.operations.plot import Plot


def plots(cell: Cell, record: StepRecord, log: Arrays) -> list[Plot]:
    """Return the force along and across the axis, with the force at which the arm yields."""
    mating = mating_of(cell.product, record.step)
    if not record.of(mating.part, *SOFT):
        return []
    depth, force = insertion_curve(cell, record, log, mating)
    curves = {
        "axial": (1e3 * depth, np.abs(force[:, 2])),
        "lateral": (1e3 * depth, np.hypot(force[:, 0], force[:, 1])),
    }
    level = "limit", cell.config.insertion.force_limit
    return [Plot(record.step.name, "depth [mm]", "force [N]", curves, level)]
