"""How bolts stand on their threads, lie loose in the holes of what they clamp, and fit those."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.products.joints import Screw
from cell.products.product import Product
from cell.workpieces.thread import Misfit
from planning.operations.operation import Measured
from planning.operations.snapshot import Snapshot
from planning.operations.station import Station

LEAST_PLAY = 1e-6  # Of a bolt in its hole, where it is drawn without [m].


def standing(screw: Screw, X_HF: RigidTransform) -> Measured:
    """Return the errors of a bolt against standing upright on the mouth of its thread."""
    misfit = Misfit.between(RigidTransform([0.0, 0.0, -screw.thread_depth]) @ X_HF)
    return {
        "standing_axial_m": misfit.axial,
        "standing_lateral_m": misfit.lateral,
        "standing_tilt_rad": misfit.tilt,
    }


def seated_pose(station: Station, bolt: str) -> RigidTransform:
    """Return X_WP of a bolt whose head rests on what it clamps, from what is believed.

    It is derived from the part that carries the thread, once that is on the fixture.
    """
    screw = station.cell.product.screws[bolt]
    name = screw.into if screw.into in station.fixed else screw.clamps
    X_WA = station.pose_of(name) @ station.part(name).X_AP.inverse()
    return X_WA @ station.part(bolt).X_AP


def mouth_pose(station: Station, bolt: str) -> RigidTransform:
    """Return X_WP of a bolt that stands on the mouth of its thread, be it there or not."""
    out = RigidTransform([0.0, 0.0, station.cell.product.screws[bolt].thread_depth])
    return seated_pose(station, bolt) @ out


def standing_pose(station: Station, bolt: str) -> RigidTransform:
    """Return X_WP at which a bolt will stand: on its thread, or by its head where there is none.

    Something else below the hole, such as the bed, may stop a bolt without a thread before.
    """
    if station.cell.product.screws[bolt].into in station.fixed:
        return mouth_pose(station, bolt)
    return seated_pose(station, bolt)


def in_hole(product: Product, bolt: str, snapshot: Snapshot) -> Measured:
    """Return how a bolt lies in the hole of what it clamps.

    How far its head stands off; how far its axis passes from the middle of the hole's upper end;
    how far it leans.
    """
    clamps = product.screws[bolt].clamps
    X_PSeat = product.parts[clamps].X_AP.InvertAndCompose(product.parts[bolt].X_AP)
    X_SeatF = (snapshot.X_WP[clamps] @ X_PSeat).InvertAndCompose(snapshot.X_WP[bolt])
    p_SeatF, axis = X_SeatF.translation(), X_SeatF.rotation().matrix()[:, 2]
    passes = p_SeatF - axis * (p_SeatF[2] / axis[2])
    return {
        "protrusion_m": float(p_SeatF[2]),
        "off_hole_m": float(np.hypot(passes[0], passes[1])),
        "lean_rad": float(np.arccos(np.clip(axis[2], -1.0, 1.0))),
    }


def screw_play(product: Product, bolt: str) -> float:
    """Return the radial play of a bolt in the hole of what it clamps, as drawn [m].

    The hole is as wide as the nearest corner of the part's surface is away from the bolt's axis.
    """
    screw = product.screws[bolt]
    part = product.parts[screw.clamps]
    X_FP = product.parts[bolt].X_AP.InvertAndCompose(part.X_AP)
    corners = X_FP.multiply(np.array(part.mesh.vertices, float).T)
    wide = float(np.hypot(corners[0], corners[1]).min())
    return max(wide - screw.diameter / 2.0, LEAST_PLAY)


def play_share(product: Product, part: str, X_GoalP: RigidTransform) -> float:
    """Return how far a part's screw holes are off their threads, over the play: the worst one.

    Args:
        product: Its screws; 0 is returned if none passes the part.
        part: Name of the part that they clamp.
        X_GoalP: Where it lies, in the frame where it belongs.
    """
    taken = 0.0
    for bolt, screw in product.screws.items():
        if screw.clamps == part:
            X_PF = product.parts[part].X_AP.InvertAndCompose(product.parts[bolt].X_AP)
            off = X_PF.rotation().inverse() @ (X_GoalP @ X_PF.translation() - X_PF.translation())
            taken = max(taken, float(np.hypot(off[0], off[1])) / screw_play(product, bolt))
    return taken
