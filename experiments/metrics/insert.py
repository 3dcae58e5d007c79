"""How a part is seated on a shaft, and what it took."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.builder import Cell
from cell.products.product import Fit, Product
from experiments.metrics.bolts import standing
from experiments.metrics.common import Measured, base_moved
from experiments.metrics.record import Arrays, OperationRecord, logged_poses, rows_of
from experiments.metrics.snapshot import Snapshot

INSERTION_PHASES = ("insert", "search", "insert again", "press")


def measure_insert(cell: Cell, record: OperationRecord, log: Arrays) -> Measured:
    """Return how a part is seated, what it took, and what it did to the part on the jig."""
    fit = record.operation.fit
    assert fit is not None
    measured: Measured = {}
    soft = record.named(fit.hole, *INSERTION_PHASES)
    if soft:
        measured["insertion_force_peak_N"] = max(phase.peak_force["left"] for phase in soft)
        measured["searched"] = float(f"{fit.hole}: search" in record.phases)
    if soft and record.named(fit.hole, "release"):
        assert record.end is not None
        gap, tilt = seat_errors(cell.product, fit, record.end)
        measured |= {"gap_m": gap, "tilt_rad": tilt}
        measured |= riders_standing(cell.product, record.operation.riders, record.end)
    return measured | base_moved(record)


def riders_standing(product: Product, riders: tuple[str, ...], snapshot: Snapshot) -> Measured:
    """Return how the bolts that rode in stand on the mouths of their threads, if those are there.

    Judged like bolts that the hand has set.
    """
    measured: Measured = {}
    for bolt in riders:
        fastener = product.fasteners.get(bolt)
        if fastener is not None:
            stands = standing(fastener, snapshot.X_HF[bolt])
            measured |= {f"{bolt}/{name}": value for name, value in stands.items()}
    return measured


def seat_errors(product: Product, fit: Fit, snapshot: Snapshot) -> tuple[float, float]:
    """Return gap [m] at the hole's mouth and tilt [rad] of a part against where it is seated."""
    X_GoalP = _X_GoalP(product, fit, snapshot.X_WP[fit.shaft], snapshot.X_WP[fit.hole])
    p_PF = product.parts[fit.hole].X_AP.inverse() @ fit.p_AoF
    axis = product.parts[fit.hole].X_AP.rotation().inverse().matrix()[:, 2]
    gap = float(axis @ (X_GoalP @ p_PF - p_PF))
    cosine = float(axis @ (X_GoalP.rotation() @ axis))
    return gap, float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _X_GoalP(
    product: Product, fit: Fit, X_WShaft: RigidTransform, X_WHole: RigidTransform
) -> RigidTransform:
    X_ShaftHole = product.parts[fit.shaft].X_AP.InvertAndCompose(product.parts[fit.hole].X_AP)
    return (X_WShaft @ X_ShaftHole).InvertAndCompose(X_WHole)


def insertion_curve(
    cell: Cell, record: OperationRecord, log: Arrays
) -> tuple[np.ndarray, np.ndarray]:
    """Return depth (n,) [m] of a shaft in its hole and force (n, 3) on the wrist in W [N]."""
    fit = record.operation.fit
    assert fit is not None
    rows = rows_of(log, record.named(fit.hole, *INSERTION_PHASES))
    shafts, holes = (logged_poses(cell, name, rows["q"]) for name in (fit.shaft, fit.hole))
    p_PF = cell.product.parts[fit.hole].X_AP.inverse() @ fit.p_AoF
    axis = cell.product.parts[fit.hole].X_AP.rotation().inverse().matrix()[:, 2]
    gaps = [
        axis @ (_X_GoalP(cell.product, fit, *pair) @ p_PF - p_PF)
        for pair in zip(shafts, holes, strict=True)
    ]
    return fit.depth - np.array(gaps), rows["left_wrench"][:, 3:]
