"""How a part lies on another one, and what it took."""

from __future__ import annotations

from cell.builder import Cell
from planning.operations.mating_measures import measure_mating, off_place
from planning.operations.operation import Arrays, Measured, StepRecord
from planning.operations.rest.phases import mating_of


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return how a part lies, what it took, and what it did to the part on the fixture."""
    mating = mating_of(cell.product, record.step)
    measured = measure_mating(cell, record, mating)
    if "gap_m" in measured and record.end is not None:
        measured |= off_place(cell.product, mating, record.end)
    return measured
