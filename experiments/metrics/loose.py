"""How bolts lie loose in the holes of what they will clamp, and how that is set aside with them."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from cell.products.product import Product
from experiments.metrics.common import Measured, angle_between, base_moved
from experiments.metrics.record import Arrays, OperationRecord
from experiments.metrics.snapshot import Snapshot


def measure_loose_bolts(cell: Cell, record: OperationRecord, log: Arrays) -> Measured:
    """Return how each bolt lies in its hole."""
    assert record.end is not None
    measured: Measured = {}
    for bolt in record.operation.parts:
        if f"{bolt}: release" in record.phases:
            measured |= _of(bolt, in_hole(cell.product, bolt, record.end))
    return measured | base_moved(record)


def measure_set_aside(cell: Cell, record: OperationRecord, log: Arrays) -> Measured:
    """Return where a part came to stand beside the jig, and how its riders lie on it."""
    assert record.end is not None
    (part,) = record.operation.parts
    if f"{part}: settle" not in record.phases:
        return {}
    measured: Measured = {
        "speed_at_rest_m_per_s": float(np.linalg.norm(record.end.V_WP[part][3:])),
        "lowered_force_peak_N": record.phases[f"{part}: set down"].peak_force["left"],
    }
    if record.origin is not None:
        X_WP = record.end.X_WP[part]
        offset = X_WP.translation() - record.origin.translation()
        measured["return_error_m"] = float(np.linalg.norm(offset))
        measured["return_angle_rad"] = angle_between(record.origin, X_WP)
    for bolt in record.operation.riders:
        if bolt in cell.product.fasteners:
            measured |= _of(bolt, in_hole(cell.product, bolt, record.end))
    return measured


def in_hole(product: Product, bolt: str, snapshot: Snapshot) -> Measured:
    """Return how a bolt lies in the hole of what it clamps.

    How far its head stands off; how far its axis passes from the middle of the hole's upper end;
    how far it leans.
    """
    clamps = product.fasteners[bolt].clamps
    X_PSeat = product.parts[clamps].X_AP.InvertAndCompose(product.parts[bolt].X_AP)
    X_SeatF = (snapshot.X_WP[clamps] @ X_PSeat).InvertAndCompose(snapshot.X_WP[bolt])
    p_SeatF, axis = X_SeatF.translation(), X_SeatF.rotation().matrix()[:, 2]
    passes = p_SeatF - axis * (p_SeatF[2] / axis[2])
    return {
        "proud_m": float(p_SeatF[2]),
        "off_hole_m": float(np.hypot(passes[0], passes[1])),
        "lean_rad": float(np.arccos(np.clip(axis[2], -1.0, 1.0))),
    }


def _of(part: str, measured: Measured) -> Measured:
    return {f"{part}/{name}": value for name, value in measured.items()}
