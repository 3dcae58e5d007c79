"""How bolts are tightened, and who holds against it."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from cell.products.joints import Screw
from cell.workpieces.thread import Misfit
from planning.operations.log_rows import logged_poses, rows_of
from planning.operations.measures import base_moved, named_of
from planning.operations.operation import Arrays, Measured, PhaseRecord, StepRecord
from planning.operations.snapshot import Snapshot
from planning.operations.tighten_bolts.phases import DRIVEN, DrivePhase
from planning.operations.tighten_bolts.search import SearchPhase

# A bolt is snug when its thread carries this share of the clamp force that T = K d F gives.
SNUG = 0.1


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return torque, angle, advance and clamp force of each bolt, and who held against it."""
    measured: Measured = {}
    for bolt in record.step.parts:
        if record.of(bolt, DrivePhase.BIT_IN):
            tries = sum(phase.times for phase in record.of(bolt, SearchPhase.DOWN))
            measured |= named_of(bolt, {"socket_searches": float(tries)})
        for tighten in record.of(bolt, DrivePhase.TIGHTEN):
            screw = cell.product.screws[bolt]
            of_bolt = trip(screw, tighten.end, record.last_awake(bolt) or tighten.end)
            of_bolt |= torque_shares(cell.holder.name, screw, tighten)
            curve = thread_curve(cell, bolt, rows_of(log, record.of(bolt, *DRIVEN)))
            of_bolt |= advance(screw, *curve)
            measured |= named_of(bolt, of_bolt)
    return measured | base_moved(record)


def clamp_target(screw: Screw) -> float:
    """Return F = T / (K d) at the tightening torque [N]."""
    return screw.torque / (screw.nut_factor * screw.diameter)


def trip(screw: Screw, at_trip: Snapshot, at_end: Snapshot) -> Measured:
    """Return torque and clamp force of a bolt when the clutch trips, and what remains of it.

    Args:
        screw: Which bolt.
        at_trip: The truth when the clutch trips.
        at_end: The truth when all bolts are tight, while the bolt is still awake.
    """
    bolt, target = screw.part, clamp_target(screw)
    return {
        "torque_at_trip_N_m": at_trip.spindle_torque,
        "torque_deviation": at_trip.spindle_torque / screw.torque - 1.0,
        "turns": at_trip.turns[bolt],
        "clamp_at_trip_N": at_trip.clamp[bolt],
        "clamp_at_end_N": at_end.clamp[bolt],
        "clamp_target_N": target,
        "clamp_deviation": at_trip.clamp[bolt] / target - 1.0,
        "clamp_deviation_at_end": at_end.clamp[bolt] / target - 1.0,
    }


def torque_shares(holder: str, screw: Screw, tighten: PhaseRecord) -> Measured:
    """Return which share of the driver's torque the holding arm (by its name) and the jig take.

    Both wrenches are taken about the bolt's axis, less what was there before. The driver turns the
    work clockwise seen from above, so a share is positive where a sensor feels a turn about -z.
    """
    p_WB = tighten.end.X_WP[screw.part].translation()
    shares = {}
    for name, sensor in ((f"{holder}_arm", holder), ("jig", "force_plate")):
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
    screw, parts = cell.product.screws[bolt], cell.product.parts
    X_IH = parts[screw.into].X_AP.InvertAndCompose(parts[bolt].X_AP)
    into, bolts = (logged_poses(cell, n, rows["q"][caught]) for n in (screw.into, bolt))
    X_HF = [(X_WI @ X_IH).InvertAndCompose(X_WF) for X_WI, X_WF in zip(into, bolts, strict=True)]
    misfits = [Misfit.between(X) for X in X_HF]
    angle = -np.unwrap([misfit.angle for misfit in misfits])
    height = np.array([misfit.axial for misfit in misfits])
    return angle, height, rows["clamp_force"][caught, column]


def advance(screw: Screw, angle: np.ndarray, height: np.ndarray, clamp: np.ndarray) -> Measured:
    """Return the advance per turn while the bolt runs free, and the angle from snug to trip."""
    if len(angle) < 3:
        return {}
    snug = int(np.argmax(clamp >= SNUG * clamp_target(screw)))
    measured = {"snug_to_trip_rad": float(angle[-1] - angle[snug])}
    if snug >= 2:
        slope = np.polyfit(angle[:snug], height[:snug], 1)[0]
        per_turn = float(-slope * 2 * np.pi)
        measured["advance_per_turn_m"] = per_turn
        measured["advance_deviation"] = per_turn / screw.pitch - 1.0
    return measured
