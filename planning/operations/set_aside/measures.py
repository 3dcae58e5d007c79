"""Where a part came to stand beside the fixture, and how its riders lie on it."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.bolts import in_hole
from planning.operations.measures import angle_between, named_of
from planning.operations.operation import Arrays, Measured, StepRecord
from planning.operations.set_aside.phases import AsidePhase


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return speed, force and place of a part that was set down, and how bolts hang in it."""
    assert record.end is not None
    (part,) = record.step.parts
    if not record.of(part, AsidePhase.SETTLE):
        return {}
    (down,) = record.of(part, AsidePhase.SET_DOWN)
    measured: Measured = {
        "speed_at_rest_m_per_s": float(np.linalg.norm(record.end.V_WP[part][3:])),
        "lowered_force_peak_N": down.peak_force[cell.holder.name],
    }
    if record.origin is not None:
        X_WP = record.end.X_WP[part]
        offset = X_WP.translation() - record.origin.translation()
        measured["return_error_m"] = float(np.linalg.norm(offset))
        measured["return_angle_rad"] = angle_between(record.origin, X_WP)
    for bolt in record.step.riders:
        if bolt in cell.product.screws:
            measured |= named_of(bolt, in_hole(cell.product, bolt, record.end))
    return measured
