"""How a part is seated on a shaft, and what it took."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.builder import Cell
from cell.products.joints import Fit
from cell.products.product import Product
from planning.operations.bolts import standing
from planning.operations.grasping import HandPhase
from planning.operations.insert_shaft.phases import SOFT, InsertPhase
from planning.operations.log_rows import logged_poses, rows_of
from planning.operations.measures import base_moved, named_of
from planning.operations.operation import Arrays, Measured, StepRecord
from planning.operations.snapshot import Snapshot


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return how a part is seated, what it took, and what it did to the part on the fixture."""
    fit = fit_of(record)
    measured: Measured = {}
    soft = record.of(fit.hole, *SOFT)
    if soft:
        forces = [phase.peak_force[cell.holder.name] for phase in soft]
        measured["insertion_force_peak_N"] = max(forces)
        measured["searched"] = float(bool(record.of(fit.hole, InsertPhase.SEARCH)))
    if soft and record.of(fit.hole, HandPhase.RELEASE):
        assert record.end is not None
        gap, tilt = seat_errors(cell.product, fit, record.end)
        measured |= {"gap_m": gap, "tilt_rad": tilt}
        measured |= riders_standing(cell.product, record.step.riders, record.end)
    return measured | base_moved(record)


def fit_of(record: StepRecord) -> Fit:
    """Return the fit that a recorded step makes."""
    assert isinstance(record.step.joint, Fit)
    return record.step.joint


def riders_standing(product: Product, riders: tuple[str, ...], snapshot: Snapshot) -> Measured:
    """Return how the bolts that rode in stand on the mouths of their threads, if those are there.

    Judged like bolts that the hand has set.
    """
    measured: Measured = {}
    for bolt in riders:
        if bolt in product.screws:
            measured |= named_of(bolt, standing(product.screws[bolt], snapshot.X_HF[bolt]))
    return measured


def seat_errors(product: Product, fit: Fit, snapshot: Snapshot) -> tuple[float, float]:
    """Return gap [m] at the hole's mouth and tilt [rad] of a part against where it is seated."""
    X_GoalP = _X_GoalP(product, fit, snapshot.X_WP[fit.shaft], snapshot.X_WP[fit.hole])
    p_PF = product.parts[fit.hole].X_AP.inverse() @ fit.p_AoF
    axis = product.parts[fit.hole].X_AP.rotation().inverse().matrix()[:, 2]
    gap = float(axis @ (X_GoalP @ p_PF - p_PF))
    cosine = float(axis @ (X_GoalP.rotation() @ axis))
    return gap, float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def insertion_curve(cell: Cell, record: StepRecord, log: Arrays) -> tuple[np.ndarray, np.ndarray]:
    """Return depth (n,) [m] of a shaft in its hole and force (n, 3) on the wrist in W [N]."""
    fit = fit_of(record)
    rows = rows_of(log, record.of(fit.hole, *SOFT))
    shafts, holes = (logged_poses(cell, name, rows["q"]) for name in (fit.shaft, fit.hole))
    p_PF = cell.product.parts[fit.hole].X_AP.inverse() @ fit.p_AoF
    axis = cell.product.parts[fit.hole].X_AP.rotation().inverse().matrix()[:, 2]
    gaps = [
        axis @ (_X_GoalP(cell.product, fit, *pair) @ p_PF - p_PF)
        for pair in zip(shafts, holes, strict=True)
    ]
    return fit.depth - np.array(gaps), rows[f"{cell.holder.name}_wrench"][:, 3:]


def _X_GoalP(
    product: Product, fit: Fit, X_WShaft: RigidTransform, X_WHole: RigidTransform
) -> RigidTransform:
    """Return the pose of a part with a hole in the frame where it is seated."""
    X_ShaftHole = product.parts[fit.shaft].X_AP.InvertAndCompose(product.parts[fit.hole].X_AP)
    return (X_WShaft @ X_ShaftHole).InvertAndCompose(X_WHole)
