"""SDF of the parallel-jaw gripper: Hand-E proportions with own combination fingertips.

Three pairs of jaws on one pair of fingers, all with x the closing direction, y lateral and z the
approach direction, and their origin midway between the jaws:
``tip``, the main pads; ``wide``, recessed wings that hold what is 24 to 74 mm wide; ``nose``, the
narrow ends that pick a bolt by its head. Each finger travels half the opening s.

The pads are thin blades so that the tip can pick a bolt next to the motor's shaft: 10 mm away from
the bolt's axis, of which the shaft takes 3 mm and half the bolt's head 2.75 mm.

Sources: [R] AGH-CEAI/robotiq_hande_description, commit 4f66b057, for sizes, masses, stroke, speed
and effort of the Hand-E; [A] assumption; [D] derived. All lengths in metres.
"""

from __future__ import annotations

from pathlib import Path

import trimesh

from cell.cad.sdf_model import (
    Color,
    Contact,
    Inertia,
    Pose,
    SdfModel,
    box,
    cylinder,
    rounded_cylinder,
    tag,
    turned,
)

BLACK: Color = (0.13, 0.13, 0.14)
STEEL: Color = (0.60, 0.61, 0.63)
RUBBER: Color = (0.85, 0.45, 0.15)

COUPLER_LENGTH, COUPLER_MASS = 0.011, 0.119  # [R]
BODY_LENGTH, BODY_MASS, BODY_RADIUS = 0.099, 0.86387, 0.0375  # [R]
PALM_LENGTH = COUPLER_LENGTH + BODY_LENGTH
FINGER_MASS = 0.03804  # [R]
STROKE, SPEED, EFFORT = 0.025, 0.15, 130.0  # Per finger [m], [m/s], [N] [R].
FINGER_DAMPING = 5.0  # [N s/m] [A]
STEEL_DENSITY = 7850.0

# Own fingertips [A]. z is measured from the jaw frame, x from the closing plane.
TIP_Z = PALM_LENGTH + 0.065  # Pad centre in front of the mount.
PAD = (0.003, 0.016, 0.020)
WING_OFFSET = 0.012  # The wing's face stands back behind the pad's face.
WING_Y = 0.022
WING = (0.004, 0.016, 0.020)
NOSE = (0.002, 0.003, 0.014)
NOSE_Z = (0.010, 0.0225)  # Where the nose begins; where its frame sits.

# Rubberised steel: one modulus for all pads. A 40 N grip indents a pad by tenths of a mm [M].
PAD_CONTACT = Contact("compliant", friction=0.8, modulus=1e7, dissipation=5.0, hint=0.02)  # [A]
BODY_CONTACT = Contact("point", friction=0.3)  # [A] anodised aluminium.

# Solid parts of a finger as (name, size, centre) for the finger on +x, in the frame tip.
STEM = ("stem", (0.012, 0.018, 0.043), (0.007, 0.0, -0.0435))
BRIDGE = ("bridge", (0.016, 0.039, 0.008), (0.008, 0.0105, -0.018))
PIECES = (STEM, BRIDGE)
PADS = (
    ("pad_tip", PAD, (PAD[0] / 2, 0.0, 0.0)),
    ("pad_wide", WING, (WING_OFFSET + WING[0] / 2, WING_Y, 0.0)),
    ("pad_nose", NOSE, (NOSE[0] / 2, 0.0, NOSE_Z[0] + NOSE[2] / 2)),
)
# The blades reach from the bridge down to the pads; only seen, the bridge and pads are felt.
NECKS = (
    ("neck_tip", (PAD[0], PAD[1], 0.006), (PAD[0] / 2, 0.0, -0.012)),
    ("neck_wide", (WING[0], WING[1], 0.006), (WING_OFFSET + WING[0] / 2, WING_Y, -0.012)),
)


def hand_e() -> SdfModel:
    """Return the model; the origin of ``palm`` is the rear face of the coupler (``mount``)."""
    model = SdfModel("hand_e")
    _add_palm(model)
    _add_finger(model, "left", +1)
    _add_finger(model, "right", -1)
    model.frame("mount", "palm")
    model.frame("tip", "palm", Pose(z=TIP_Z))
    model.frame("wide", "palm", Pose(y=WING_Y, z=TIP_Z))
    model.frame("nose", "palm", Pose(z=TIP_Z + NOSE_Z[1]))
    model.ignore_contact_between("hand", ["palm", "finger_left", "finger_right"])
    return model


def _add_palm(model: SdfModel) -> None:
    mass = COUPLER_MASS + BODY_MASS
    centre = (
        COUPLER_MASS * COUPLER_LENGTH / 2 + BODY_MASS * (COUPLER_LENGTH + BODY_LENGTH / 2)
    ) / mass
    model.link(
        "palm", Inertia.of_cylinder(mass, BODY_RADIUS, PALM_LENGTH, (0, 0, centre))
    )  # As one homogeneous cylinder [D].
    coupler = cylinder(BODY_RADIUS, COUPLER_LENGTH)
    model.visual("palm", "coupler", coupler, STEEL, Pose(z=COUPLER_LENGTH / 2))
    body = model.mesh("palm_body", _palm_shape())
    model.visual("palm", "body", body, BLACK, Pose(z=COUPLER_LENGTH))
    ring = cylinder(BODY_RADIUS + 0.0005, 0.006)
    model.visual("palm", "ring", ring, (0.30, 0.55, 0.75), Pose(z=0.085))
    model.visual("palm", "rail", box(0.070, 0.026, 0.012), STEEL, Pose(z=PALM_LENGTH - 0.005))
    hull = cylinder(BODY_RADIUS, PALM_LENGTH)
    model.collision("palm", "palm", hull, BODY_CONTACT, Pose(z=PALM_LENGTH / 2))


def _palm_shape() -> trimesh.Trimesh:
    """Return the round body with a waist behind the ring and a rounded front."""
    front = rounded_cylinder(BODY_RADIUS, 0.045, 0.006)
    front.apply_translation([0.0, 0.0, BODY_LENGTH - 0.045])
    rear = turned([(0, 0), (BODY_RADIUS, 0), (BODY_RADIUS - 0.003, 0.006)] + _waist())
    vertices, faces = trimesh.util.append_faces(
        [rear.vertices, front.vertices], [rear.faces, front.faces]
    )
    return trimesh.Trimesh(vertices, faces)


def _waist() -> list[tuple[float, float]]:
    radius = BODY_RADIUS - 0.003
    return [(radius, 0.050), (BODY_RADIUS, 0.054), (0.0, 0.054)]


def _add_finger(model: SdfModel, side: str, sign: int) -> None:
    """Add the finger on the +x (``sign`` 1) or -x side of the jaws with its slide."""
    link = f"finger_{side}"
    model.link(link, _finger_inertia(sign), parent="palm", pose=Pose(z=TIP_Z))
    for name, size, centre in (*PIECES, *NECKS):
        model.visual(link, name, box(*size), STEEL, _mirrored(centre, sign))
    for name, size, centre in PIECES:
        model.collision(link, name, box(*size), BODY_CONTACT, _mirrored(centre, sign))
    for name, size, centre in PADS:
        model.visual(link, name, box(*size), RUBBER, _mirrored(centre, sign))
        model.collision(link, name, box(*size), PAD_CONTACT, _mirrored(centre, sign))
    model.visual(
        link, "slide", box(0.022, 0.024, 0.010), BLACK, _mirrored((0.010, 0, -0.060), sign)
    )
    follows = {"joint": "finger_left_joint", "multiplier": "1", "offset": "0"}
    model.joint(
        f"finger_{side}_joint",
        "prismatic",
        "palm",
        link,
        axis=(sign, 0.0, 0.0),
        position=(0.0, STROKE),
        velocity=SPEED,
        effort=EFFORT if side == "left" else 0.0,
        damping=FINGER_DAMPING,
        extra=[] if side == "left" else [tag("drake:mimic", attributes=follows)],
    )


def _mirrored(centre: tuple[float, float, float], sign: int) -> Pose:
    return Pose(sign * centre[0], centre[1], centre[2])


def _finger_inertia(sign: int) -> Inertia:
    """Return the published finger mass at the stem plus own steel tips, as one box [D]."""
    tips = [(size, centre) for _, size, centre in (BRIDGE, *PADS, *NECKS)]
    masses = [STEEL_DENSITY * size[0] * size[1] * size[2] for size, _ in tips]
    mass = FINGER_MASS + sum(masses)
    moments = [
        (
            FINGER_MASS * STEM[2][axis]
            + sum(m * c[axis] for m, (_, c) in zip(masses, tips, strict=True))
        )
        / mass
        for axis in range(3)
    ]
    com = (sign * moments[0], moments[1], moments[2])
    envelope = (0.016, 0.039, 0.083)  # Stem to nose.
    return Inertia.of_box(mass, envelope, com)


def write_models(folder: Path) -> None:
    """Write the gripper into ``folder``/hand_e."""
    hand_e().write(folder)
