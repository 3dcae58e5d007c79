"""SDF of the parallel-jaw grippers: fingers with combination fingertips on two different palms.

Sizes and masses are those of `cell.machines.grippers`; what is not published is drawn by eye [A].
All lengths in metres.
"""

from __future__ import annotations

import trimesh

from cell.cad.sdf_model import (
    Color,
    LinkContact,
    LinkInertia,
    Pose,
    SdfModel,
    box,
    cylinder,
    rounded_cylinder,
    tag,
    turned,
)
from cell.machines.grippers import GRIPPER_85, HAND_E
from cell.machines.grippers.base import GripperModel

BLACK: Color = (0.13, 0.13, 0.14)
STEEL: Color = (0.60, 0.61, 0.63)
RUBBER: Color = (0.85, 0.45, 0.15)
STEEL_DENSITY = 7850.0

# Rubberised steel: one modulus for all pads. A 40 N grip indents a pad by tenths of a mm [M].
PAD_CONTACT = LinkContact("compliant", friction=0.8, modulus=1e7, dissipation=5.0, hint=0.02)  # [A]
BODY_CONTACT = LinkContact("point", friction=0.3)  # [A] anodised aluminium.

Block = tuple[str, tuple[float, float, float], tuple[float, float, float]]

# Solid parts of a finger as (name, size, centre) for the finger on +x, in the frame tip.
STEM: Block = ("stem", (0.012, 0.018, 0.043), (0.007, 0.0, -0.0435))
BRIDGE: Block = ("bridge", (0.016, 0.039, 0.008), (0.008, 0.0105, -0.018))
BLOCKS = (STEM, BRIDGE)
ENVELOPE = (0.016, 0.039, 0.083)  # Of a finger, stem to nose.
BODY_RADIUS = 0.0375  # Of both palms [R].


def add_fingers(model: SdfModel, gripper: GripperModel) -> None:
    """Add both fingers, the frames and the contact filter to a model that has its ``palm``."""
    _add_finger(model, gripper, "left", +1)
    _add_finger(model, gripper, "right", -1)
    tips, z = gripper.tips, gripper.tip_z
    model.frame(gripper.mount_frame, "palm")
    model.frame("tip", "palm", Pose(z=z))
    model.frame("wide", "palm", Pose(y=tips.wing_y, z=z))
    model.frame("nose", "palm", Pose(z=z + tips.nose_z))
    model.ignore_contact_between("hand", ["palm", "finger_left", "finger_right"])


def _pads(gripper: GripperModel) -> tuple[Block, ...]:
    """Return the pads for the finger on +x."""
    tips = gripper.tips
    wing_x = tips.wing_offset + tips.wing[0] / 2
    return (
        ("pad_tip", tips.pad, (tips.pad[0] / 2, 0.0, 0.0)),
        ("pad_wide", tips.wing, (wing_x, tips.wing_y, 0.0)),
        ("pad_nose", tips.nose, (tips.nose[0] / 2, 0.0, tips.nose_start + tips.nose[2] / 2)),
    )


def _necks(gripper: GripperModel) -> tuple[Block, ...]:
    """Return the blades from the bridge down to the pads; visual only."""
    tips = gripper.tips
    wing_x = tips.wing_offset + tips.wing[0] / 2
    return (
        ("neck_tip", (tips.pad[0], tips.pad[1], 0.006), (tips.pad[0] / 2, 0.0, -0.012)),
        ("neck_wide", (tips.wing[0], tips.wing[1], 0.006), (wing_x, tips.wing_y, -0.012)),
    )


def _add_finger(model: SdfModel, gripper: GripperModel, side: str, sign: int) -> None:
    """Add the finger on the +x (``sign`` 1) or -x side of the jaws with its slide."""
    link = f"finger_{side}"
    model.link(link, _finger_inertia(gripper, sign), parent="palm", pose=Pose(z=gripper.tip_z))
    for name, size, centre in (*BLOCKS, *_necks(gripper)):
        model.visual(link, name, box(*size), STEEL, _mirrored(centre, sign))
    for name, size, centre in BLOCKS:
        model.collision(link, name, box(*size), BODY_CONTACT, _mirrored(centre, sign))
    for name, size, centre in _pads(gripper):
        model.visual(link, name, box(*size), RUBBER, _mirrored(centre, sign))
        model.collision(link, name, box(*size), PAD_CONTACT, _mirrored(centre, sign))
    slide = _mirrored((0.010, 0, 0.005 - gripper.tip_distance), sign)
    model.visual(link, "slide", box(0.022, 0.024, 0.010), BLACK, slide)
    follows = {"joint": gripper.drive_joint, "multiplier": "1", "offset": "0"}
    drives = side == "left"
    model.joint(
        gripper.drive_joint if drives else gripper.follower_joint,
        "prismatic",
        "palm",
        link,
        axis=(sign, 0.0, 0.0),
        position=(0.0, gripper.travel),
        velocity=gripper.speed,
        effort=gripper.effort if drives else 0.0,
        damping=gripper.finger_damping,
        extra=[] if drives else [tag("drake:mimic", attributes=follows)],
    )


def _mirrored(centre: tuple[float, float, float], sign: int) -> Pose:
    return Pose(sign * centre[0], centre[1], centre[2])


def _finger_inertia(gripper: GripperModel, sign: int) -> LinkInertia:
    """Return the inertia of a finger: published mass at the stem plus steel tips, a box [D]."""
    tips = [(size, centre) for _, size, centre in (BRIDGE, *_pads(gripper), *_necks(gripper))]
    masses = [STEEL_DENSITY * size[0] * size[1] * size[2] for size, _ in tips]
    mass = gripper.finger_mass + sum(masses)
    moments = [
        (
            gripper.finger_mass * STEM[2][axis]
            + sum(m * c[axis] for m, (_, c) in zip(masses, tips, strict=True))
        )
        / mass
        for axis in range(3)
    ]
    return LinkInertia.of_box(mass, ENVELOPE, (sign * moments[0], moments[1], moments[2]))


# The gripper of 50 mm stroke: a round palm in Hand-E proportions.

COUPLER_LENGTH, COUPLER_MASS = 0.011, 0.119  # [R], see HAND_E.
HAND_E_BODY_LENGTH = HAND_E.palm_length - COUPLER_LENGTH
HAND_E_BODY_MASS = HAND_E.palm_mass - COUPLER_MASS


def hand_e() -> SdfModel:
    """Return the model; the origin of ``palm`` is the rear face of the coupler (``mount``)."""
    model = SdfModel(HAND_E.name)
    mass, length = HAND_E.palm_mass, HAND_E.palm_length
    centre = (
        COUPLER_MASS * COUPLER_LENGTH / 2
        + HAND_E_BODY_MASS * (COUPLER_LENGTH + HAND_E_BODY_LENGTH / 2)
    ) / mass
    # As one homogeneous cylinder [D].
    model.link("palm", LinkInertia.of_cylinder(mass, BODY_RADIUS, length, (0, 0, centre)))
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
    front.apply_translation([0.0, 0.0, HAND_E_BODY_LENGTH - 0.045])
    radius = BODY_RADIUS - 0.003
    waist = [(radius, 0.050), (BODY_RADIUS, 0.054), (0.0, 0.054)]
    rear = turned([(0, 0), (BODY_RADIUS, 0), (BODY_RADIUS - 0.003, 0.006), *waist])
    vertices, faces = trimesh.util.append_faces(
        [rear.vertices, front.vertices], [rear.faces, front.faces]
    )
    return trimesh.Trimesh(vertices, faces)


# The gripper of 85 mm stroke: a round body that carries a wide rail for the fingers. The rail is as
# wide as the open fingers of a gripper of this class, 149 mm.

RAIL = (0.149, 0.050, 0.030)
GRIPPER_85_BODY_LENGTH = GRIPPER_85.palm_length - RAIL[2]
BODY_SHARE = 0.65  # Of the palm's mass: motor and gears [A].


def gripper_85() -> SdfModel:
    """Return the model; the origin of ``palm`` is the rear face of the coupler (``mount``)."""
    model = SdfModel(GRIPPER_85.name)
    mass = GRIPPER_85.palm_mass
    length = GRIPPER_85_BODY_LENGTH
    z_body, z_rail = length / 2, length + RAIL[2] / 2
    z = BODY_SHARE * z_body + (1 - BODY_SHARE) * z_rail
    # Body and rail, each homogeneous, as one [D].
    pieces = (
        LinkInertia.of_cylinder(BODY_SHARE * mass, BODY_RADIUS, length, (0, 0, z_body)),
        LinkInertia.of_box((1 - BODY_SHARE) * mass, RAIL, (0, 0, z_rail)),
    )
    xx = sum(piece.moments[0] + piece.mass * (piece.com[2] - z) ** 2 for piece in pieces)
    yy = sum(piece.moments[1] + piece.mass * (piece.com[2] - z) ** 2 for piece in pieces)
    zz = sum(piece.moments[2] for piece in pieces)
    model.link("palm", LinkInertia(mass, (0.0, 0.0, z), (xx, yy, zz)))
    body, on_body = cylinder(BODY_RADIUS, length), Pose(z=z_body)
    on_rail = Pose(z=z_rail)
    housing = model.mesh("palm_body", rounded_cylinder(BODY_RADIUS, length - 0.011, 0.006))
    model.visual("palm", "coupler", cylinder(BODY_RADIUS, 0.011), STEEL, Pose(z=0.0055))
    model.visual("palm", "body", housing, BLACK, Pose(z=0.011))
    model.visual("palm", "rail", box(*RAIL), STEEL, on_rail)
    model.collision("palm", "body", body, BODY_CONTACT, on_body)
    model.collision("palm", "rail", box(*RAIL), BODY_CONTACT, on_rail)
    add_fingers(model, GRIPPER_85)
    return model
