"""Measurements and success criteria of a trial of the place and push experiments."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform
from scipy.ndimage import uniform_filter1d

from cell.fixtures.custom.fixture import ON_SUPPORTS
from experiments.paper.screws import seen_displacement
from experiments.paper.trial import HOVER, TrialRecord
from planning.operations.measures import angle_between
from planning.operations.operation import Measured

SUCCESS_DISTANCE = 0.063  # [m] [S] 90 % of the push.
UPRIGHT = np.deg2rad(5.0)  # "Visually upright" [S], interpreted as this tilt [A].
AT_REST = 1e-3  # [m/s] [A] a part that creeps faster is not at rest.
SMOOTHING = 0.01  # [s] Averaging time of a typical force plate amplifier [A].
# A part that its fixture is made for is seated if it stands on its supports, and this near to its
# place [m] [D]: play is 0.1 to 0.3 mm, and a driver that is off by 0.4 misses a socket [M].
SEATED = 4e-4
VISIBLE = 0.2  # A peak below this fraction of the placing peak is not visible in a plot [A].


def smoothed(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return values (n,) averaged over `SMOOTHING`."""
    period = float(np.median(np.diff(time))) if len(time) > 1 else SMOOTHING
    return uniform_filter1d(values, max(1, round(SMOOTHING / period)))


def plate_forces(trial: TrialRecord) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time [s], F_n = |f_z| and F_s = hypot(f_x, f_y) [N] without the weight of the jig."""
    time, force = trial.log["time"], trial.log["force_plate"][:, 3:]
    normal, shear = np.abs(force[:, 2]), np.hypot(force[:, 0], force[:, 1])
    return time, smoothed(normal, time), smoothed(shear, time)


def start_of(trial: TrialRecord, phase: str) -> float | None:
    """Return the start time of a phase [s]; None if it did not run."""
    starts = dict(zip(trial.log["phase_name"], trial.log["phase_start"], strict=True))
    return float(starts[phase]) if phase in starts else None


def tilt_between(X_JA: RigidTransform, X_JB: RigidTransform) -> float:
    """Return the angle between the vertical as seen in A and in B [rad]."""
    up_A, up_B = (X.rotation().matrix()[2] for X in (X_JA, X_JB))
    return float(np.arccos(np.clip(up_A @ up_B, -1.0, 1.0)))


def measure_place(trial: TrialRecord) -> Measured:
    """Return pose and speed of the released part, its error on a seat, and peak press forces."""
    measured: Measured = {}
    if trial.placed is not None:
        drop = trial.planned.translation() - trial.placed.translation()
        measured["depth_m"] = float(drop[2]) - HOVER
        measured["offset_m"] = float(np.hypot(*drop[:2]))
        measured["tilt_rad"] = tilt_between(trial.planned, trial.placed)
        measured["speed_m_per_s"] = trial.speed
        if trial.seat is not None:
            off = trial.placed.translation() - trial.seat.translation()
            measured["seat_error_m"] = float(np.linalg.norm(off))
            measured["seat_error_rad"] = angle_between(trial.seat, trial.placed)
        if trial.off_supports is not None:
            measured["off_supports_m"] = trial.off_supports
    if trial.held is not None and trial.placed is not None:
        shift = trial.placed.translation() - trial.held.translation()
        measured["release_shift_m"] = float(np.linalg.norm(shift))
    if "time" in trial.log:
        time, normal, shear = plate_forces(trial)
        until = start_of(trial, "approach") or np.inf
        measured["place_normal_peak_N"] = float(normal[time < until].max())
        measured["place_shear_peak_N"] = float(shear[time < until].max())
    return measured


def measure_push(trial: TrialRecord) -> Measured:
    """Return the displacement of the jig, the rotation of the part on it, and the peak forces."""
    begun = start_of(trial, "push") if "time" in trial.log else None
    if begun is None or trial.before is None or trial.view is None:
        return {}
    time, normal, shear = plate_forces(trial)
    after = trial.after if trial.after is not None else trial.last_jig
    late = time >= begun
    moved = after.translation() - trial.before.translation()
    seen, printed = seen_displacement(trial.view, trial.before, after)
    turn = trial.before.rotation().inverse() @ after.rotation()
    hand = np.linalg.norm(trial.log["hand_wrench"][:, 3:], axis=1)
    measured = {
        "displacement_m": float(np.hypot(*moved[:2])),
        "displacement_seen_m": seen,
        "printed_formula_m": printed,
        "jig_yaw_rad": float(abs(np.arctan2(turn.matrix()[1, 0], turn.matrix()[0, 0]))),
        "push_normal_peak_N": float(normal[late].max()),
        "push_shear_peak_N": float(shear[late].max()),
        "hand_force_peak_N": float(smoothed(hand, time)[late].max()),
        "force_peaks": float(force_peaks(time, np.hypot(normal, shear), begun)),
    }
    if trial.placed is not None and trial.moved is not None:
        measured["part_rotation_rad"] = angle_between(trial.placed, trial.moved)
        measured["part_tilt_rad"] = tilt_between(trial.placed, trial.moved)
    return measured


def force_peaks(time: np.ndarray, force: np.ndarray, begun: float) -> int:
    """Return the number of visible peaks of the plate force: of placing, and of pushing.

    Args:
        time: (n,) [s].
        force: (n,) magnitude of the force [N].
        begun: Start of the push [s]; the force just before it is that at rest.
    """
    placing, pushing = force[time < begun], force[time >= begun]
    rest = placing[-1]
    return 1 + int(pushing.max() - rest >= VISIBLE * (placing.max() - rest))


def stands(trial: TrialRecord, measured: Measured) -> bool:
    """Return whether the part is upright and at rest."""
    stood = trial.failure is None and trial.placed is not None
    return stood and measured["tilt_rad"] < UPRIGHT and measured["speed_m_per_s"] < AT_REST


def place_fault(trial: TrialRecord, measured: Measured) -> str:
    """Return why a placement is no success, in words; "" if it is one.

    The part has to be upright and at rest, and on a fixture that is made for it also seated.
    """
    if trial.failure is not None or trial.placed is None:
        return "it was not placed"
    if not stands(trial, measured):
        tilt, speed = measured["tilt_rad"], measured["speed_m_per_s"]
        return (
            f"it leans by {np.rad2deg(tilt):.1f} deg and moves at {1e3 * speed:.1f} mm/s, "
            f"{np.rad2deg(UPRIGHT):g} deg and {1e3 * AT_REST:g} mm/s at most"
        )
    raised, error = measured.get("off_supports_m", 0.0), measured.get("seat_error_m", 0.0)
    if not raised < ON_SUPPORTS:
        return (
            f"wedged: it stands {1e3 * raised:.2f} mm off a support, {1e3 * ON_SUPPORTS:g} at most"
        )
    if not error < SEATED:
        return f"it is {1e3 * error:.2f} mm from its seat, {1e3 * SEATED:g} mm at most"
    return ""


def place_succeeded(trial: TrialRecord, measured: Measured) -> bool:
    """Return whether the part is upright and at rest, and seated if its fixture has a seat."""
    return not place_fault(trial, measured)


def push_succeeded(measured: Measured) -> bool:
    """Return whether the jig moved along with the part, by the paper's limit."""
    return measured.get("displacement_m", 0.0) > SUCCESS_DISTANCE
