"""How bolts stand on their threads, and how they lie loose in the holes of what they clamp."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.products.joints import Screw
from cell.products.product import Product
from cell.workpieces.thread import Misfit
from planning.operations.operation import Measured
from planning.operations.snapshot import Snapshot


def standing(screw: Screw, X_HF: RigidTransform) -> Measured:
    """Return the errors of a bolt against standing upright on the mouth of its thread."""
    misfit = Misfit.between(RigidTransform([0.0, 0.0, -screw.thread_depth]) @ X_HF)
    return {
        "standing_axial_m": misfit.axial,
        "standing_lateral_m": misfit.lateral,
        "standing_tilt_rad": misfit.tilt,
    }


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
