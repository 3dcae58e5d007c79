"""How a part lies on the jig."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.builder import Cell
from experiments.metrics.common import Measured, angle_between
from experiments.metrics.record import (
    Arrays,
    OperationRecord,
    PhaseRecord,
    logged_poses,
    logged_speed,
    rows_of,
)
from experiments.metrics.snapshot import Snapshot
from planning.operations.placement import YAWS, upright


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
    """Return how far the lowest point (a motor's terminals) is below the inflated apex [m]."""
    X_JP = snapshot.X_JP(part)
    points = cell.product.parts[part].mesh.vertices @ X_JP.rotation().matrix().T
    lowest = float(points[:, 2].min() + X_JP.translation()[2])
    return cell.config.jig.bag.cap_height - lowest
