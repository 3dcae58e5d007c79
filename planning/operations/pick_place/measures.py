"""How a part lies on the fixture."""

from __future__ import annotations

import numpy as np

from cell.builder import Cell
from planning.operations.grasping import HandPhase
from planning.operations.log_rows import logged_poses, logged_speed, rows_of
from planning.operations.operation import Arrays, Measured, PhaseRecord, StepRecord
from planning.operations.pick_place.phases import PlacePhase
from planning.operations.placement import placement_errors, planned_pose
from planning.operations.snapshot import Snapshot

# What throws a part, by the name that its kick is measured under.
KICKS = {"jam": (PlacePhase.FIX,), "release": (HandPhase.RELEASE, HandPhase.CLEAR)}


def measure(cell: Cell, record: StepRecord, log: Arrays) -> Measured:
    """Return accuracy, stability and forces of a placement."""
    (part,) = record.step.parts
    measured: Measured = {}
    if press := record.of(part, PlacePhase.PRESS):
        measured["press_force_peak_N"] = press[0].peak_force[cell.holder.name]
    for name, kinds in KICKS.items():
        if found := record.of(part, *kinds):
            measured |= _kick(cell, part, name, found, log)
    if record.placement is not None and (settle := record.of(part, PlacePhase.SETTLE)):
        end = settle[0].end
        planned = planned_pose(cell, part, record.placement)
        measured |= placement_errors(planned, end.X_WP[part])
        measured["depth_m"] = _depth(cell, part, end)
        if (raised := cell.fixture.off_supports(part, end.X_JP(part))) is not None:
            measured["off_supports_m"] = raised
        measured["speed_after_1_s_m_per_s"] = float(np.linalg.norm(end.V_WP[part][3:]))
    return measured


def _kick(cell: Cell, part: str, name: str, phases: list[PhaseRecord], log: Arrays) -> Measured:
    """Return how far and how fast a part was thrown in some phases."""
    rows, start = rows_of(log, phases), phases[0].start
    p_JP0, X_WJ = start.X_JP(part).translation(), start.X_WJ
    poses = [X_WJ.InvertAndCompose(X_WP) for X_WP in logged_poses(cell, part, rows["q"])]
    return {
        f"{name}_kick_m": float(max(np.linalg.norm(X.translation() - p_JP0) for X in poses)),
        f"{name}_kick_m_per_s": float(logged_speed(cell, part, rows["v"]).max()),
    }


def _depth(cell: Cell, part: str, snapshot: Snapshot) -> float:
    """Return how far the lowest point (a motor's terminals) is below the fixture's top [m]."""
    X_JP = snapshot.X_JP(part)
    points = cell.product.parts[part].mesh.vertices @ X_JP.rotation().matrix().T
    lowest = float(points[:, 2].min() + X_JP.translation()[2])
    return cell.fixture.entry_height - lowest
