"""How a part lies on another one, and what it took."""

from __future__ import annotations

from cell.builder import Cell
from planning.operations.mating_measures import measure_mating
from planning.operations.operation import Arrays, Measured, StepRecord
from planning.operations.rest.phases import mating_of


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return how a part lies, what it took, and what it did to the part on the fixture."""
    return measure_mating(cell, record, mating_of(cell.product, record.step))
