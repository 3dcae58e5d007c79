"""The model of a machine screw of any size, from its mesh and its place in the table of sizes.

A screw's frame P has its origin at the centre of the underside of its head, +z from shank to head.
"""

from __future__ import annotations

import numpy as np
import trimesh

from cell.cad.motor_unit import (
    BLACK_OXIDE,
    BOLT_HOLE_EDGE,
    FIT_FRICTION,
    HEAD_FACETS,
    HEAD_STIFFNESS,
    METAL_DISSIPATION,
    MM,
)
from cell.cad.sdf import Contact, Model, Piece, Visual, mesh_inertia
from cell.cad.shapes import convex_revolve

THREAD_MODULUS = 1e9  # [Pa] As the motor unit's bolts.
TIP = 0.1  # [A] Chamfer of the tip, of the diameter.
SHANK_FACETS = 8
STIFFNESS_DIAMETER = 3.0  # [D] `HEAD_STIFFNESS` is that of an M3 head; it grows with the size [mm].


def screw_model(
    name: str,
    whole: trimesh.Trimesh,
    *,
    diameter: float,
    length: float,
    head: tuple[float, float],
    bearing: float,
    hole: float,
    density: float,
) -> Model:
    """Return the model of a screw.

    Args:
        name: Of the model.
        whole: Closed surface in P [m].
        diameter: Of the shank [mm].
        length: Of the shank [mm].
        head: Diameter and height [mm].
        bearing: Radius of the face under the head [mm].
        hole: Radius of the clearance hole [mm].
        density: [kg/m3].
    """
    wide, high = head
    radius, tip = diameter / 2.0, TIP * diameter
    # The pressure of a convex solid grows evenly from its underside to its middle.
    area = np.pi * (bearing**2 - (hole + BOLT_HOLE_EDGE) ** 2) * MM**2
    stiffness = HEAD_STIFFNESS * diameter / STIFFNESS_DIAMETER
    head_contact = Contact(
        FIT_FRICTION, stiffness * high / 2.0 * MM / area, dissipation=METAL_DISSIPATION
    )
    thread = Contact(FIT_FRICTION, THREAD_MODULUS, dissipation=METAL_DISSIPATION)
    crown = [(wide / 2.0 * MM, 0.0), (wide / 2.0 * MM, high * MM)]
    body = [
        ((radius - tip) * MM, -length * MM),
        (radius * MM, (tip - length) * MM),
        (radius * MM, 0.0),
    ]
    pieces = [
        Piece("head", convex_revolve(crown, HEAD_FACETS, phase=0.5), head_contact, convex=True),
        Piece("shank", convex_revolve(body, SHANK_FACETS), thread, convex=True),
    ]
    inertia = mesh_inertia(whole, density * whole.volume, name)
    return Model(name, inertia, pieces, [Visual("screw", whole, BLACK_OXIDE)], whole)
