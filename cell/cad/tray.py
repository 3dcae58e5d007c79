"""The parts tray of motor_unit: cradles for the motor, ledges for the plate, rails for the bolts.

Frame T: origin at the centre of the base plate's top face, +z up. The nests clear a gripper
that comes straight down: fingers reach 18 mm below the middle of a gripped part, and the wide pads
pass outside of it. Stops have 1 mm of play. Lengths in millimetres, all [D] from the
parts and the gripper.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RotationMatrix

from cell.cad.motor_unit import (
    CAN_FACETS,
    CAN_RADIUS,
    GEARBOX_RADIUS,
    HEAD_RADIUS,
    MM,
    box_piece,
)
from cell.cad.sdf import Contact, Model, Piece, Visual, mesh_inertia, write_model
from cell.cad.shapes import box, to_trimesh, vertex_radius

BASE = (260.0, 200.0, 8.0)
PRINTED = 1240.0  # kg/m3, PLA [A].

# The motor lies with its shaft along +y_T and its own +x down: gearbox and can, prisms of 16 flats
# in contact, have a flat towards each slab of the cradles, also when it is turned by 90 degrees.
MOTOR_AXIS_X, MOTOR_AXIS_Z = -70.0, 32.0

# The plate lies foot down with x_A along x_T.
PLATE_X, PLATE_Y, PLATE_Z = 70.0, 40.0, 30.0

# Bolts hang by their heads between two rails, 16 mm apart.
BOLT_Y, BOLT_Z, BOLT_SPACING, RAIL_GAP = -70.0, 24.0, 16.0, 3.7
# A ridge ends inside the rim of the head, even off centre by 0.3.
RAIL_WIDTH, RIDGE_WIDTH, RIDGE_HEIGHT = 6.0, 0.6, 4.0

PLASTIC = Contact(0.5, 1e8, dissipation=5.0)  # [A] printed polymer, stiff against part weights.
# Pressure rises over half the width of a piece: a thin one needs a lower modulus to be as stiff.
THIN_PLASTIC = Contact(0.5, 1e7, dissipation=5.0)
BASE_GREY, NEST_TEAL = (0.22, 0.24, 0.27), (0.10, 0.48, 0.50)


def motor_nest() -> list[Piece]:
    """Return two V cradles and two end stops."""
    gearbox, can = (
        vertex_radius(radius, CAN_FACETS) * np.cos(np.pi / CAN_FACETS)
        for radius in (GEARBOX_RADIUS, CAN_RADIUS)
    )
    front = _cradle("motor_front", gearbox, y_low=38.0, y_high=54.0)
    rear = _cradle("motor_rear", can, y_low=5.5, y_high=11.5)
    x = MOTOR_AXIS_X
    stops = [
        # Below the boss, also of a motor that lies with its shaft down.
        box_piece("motor_stop_front", (x - 8, 59, 0), (x + 8, 62, 18), PLASTIC),
        box_piece("motor_stop_rear", (x - 8, 0.6, 0), (x + 8, 3.6, 18.5), PLASTIC),
    ]
    return [*front, *rear, *stops]


def _cradle(name: str, distance: float, y_low: float, y_high: float) -> list[Piece]:
    """Return two slabs at 45 degrees whose faces are ``distance`` from the motor's axis [mm]."""
    length, thickness = 12.0, 4.0
    axis = np.array([MOTOR_AXIS_X, (y_low + y_high) / 2, MOTOR_AXIS_Z])
    slabs = []
    for side, sign in (("left", -1.0), ("right", 1.0)):
        # The slab's z points at the axis.
        R_TS = RotationMatrix.MakeYRotation(-sign * np.pi / 4)
        center = axis - R_TS.matrix()[:, 2] * (distance + thickness / 2)
        shape = Box(length * MM, (y_high - y_low) * MM, thickness * MM)
        slabs.append(Piece(f"{name}_{side}", shape, PLASTIC, RigidTransform(R_TS, center * MM)))
    return slabs


def plate_nest() -> list[Piece]:
    """Return two ledges under the face and four posts around the foot."""
    x, y, z = PLATE_X, PLATE_Y, PLATE_Z
    return [
        box_piece("plate_ledge_left", (x - 29.5, y - 22, 0), (x - 20.5, y + 18, z), PLASTIC),
        box_piece("plate_ledge_right", (x + 20.5, y - 22, 0), (x + 29.5, y + 18, z), PLASTIC),
        box_piece("plate_stop_inner", (x - 15, y - 27, 0), (x + 15, y - 24, z - 6), PLASTIC),
        box_piece("plate_stop_outer", (x - 15, y - 38, 0), (x + 15, y - 34, z - 6), PLASTIC),
        box_piece("plate_stop_left", (x - 40, y - 33, 0), (x - 36, y - 28, z - 6), PLASTIC),
        box_piece("plate_stop_right", (x + 36, y - 33, 0), (x + 40, y - 28, z - 6), PLASTIC),
    ]


def bolt_nest() -> list[Piece]:
    """Return two rails with thin ridges under the heads, so that noses pass beside the ridges."""
    half_length, foot = 2.5 * BOLT_SPACING + 3 * HEAD_RADIUS, BOLT_Z - RIDGE_HEIGHT
    pieces = []
    for side, sign in (("near", -1.0), ("far", 1.0)):
        for name, width, z_low, z_high, contact in (
            ("rail", RAIL_WIDTH, 0.0, foot, PLASTIC),
            ("ridge", RIDGE_WIDTH, foot, BOLT_Z, THIN_PLASTIC),
        ):
            gap = sign * RAIL_GAP / 2
            y_low, y_high = sorted((BOLT_Y + gap, BOLT_Y + gap + sign * width))
            low, high = (-half_length, y_low, z_low), (half_length, y_high, z_high)
            pieces.append(box_piece(f"bolt_{name}_{side}", low, high, contact))
    return pieces


def _webs() -> list[Visual]:
    """Return the blocks that carry the slabs of the motor's cradles; visual only."""
    x = MOTOR_AXIS_X
    visuals = []
    for name, y_low, y_high in (("web_front", 38.0, 54.0), ("web_rear", 5.5, 11.5)):
        for side, low, high in (("left", -20.5, -9.0), ("right", 9.0, 20.5), ("middle", -9.0, 9.0)):
            top = 3.0 if side == "middle" else 13.0
            web = box_piece(name, (x + low, y_low, 0), (x + high, y_high, top), PLASTIC)
            visuals.append(Visual(f"{name}_{side}", web.shape, NEST_TEAL, web.X_PS))
    return visuals


def tray_model() -> Model:
    """Return the tray; every contact piece is visible, too."""
    x, y, height = BASE
    base = box_piece("base", (-x / 2, -y / 2, -height), (x / 2, y / 2, 0), PLASTIC)
    nests = [*motor_nest(), *plate_nest(), *bolt_nest()]
    visuals = [Visual("base_look", base.shape, BASE_GREY, base.X_PS), *_webs()]
    visuals += [Visual(f"{p.name}_look", p.shape, NEST_TEAL, p.X_PS) for p in nests]
    slab = to_trimesh(box((-x / 2, -y / 2, -height), (x / 2, y / 2, 0)).scale([MM, MM, MM]))
    inertia = mesh_inertia(slab, PRINTED * slab.volume, "motor_unit_tray")
    return Model("motor_unit_tray", inertia, [base, *nests], visuals)


def write_models(folder: Path) -> None:
    """Write motor_unit_tray into ``folder`` (``models/sdf``)."""
    write_model(folder, tray_model())
