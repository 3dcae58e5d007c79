"""SDF of the gripper of 85 mm stroke: a round body that carries a wide rail for the fingers.

The rail is as wide as the open fingers of a gripper of this class, 149 mm; the rest is drawn by eye
[A].
"""

from __future__ import annotations

from cell.cad.fingers import BLACK, BODY_CONTACT, STEEL, add_fingers
from cell.cad.sdf_model import Inertia, Pose, SdfModel, box, cylinder, rounded_cylinder
from cell.machines.grippers import GRIPPER_85

BODY_RADIUS = 0.0375
RAIL = (0.149, 0.050, 0.030)
BODY_LENGTH = GRIPPER_85.palm_length - RAIL[2]
BODY_SHARE = 0.65  # Of the palm's mass: motor and gears [A].


def gripper_85() -> SdfModel:
    """Return the model; the origin of ``palm`` is the rear face of the coupler (``mount``)."""
    model = SdfModel(GRIPPER_85.name)
    model.link("palm", _palm_inertia())
    body, on_body = cylinder(BODY_RADIUS, BODY_LENGTH), Pose(z=BODY_LENGTH / 2)
    on_rail = Pose(z=BODY_LENGTH + RAIL[2] / 2)
    housing = model.mesh("palm_body", rounded_cylinder(BODY_RADIUS, BODY_LENGTH - 0.011, 0.006))
    model.visual("palm", "coupler", cylinder(BODY_RADIUS, 0.011), STEEL, Pose(z=0.0055))
    model.visual("palm", "body", housing, BLACK, Pose(z=0.011))
    model.visual("palm", "rail", box(*RAIL), STEEL, on_rail)
    model.collision("palm", "body", body, BODY_CONTACT, on_body)
    model.collision("palm", "rail", box(*RAIL), BODY_CONTACT, on_rail)
    add_fingers(model, GRIPPER_85)
    return model


def _palm_inertia() -> Inertia:
    """Return body and rail, each homogeneous, as one [D]."""
    mass = GRIPPER_85.palm_mass
    z_body, z_rail = BODY_LENGTH / 2, BODY_LENGTH + RAIL[2] / 2
    z = BODY_SHARE * z_body + (1 - BODY_SHARE) * z_rail
    pieces = (
        Inertia.of_cylinder(BODY_SHARE * mass, BODY_RADIUS, BODY_LENGTH, (0, 0, z_body)),
        Inertia.of_box((1 - BODY_SHARE) * mass, RAIL, (0, 0, z_rail)),
    )
    xx = sum(piece.moments[0] + piece.mass * (piece.com[2] - z) ** 2 for piece in pieces)
    yy = sum(piece.moments[1] + piece.mass * (piece.com[2] - z) ** 2 for piece in pieces)
    zz = sum(piece.moments[2] for piece in pieces)
    return Inertia(mass, (0.0, 0.0, z), (xx, yy, zz))
