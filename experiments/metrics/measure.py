"""The measures of each kind of operation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cell.builder import Cell
from experiments.metrics.bolts import measure_bolts, measure_tighten
from experiments.metrics.common import Measured, force_plate_peaks
from experiments.metrics.insert import measure_insert
from experiments.metrics.loose import measure_loose_bolts, measure_set_aside
from experiments.metrics.place import measure_place
from experiments.metrics.record import Arrays, OperationRecord, rows_between

Measure = Callable[[Cell, OperationRecord, Arrays], Measured]
_MEASURES: dict[str, Measure] = {
    "pick_place": measure_place,
    "set_aside": measure_set_aside,
    "insert_shaft": measure_insert,
    "place_bolts": measure_bolts,
    "place_loose_bolts": measure_loose_bolts,
    "tighten_bolts": measure_tighten,
}


def measure(cell: Cell, record: OperationRecord, log: Arrays) -> Measured:
    """Return what an operation is judged by.

    Args:
        cell: The cell it ran in.
        record: Of the operation.
        log: All columns so far.
    """
    assert record.end is not None
    if "time" not in log:  # Failed before the first sample.
        return {}
    rows = rows_between(log, record.start.time, record.end.time)
    measured = _MEASURES[record.operation.kind](cell, record, log)
    measured |= force_plate_peaks(rows["force_plate"], log["force_plate"][0])
    return {name: value for name, value in measured.items() if np.isfinite(value)}
