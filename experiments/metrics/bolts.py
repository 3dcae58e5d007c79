"""How bolts stand in their holes, and how they are tightened."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.builder import Cell
from cell.products.product import Fastener
from cell.workpieces.thread import Misfit
from experiments.metrics.common import Measured, base_moved
from experiments.metrics.record import Arrays, OperationRecord, PhaseRecord, logged_poses, rows_of
from experiments.metrics.snapshot import Snapshot

# A bolt is snug when its thread carries this share of the clamp force that T = K d F gives.
SNUG = 0.1


def measure_bolts(cell: Cell, record: OperationRecord, log: Arrays) -> Measured:
    """Return how each bolt stands on the mouth of its thread."""
    assert record.end is not None
    measured: Measured = {}
    for bolt in record.operation.parts:
        if f"{bolt}: release" not in record.phases:
            continue
        fastener = cell.product.fasteners[bolt]
        stands = standing(fastener, record.end.X_HF[bolt])
        measured |= {f"{bolt}/{name}": value for name, value in stands.items()}
        near = [record.phases[f"{bolt}: {name}"].end for name in ("lower", "release")]
        clearance = min(snapshot.hand_clearance[fastener.into] for snapshot in near)
        if np.isfinite(clearance):
            measured[f"{bolt}/hand_clearance_m"] = clearance
    return measured | base_moved(record)


def standing(fastener: Fastener, X_HF: RigidTransform) -> Measured:
    """Return the errors of a bolt against standing upright on the mouth of its thread."""
    misfit = Misfit.between(RigidTransform([0.0, 0.0, -fastener.thread_depth]) @ X_HF)
    return {
        "standing_axial_m": misfit.axial,
        "standing_lateral_m": misfit.lateral,
        "standing_tilt_rad": misfit.tilt,
    }


def measure_tighten(cell: Cell, record: OperationRecord, log: Arrays) -> Measured:
    """Return torque, angle, advance and clamp force of each bolt, and who held against it."""
    measured: Measured = {}
    for bolt in record.operation.parts:
        if f"{bolt}: tighten" not in record.phases:
            continue
        fastener = cell.product.fasteners[bolt]
        tighten = record.phases[f"{bolt}: tighten"]
        at_trip = trip(fastener, tighten.end, record.last_awake(bolt) or tighten.end)
        at_trip |= torque_shares(fastener, tighten)
        driven = rows_of(log, record.named(bolt, "run down", "tighten"))
        curve = thread_curve(cell, bolt, driven)
        at_trip |= advance(fastener, *curve)
        measured |= {f"{bolt}/{name}": value for name, value in at_trip.items()}
    return measured | base_moved(record)


def clamp_target(fastener: Fastener) -> float:
    """Return F = T / (K d) at the tightening torque [N]."""
    return fastener.torque / (fastener.nut_factor * fastener.diameter)


def trip(fastener: Fastener, at_trip: Snapshot, at_end: Snapshot) -> Measured:
    """Return torque and clamp force of a bolt when the clutch trips, and what remains of it.

    Args:
        fastener: Which bolt.
        at_trip: The truth when the clutch trips.
        at_end: The truth when all bolts are tight, while the bolt is still awake.
    """
    bolt, target = fastener.part, clamp_target(fastener)
    return {
        "torque_at_trip_N_m": at_trip.spindle_torque,
        "torque_deviation": at_trip.spindle_torque / fastener.torque - 1.0,
        "turns": at_trip.turns[bolt],
        "clamp_at_trip_N": at_trip.clamp[bolt],
        "clamp_at_end_N": at_end.clamp[bolt],
        "clamp_target_N": target,
        "clamp_deviation": at_trip.clamp[bolt] / target - 1.0,
        "clamp_deviation_at_end": at_end.clamp[bolt] / target - 1.0,
    }


def torque_shares(fastener: Fastener, tighten: PhaseRecord) -> Measured:
    """Return which share of the driver's torque the left arm and the jig take.

    Both wrenches are taken about the bolt's axis, less what was there before. The driver turns the
    work clockwise seen from above, so a share is positive where a sensor feels a turn about -z.
    """
    p_WB = tighten.end.X_WP[fastener.part].translation()
    shares = {}
    for name, sensor in (("left_arm", "left"), ("jig", "force_plate")):
        before, after = (s.wrenches[sensor].about(p_WB) for s in (tighten.start, tighten.end))
        torque = after[2] - before[2]
        shares[f"{name}_torque_share"] = float(-torque / tighten.end.spindle_torque)
    return shares


def thread_curve(cell: Cell, bolt: str, rows: Arrays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return angle (n,) [rad], height (n,) [m] and clamp force (n,) [N] of a bolt since it caught.

    Angle and height are those of the bolt itself against the part that carries the thread, not
    those of the thread model. Positive angles tighten.
    """
    column = list(cell.threads).index(bolt)
    caught = np.abs(rows["thread_turns"][:, column]) > 0.0
    fastener, parts = cell.product.fasteners[bolt], cell.product.parts
    X_IH = parts[fastener.into].X_AP.InvertAndCompose(parts[bolt].X_AP)
    into, bolts = (logged_poses(cell, n, rows["q"][caught]) for n in (fastener.into, bolt))
    X_HF = [(X_WI @ X_IH).InvertAndCompose(X_WF) for X_WI, X_WF in zip(into, bolts, strict=True)]
    misfits = [Misfit.between(X) for X in X_HF]
    angle = -np.unwrap([misfit.angle for misfit in misfits])
    height = np.array([misfit.axial for misfit in misfits])
    return angle, height, rows["clamp_force"][caught, column]


def advance(
    fastener: Fastener, angle: np.ndarray, height: np.ndarray, clamp: np.ndarray
) -> Measured:
    """Return the advance per turn while the bolt runs free, and the angle from snug to trip."""
    if len(angle) < 3:
        return {}
    snug = int(np.argmax(clamp >= SNUG * clamp_target(fastener)))
    measured = {"snug_to_trip_rad": float(angle[-1] - angle[snug])}
    if snug >= 2:
        slope = np.polyfit(angle[:snug], height[:snug], 1)[0]
        per_turn = float(-slope * 2 * np.pi)
        measured["advance_per_turn_m"] = per_turn
        measured["advance_deviation"] = per_turn / fastener.pitch - 1.0
    return measured
