"""The force of an insertion over its depth."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.insert_shaft.phases import mating_of
from planning.operations.mating_measures import insertion_curve
from planning.operations.operation import Arrays, StepRecord
from planning.operations.plot import Plot
from planning.operations.soft_hand import SOFT

# What a reader asks about the curve.
SEATED = (
    "force on the part over its depth on the shaft. It rises where metal meets metal: the arm then "
    "presses with its set force until nothing moves, and overshoots it a little as it lands"
)


def plots(cell: Cell, record: StepRecord, log: Arrays) -> list[Plot]:
    """Return the force along and across the axis, and the force that the arm is set to."""
    mating = mating_of(cell.product, record.step)
    if not record.of(mating.part, *SOFT):
        return []
    depth, force = insertion_curve(cell, record, log, mating)
    curves = {
        "axial": (1e3 * depth, np.abs(force[:, 2])),
        "lateral": (1e3 * depth, np.hypot(force[:, 0], force[:, 1])),
    }
    level = "set point of the press", cell.config.insertion.force_limit
    caption = f"{record.step.name}: {SEATED}"
    return [Plot(caption, "depth [mm]", "force [N]", curves, level)]
