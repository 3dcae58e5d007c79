"""SDF of the gripper of 50 mm stroke: a round palm in Hand-E proportions."""

from __future__ import annotations

import trimesh

from cell.cad.fingers import BLACK, BODY_CONTACT, STEEL, add_fingers
from cell.cad.sdf_model import Inertia, Pose, SdfModel, box, cylinder, rounded_cylinder, turned
from cell.machines.grippers import HAND_E

COUPLER_LENGTH, COUPLER_MASS = 0.011, 0.119  # [R], see HAND_E.
BODY_RADIUS = 0.0375  # [R]
BODY_LENGTH = HAND_E.palm_length - COUPLER_LENGTH
BODY_MASS = HAND_E.palm_mass - COUPLER_MASS


def hand_e() -> SdfModel:
    """Return the model; the origin of ``palm`` is the rear face of the coupler (``mount``)."""
    model = SdfModel(HAND_E.name)
    mass, length = HAND_E.palm_mass, HAND_E.palm_length
    centre = (
        COUPLER_MASS * COUPLER_LENGTH / 2 + BODY_MASS * (COUPLER_LENGTH + BODY_LENGTH / 2)
    ) / mass
    # As one homogeneous cylinder [D].
    model.link("palm", Inertia.of_cylinder(mass, BODY_RADIUS, length, (0, 0, centre)))
    coupler = cylinder(BODY_RADIUS, COUPLER_LENGTH)
    model.visual("palm", "coupler", coupler, STEEL, Pose(z=COUPLER_LENGTH / 2))
    body = model.mesh("palm_body", _palm_shape())
    model.visual("palm", "body", body, BLACK, Pose(z=COUPLER_LENGTH))
    ring = cylinder(BODY_RADIUS + 0.0005, 0.006)
    model.visual("palm", "ring", ring, (0.30, 0.55, 0.75), Pose(z=0.085))
    model.visual("palm", "rail", box(0.070, 0.026, 0.012), STEEL, Pose(z=length - 0.005))
    model.collision("palm", "palm", cylinder(BODY_RADIUS, length), BODY_CONTACT, Pose(z=length / 2))
    add_fingers(model, HAND_E)
    return model


def _palm_shape() -> trimesh.Trimesh:
    """Return the round body with a waist behind the ring and a rounded front."""
    front = rounded_cylinder(BODY_RADIUS, 0.045, 0.006)
    front.apply_translation([0.0, 0.0, BODY_LENGTH - 0.045])
    radius = BODY_RADIUS - 0.003
    waist = [(radius, 0.050), (BODY_RADIUS, 0.054), (0.0, 0.054)]
    rear = turned([(0, 0), (BODY_RADIUS, 0), (BODY_RADIUS - 0.003, 0.006), *waist])
    vertices, faces = trimesh.util.append_faces(
        [rear.vertices, front.vertices], [rear.faces, front.faces]
    )
    return trimesh.Trimesh(vertices, faces)
