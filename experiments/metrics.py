"""What an assembly is judged by, measured from true states and the log; nothing is assumed.

Every name carries its SI unit. A quantity that could not be measured, because the run stopped
before, is left out.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.math import RigidTransform

from cell.builder import Cell
from cell.product import Fastener, Fit, Product
from cell.thread import Misfit
from experiments.record import (
    Arrays,
    OperationRecord,
    PhaseRecord,
    logged_poses,
    logged_speed,
    rows_between,
    rows_of,
)
from experiments.snapshot import Snapshot
from planning.placement import YAWS, upright

Measured = dict[str, float]
# A bolt is snug when its thread carries this share of the clamp force that T = K d F gives.
SNUG = 0.1


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


def force_plate_peaks(wrench: np.ndarray, rest: np.ndarray) -> Measured:
    """Return the largest force and torque under the jig.

    Args:
        wrench: (n, 6) torque [N m] and force [N] over an operation.
        rest: (6,) reading of the empty jig, taken off.
    """
    if not len(wrench):
        return {}
    peak = np.abs(wrench - rest).max(axis=0)
    return {
        "force_plate_peak_normal_N": float(peak[5]),
        "force_plate_peak_shear_N": float(np.hypot(peak[3], peak[4])),
        "force_plate_peak_torque_z_N_m": float(peak[2]),
    }


def angle_between(X_WA: RigidTransform, X_WB: RigidTransform) -> float:
    """Return the angle of the rotation from A to B [rad]."""
    return float(abs((X_WA.rotation().inverse() @ X_WB.rotation()).ToAngleAxis().angle()))


def moved(part: str, before: Snapshot, after: Snapshot) -> tuple[float, float]:
    """Return how far a part moved relative to the jig: distance [m] and angle [rad]."""
    X_JP0, X_JP1 = before.X_JP(part), after.X_JP(part)
    distance = np.linalg.norm(X_JP1.translation() - X_JP0.translation())
    return float(distance), angle_between(X_JP0, X_JP1)


# Placing.


def measure_place(cell: Cell, record: OperationRecord, log: Arrays) -> Measured:
    """Return accuracy, stability and forces of a placement."""
    (part,) = record.operation.parts
    measured: Measured = {}
    if press := record.named(part, "press"):
        measured["press_force_peak_N"] = press[0].peak_force["left"]
    for name, phases in (("jam", ("jam",)), ("release", ("release", "clear"))):
        if found := record.named(part, *phases):
            measured |= _kick(cell, part, name, found, rows_of(log, found))
    if press and (settle := record.named(part, "settle")):
        planned = planned_pose(cell, part, press[0].start.X_WP[part])
        measured |= placement_errors(planned, settle[0].end.X_WP[part])
        measured["depth_m"] = _depth(cell, part, settle[0].end)
        measured["speed_after_1_s_m_per_s"] = float(np.linalg.norm(settle[0].end.V_WP[part][3:]))
    return measured


def planned_pose(cell: Cell, part: str, X_WP_hover: RigidTransform) -> RigidTransform:
    """Return where the plan puts a part: its centre of mass over the jig's centre, upright.

    Of the planner's yaws it is the one nearest to the part's over the bag; the height is left to
    the pressing.
    """
    product = cell.product
    X_AP = product.parts[part].X_AP
    turns = [upright(product.up, yaw) @ X_AP.rotation() for yaw in YAWS]
    errors = [angle_between(RigidTransform(R, np.zeros(3)), X_WP_hover) for R in turns]
    R_WP = turns[int(np.argmin(errors))]
    centre = R_WP @ product.parts[part].mesh.center_mass
    p_WP = cell.X_WJ.translation() - [centre[0], centre[1], 0.0]
    return RigidTransform(R_WP, p_WP)


def placement_errors(planned: RigidTransform, placed: RigidTransform) -> Measured:
    """Return the horizontal distance, the angle and the tilt between plan and outcome."""
    X_PlanP = planned.InvertAndCompose(placed)
    offset = placed.translation() - planned.translation()
    # The vertical of W, seen from both: their angle is the tilt, whatever the yaw.
    tilt = (planned.rotation().inverse().matrix()[:, 2]) @ (placed.rotation().matrix().T[:, 2])
    return {
        "position_error_m": float(np.hypot(offset[0], offset[1])),
        "angle_error_rad": float(abs(X_PlanP.rotation().ToAngleAxis().angle())),
        "upright_tilt_rad": float(np.arccos(np.clip(tilt, -1.0, 1.0))),
    }


def _kick(cell: Cell, part: str, name: str, phases: list[PhaseRecord], rows: Arrays) -> Measured:
    """Return how far and how fast a part was thrown in some phases."""
    X_JP0 = phases[0].start.X_JP(part)
    X_WJ = phases[0].start.X_WJ
    poses = [X_WJ.InvertAndCompose(X_WP) for X_WP in logged_poses(cell, part, rows["q"])]
    away = [np.linalg.norm(X_JP.translation() - X_JP0.translation()) for X_JP in poses]
    return {
        f"{name}_kick_m": float(max(away)),
        f"{name}_kick_m_per_s": float(logged_speed(cell, part, rows["v"]).max()),
    }


def _depth(cell: Cell, part: str, snapshot: Snapshot) -> float:
    """Return how far the part's lowest point is below the apex of the inflated bag [m]."""
    X_JP = snapshot.X_JP(part)
    points = cell.product.parts[part].mesh.vertices @ X_JP.rotation().matrix().T
    lowest = float(points[:, 2].min() + X_JP.translation()[2])
    return cell.config.jig.bag.cap_height - lowest


# Inserting.


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
    return measured | _base_moved(record)


INSERTION_PHASES = ("insert", "search", "insert again")


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


def _base_moved(record: OperationRecord) -> Measured:
    """Return how far the part on the jig moved in an operation, and since it was placed."""
    if record.end is None or record.base is None or record.placed is None:
        return {}
    now = moved(record.base, record.start, record.end)
    total = moved(record.base, record.placed, record.end)
    return {
        "base_moved_m": now[0],
        "base_moved_rad": now[1],
        "base_moved_since_placed_m": total[0],
        "base_moved_since_placed_rad": total[1],
    }


# Bolts.


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
    return measured | _base_moved(record)


def standing(fastener: Fastener, X_HF: RigidTransform) -> Measured:
    """Return the errors of a bolt against standing upright on the mouth of its thread."""
    misfit = Misfit.between(RigidTransform([0.0, 0.0, -fastener.thread_depth]) @ X_HF)
    return {
        "standing_axial_m": misfit.axial,
        "standing_lateral_m": misfit.lateral,
        "standing_tilt_rad": misfit.tilt,
    }


# Tightening.


def measure_tighten(cell: Cell, record: OperationRecord, log: Arrays) -> Measured:
    """Return torque, angle, advance and clamp force of each bolt, and who held against it."""
    assert record.end is not None
    measured: Measured = {}
    for bolt in record.operation.parts:
        if f"{bolt}: tighten" not in record.phases:
            continue
        fastener = cell.product.fasteners[bolt]
        tighten = record.phases[f"{bolt}: tighten"]
        at_trip = trip(fastener, tighten.end, record.end)
        at_trip |= torque_shares(fastener, tighten)
        driven = rows_of(log, record.named(bolt, "run down", "tighten"))
        curve = thread_curve(cell, bolt, driven)
        at_trip |= advance(fastener, *curve)
        measured |= {f"{bolt}/{name}": value for name, value in at_trip.items()}
    return measured | _base_moved(record)


def clamp_target(fastener: Fastener) -> float:
    """Return F = T / (K d) at the tightening torque [N]."""
    return fastener.torque / (fastener.nut_factor * fastener.diameter)


def trip(fastener: Fastener, at_trip: Snapshot, at_end: Snapshot) -> Measured:
    """Return torque and clamp force of a bolt when the clutch trips, and what remains."""
    bolt, target = fastener.part, clamp_target(fastener)
    return {
        "torque_at_trip_N_m": at_trip.spindle_torque,
        "torque_deviation": at_trip.spindle_torque / fastener.torque - 1.0,
        "turns": at_trip.turns[bolt],
        "clamp_at_trip_N": at_trip.clamp[bolt],
        "clamp_at_end_N": at_end.clamp[bolt],
        "clamp_target_N": target,
        "clamp_deviation": at_trip.clamp[bolt] / target - 1.0,
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


Measure = Callable[[Cell, OperationRecord, Arrays], Measured]
_MEASURES: dict[str, Measure] = {
    "pick_place": measure_place,
    "insert_shaft": measure_insert,
    "place_bolts": measure_bolts,
    "tighten_bolts": measure_tighten,
}
