"""The fingers of a parallel-jaw gripper with combination fingertips, and its frames.

Sizes and masses are those of `cell.machines.grippers`; the solid parts between palm and pads are
drawn by eye [A]. All lengths in metres.
"""

from __future__ import annotations

from cell.cad.sdf_model import Color, Contact, Inertia, Pose, SdfModel, box, tag
from cell.machines.grippers.base import GripperModel

BLACK: Color = (0.13, 0.13, 0.14)
STEEL: Color = (0.60, 0.61, 0.63)
RUBBER: Color = (0.85, 0.45, 0.15)
STEEL_DENSITY = 7850.0

# Rubberised steel: one modulus for all pads. A 40 N grip indents a pad by tenths of a mm [M].
PAD_CONTACT = Contact("compliant", friction=0.8, modulus=1e7, dissipation=5.0, hint=0.02)  # [A]
BODY_CONTACT = Contact("point", friction=0.3)  # [A] anodised aluminium.

Piece = tuple[str, tuple[float, float, float], tuple[float, float, float]]

# Solid parts of a finger as (name, size, centre) for the finger on +x, in the frame tip.
STEM: Piece = ("stem", (0.012, 0.018, 0.043), (0.007, 0.0, -0.0435))
BRIDGE: Piece = ("bridge", (0.016, 0.039, 0.008), (0.008, 0.0105, -0.018))
PIECES = (STEM, BRIDGE)
ENVELOPE = (0.016, 0.039, 0.083)  # Of a finger, stem to nose.


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


def _pads(gripper: GripperModel) -> tuple[Piece, ...]:
    """Return the pads for the finger on +x."""
    tips = gripper.tips
    wing_x = tips.wing_offset + tips.wing[0] / 2
    return (
        ("pad_tip", tips.pad, (tips.pad[0] / 2, 0.0, 0.0)),
        ("pad_wide", tips.wing, (wing_x, tips.wing_y, 0.0)),
        ("pad_nose", tips.nose, (tips.nose[0] / 2, 0.0, tips.nose_start + tips.nose[2] / 2)),
    )


def _necks(gripper: GripperModel) -> tuple[Piece, ...]:
    """Return the blades from the bridge down to the pads: only seen; bridge and pads are felt."""
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
    for name, size, centre in (*PIECES, *_necks(gripper)):
        model.visual(link, name, box(*size), STEEL, _mirrored(centre, sign))
    for name, size, centre in PIECES:
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


def _finger_inertia(gripper: GripperModel, sign: int) -> Inertia:
    """Return the published finger mass at the stem plus own steel tips, as one box [D]."""
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
    return Inertia.of_box(mass, ENVELOPE, (sign * moments[0], moments[1], moments[2]))
