"""The force of a press fit over its depth, beside Lame's."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.mating_measures import insertion_curve
from planning.operations.operation import Arrays, StepRecord
from planning.operations.plot import Plot
from planning.operations.press.phases import mating_of, press_of
from planning.operations.soft_hand import MatePhase

# What a reader asks about the curve.
SEATED = (
    "force on the part over the depth of the shaft in the hole. It rises with the engaged depth, "
    "as the joint's force says; the steep end is the seat, at which the hand stops when it feels "
    "the force of the level. Before zero the tip is above the mouth; the spike there: the fit "
    "catches, and stands for a step"
)


def plots(cell: Cell, record: StepRecord, log: Arrays) -> list[Plot]:
    """Return the force along and across the axis, and that of the joint."""
    press, mating = press_of(record.step), mating_of(cell.product, record.step)
    if not record.of(mating.part, MatePhase.PRESS):
        return []
    depth, force = insertion_curve(cell, record, log, mating)
    curves = {
        "axial": (1e3 * depth, force[:, 2]),
        "lateral": (1e3 * depth, np.hypot(force[:, 0], force[:, 1])),
        "of the joint": (1e3 * np.array([0.0, press.depth]), np.array([0.0, press.force])),
    }
    level = "seat felt", press.force + cell.config.insertion.force_limit
    caption = f"{record.step.name}: {SEATED}"
    return [Plot(caption, "depth [mm]", "force [N]", curves, level)]
