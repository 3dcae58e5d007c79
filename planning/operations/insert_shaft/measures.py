"""How a part is seated on a shaft, or in a hole, and what it took."""

from __future__ import annotations

from cell.builder import Cell
from planning.operations.insert_shaft.phases import mating_of
from planning.operations.mating_measures import measure_mating
from planning.operations.operation import Arrays, Measured, StepRecord


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return how a part is seated, what it took, and what it did to the part on the fixture."""
    return measure_mating(cell, record, mating_of(cell.product, record.step))
