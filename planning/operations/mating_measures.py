"""How a part is seated that was brought from above, and what it took."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.builder import Cell
from cell.products.product import Product
from planning.operations.bolts import play_share, standing
from planning.operations.grasping import HandPhase
from planning.operations.log_rows import logged_poses, rows_of
from planning.operations.measures import base_moved, named_of
from planning.operations.operation import Arrays, Measured, StepRecord
from planning.operations.snapshot import Snapshot
from planning.operations.soft_hand import SOFT, MatePhase, Mating


def measure_mating(cell: Cell, record: StepRecord, mating: Mating) -> Measured:
    """Return how a part is seated, what it took, and what it did to the part on the fixture."""
    measured: Measured = {}
    soft = record.of(mating.part, *SOFT)
    if soft:
        forces = [phase.peak_force[cell.holder.name] for phase in soft]
        measured["insertion_force_peak_N"] = max(forces)
    if soft and mating.depth > 0.0:
        measured["searched"] = float(bool(record.of(mating.part, MatePhase.SEARCH)))
    if soft and record.of(mating.part, HandPhase.RELEASE):
        assert record.end is not None
        gap, tilt, _ = seat_errors(cell.product, mating, record.end)
        measured |= {"gap_m": gap, "tilt_rad": tilt}
        measured |= riders_standing(cell.product, record.step.riders, record.end)
    return measured | base_moved(record)


def off_place(product: Product, mating: Mating, snapshot: Snapshot) -> Measured:
    """Return how far a seated part is aside, and how much of its screws' play that takes up."""
    X_GoalP = _X_GoalP(product, mating, snapshot)
    return {
        "off_place_m": seat_errors(product, mating, snapshot)[2],
        "screw_play_share": play_share(product, mating.part, X_GoalP),
    }


def riders_standing(product: Product, riders: tuple[str, ...], snapshot: Snapshot) -> Measured:
    """Return how the bolts that rode in stand on the mouths of their threads, if those are there.

    Judged like bolts that the hand has set.
    """
    measured: Measured = {}
    for bolt in riders:
        if bolt in product.screws:
            measured |= named_of(bolt, standing(product.screws[bolt], snapshot.X_HF[bolt]))
    return measured


def seat_errors(product: Product, mating: Mating, snapshot: Snapshot) -> tuple[float, float, float]:
    """Return how a part is off its seat at the compliance centre.

    Returns:
        Gap along the axis [m], tilt [rad], and distance across the axis [m].
    """
    X_GoalP = _X_GoalP(product, mating, snapshot)
    p_PC, axis = _centre(product, mating)
    off = X_GoalP @ p_PC - p_PC
    gap, cosine = float(axis @ off), float(axis @ (X_GoalP.rotation() @ axis))
    aside = float(np.linalg.norm(off - gap * axis))
    return gap, float(np.arccos(np.clip(cosine, -1.0, 1.0))), aside


def insertion_curve(
    cell: Cell, record: StepRecord, log: Arrays, mating: Mating
) -> tuple[np.ndarray, np.ndarray]:
    """Return depth (n,) [m] of a shaft in its hole and force (n, 3) on the wrist in W [N]."""
    rows = rows_of(log, record.of(mating.part, *SOFT))
    poses = [logged_poses(cell, name, rows["q"]) for name in (mating.on, mating.part)]
    p_PC, axis = _centre(cell.product, mating)
    gaps = [
        axis @ (_between(cell.product, mating, *pair) @ p_PC - p_PC)
        for pair in zip(*poses, strict=True)
    ]
    return mating.depth - np.array(gaps), rows[f"{cell.holder.name}_wrench"][:, 3:]


def _centre(product: Product, mating: Mating) -> tuple[np.ndarray, np.ndarray]:
    """Return compliance centre and axis in the frame of the part in the hand."""
    X_PA = product.parts[mating.part].X_AP.inverse()
    return X_PA @ mating.p_AoC, X_PA.rotation() @ mating.axis


def _X_GoalP(product: Product, mating: Mating, snapshot: Snapshot) -> RigidTransform:
    """Return the pose of a part in the frame where it is seated."""
    return _between(product, mating, snapshot.X_WP[mating.on], snapshot.X_WP[mating.part])


def _between(
    product: Product, mating: Mating, X_WOn: RigidTransform, X_WP: RigidTransform
) -> RigidTransform:
    """Return X_GoalP for poses of the parts."""
    on, part = product.parts[mating.on], product.parts[mating.part]
    return (X_WOn @ on.X_AP.InvertAndCompose(part.X_AP)).InvertAndCompose(X_WP)
