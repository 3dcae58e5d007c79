"""How placed bolts stand on their threads, or lie loose in their holes."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.bolts import in_hole, standing
from planning.operations.grasping import HandPhase
from planning.operations.measures import base_moved, named_of
from planning.operations.operation import Arrays, Measured, StepRecord
from planning.operations.place_bolts.phases import BoltPhase


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return how each bolt stands on the mouth of its thread."""
    assert record.end is not None
    measured: Measured = {}
    for bolt in record.step.parts:
        if record.of(bolt, HandPhase.RELEASE):
            screw = cell.product.screws[bolt]
            of_bolt = standing(screw, record.end.X_HF[bolt])
            near = [phase.end for phase in record.of(bolt, BoltPhase.LOWER, HandPhase.RELEASE)]
            clearance = min(snapshot.hand_clearance.get(screw.into, np.inf) for snapshot in near)
            if np.isfinite(clearance):
                of_bolt["hand_clearance_m"] = clearance
            measured |= named_of(bolt, of_bolt)
    return measured | base_moved(record)


def measure_loose(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return how each bolt lies in its hole."""
    assert record.end is not None
    measured: Measured = {}
    for bolt in record.step.parts:
        if record.of(bolt, HandPhase.RELEASE):
            measured |= named_of(bolt, in_hole(cell.product, bolt, record.end))
    return measured | base_moved(record)
