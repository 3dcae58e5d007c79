"""What it took to press a part in, and how it is seated."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.mating_measures import insertion_curve, measure_mating
from planning.operations.operation import Arrays, Measured, StepRecord
from planning.operations.press.phases import mating_of, press_of
from planning.operations.soft_hand import MatePhase

LANDED = 3e-4  # From here on the hand decelerates on the seat: that is not the fit [m] [A].
LED_IN = 0.2  # Share of the depth in which edges lead the shaft in [A].


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return how a part is seated, what it took, and what it did to the part on the fixture.

    ``press_force_N`` is the force at the seat that follows from the whole curve; its error is
    relative to that of the product.
    """
    press, mating = press_of(record.step), mating_of(cell.product, record.step)
    measured = measure_mating(cell, record, mating)
    if "gap_m" in measured:
        measured["depth_m"] = press.depth - measured["gap_m"]
    if record.of(mating.part, MatePhase.PRESS):
        depth, force = press_curve(cell, record, log)
        fit = (depth > LED_IN * press.depth) & (depth < press.depth - LANDED)
        if fit.any():
            # The least squares of F = F_seat d / d_seat.
            share, felt = depth[fit] / press.depth, force[fit]
            measured["press_force_N"] = float(share @ felt / (share @ share))
            measured["press_force_deviation"] = measured["press_force_N"] / press.force - 1.0
    return measured


def press_curve(cell: Cell, record: StepRecord, log: Arrays) -> tuple[np.ndarray, np.ndarray]:
    """Return depth (n,) of the shaft in the hole [m], and the force (n,) down at the wrist [N]."""
    mating = mating_of(cell.product, record.step)
    depth, force = insertion_curve(cell, record, log, mating)
    return depth, force[:, 2]
