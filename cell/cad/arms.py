"""SDF of the arms: kinematics and masses of `cell.machines.arms`, own shapes.

The shapes are drawn by eye [A]; collision shapes make point contact only.
"""

from __future__ import annotations

from dataclasses import dataclass

from cell.cad.sdf_model import (
    Color,
    LinkContact,
    LinkInertia,
    Pose,
    SdfModel,
    capsule,
    cylinder,
    pointing,
    rounded_cylinder,
    tag,
)
from cell.machines.arms.base import ArmModel
from cell.machines.arms.ur import UrArm

GREY: Color = (0.70, 0.71, 0.72)
BLUE: Color = (0.24, 0.48, 0.70)
DARK: Color = (0.16, 0.17, 0.18)
ARM_CONTACT = LinkContact("point", friction=0.3)  # [A] painted aluminium.


def arm_skeleton(arm: ArmModel, base: LinkInertia) -> SdfModel:
    """Return a model of links and joints without shapes and without the flange's frame.

    Args:
        arm: The arm.
        base: Inertia of the fixed base link.
    """
    model = SdfModel(arm.name)
    model.link(arm.base_frame, base)
    parent = arm.base_frame
    for link in arm.links:
        inertia = LinkInertia(link.mass, link.com, link.moments)
        model.link(link.name, inertia, parent=parent, pose=Pose(*link.xyz, *link.rpy))
        model.joint(
            link.joint,
            "revolute",
            parent,
            link.name,
            position=(link.lower, link.upper),
            velocity=link.speed,
            effort=link.effort,
            damping=arm.joint_damping,
            extra=[
                tag("drake:rotor_inertia", arm.rotor_inertia),
                tag("drake:gear_ratio", arm.gear_ratio),
            ],
        )
        parent = link.name
    return model


# The six-axis arms. Link frames are those of the maker's description, so that ``base_link`` is the
# controller's base frame, all joints turn about z, and ``flange`` is the tool0 frame (+z out of the
# flange). With all joints at zero the arm points along -x of its base. The shapes are drawn for the
# ur5e; on the other sizes they are stretched to the link lengths and scaled to the base diameter.
# The collision shapes enclose them by 1 to 3 mm.


@dataclass(frozen=True)
class UrShape:
    """Dimensions of an arm's shape besides its Denavit-Hartenberg lengths.

    Attributes:
        girth: Thickness of all shapes relative to the ur5e: ratio of the base diameters, about 128,
            149 and 190 mm [A].
        shoulder_offset: Of the upper arm's tube beside the shoulder [m] [R "measured from model"].
        elbow_offset: Of the forearm's tube beside the shoulder [m] [R "measured from model"].
    """

    girth: float
    shoulder_offset: float
    elbow_offset: float


# Offsets [R Universal_Robots_ROS2_Description, config/*/physical_parameters.yaml].
SHAPES = {
    "ur3e": UrShape(0.86, 0.120, 0.027),
    "ur5e": UrShape(1.0, 0.138, 0.007),
    "ur10e": UrShape(1.275, 0.1762, 0.0393),
}


@dataclass(frozen=True)
class _Tube:
    """A round piece of a link's shape along an axis.

    Attributes:
        link: Without the "_link".
        start: (3,) in the link frame [m].
        axis: "+x" ... "-z".
        length: [m].
        radius: Of the visible shape [m].
        end: "cap" (blue, rounded), "round" (grey, rounded), "ring" (dark ring at the end), "open".
        clearance: Of the collision shape around the visible one [m].
    """

    link: str
    start: tuple[float, float, float]
    axis: str
    length: float
    radius: float
    end: str = "open"
    clearance: float = 0.002


def ur(arm: UrArm) -> SdfModel:
    """Return the model of an arm of the six-axis family."""
    shape = SHAPES[arm.name]
    g, side, elbow = shape.girth, shape.shoulder_offset, shape.elbow_offset
    height = arm.d[0] - 0.0705 * g  # Of the base's tube.
    # Base as a cylinder [D].
    base = LinkInertia.of_cylinder(arm.base_mass, 0.0725 * g, height, (0, 0, height / 2))
    model = arm_skeleton(arm, base)
    for index, tube in enumerate(_tubes(arm)):
        _add_tube(model, tube, index)
    # Rounded lids on the blind ends of upper arm and forearm, at elbow and wrist.
    lids = (
        ("upper_arm", (arm.a[1], 0, side + 0.056 * g), "+z", 0.054 * g),
        ("forearm", (arm.a[2], 0, elbow - 0.047 * g), "-z", 0.041 * g),
    )
    for index, (link, start, axis, radius) in enumerate(lids):
        lid = model.mesh(f"lid_{index}", rounded_cylinder(radius, 0.014, 0.010))
        model.visual(f"{link}_link", f"lid_{index}", lid, BLUE, pointing(axis, start))
    model.visual("base_link", "foot", cylinder(0.0745 * g, 0.012), DARK, Pose(z=0.006))
    model.frame(arm.flange_frame, arm.links[-1].name)
    return model


def _tubes(arm: UrArm) -> tuple[_Tube, ...]:
    """Return the tubes of an arm; neighbouring links are 4 mm times the girth apart."""
    shape = SHAPES[arm.name]
    g, side, elbow = shape.girth, shape.shoulder_offset, shape.elbow_offset
    d1, _, _, d4, d5, d6 = arm.d
    a2, a3 = arm.a[1], arm.a[2]
    beside = side - elbow - 0.010 * g  # Length of the forearm's housing at the elbow.
    across = d4 - elbow - 0.0183 * g  # The same at the wrist.
    return (
        _Tube("base", (0, 0, 0), "+z", d1 - 0.0705 * g, 0.0725 * g, "ring", 0.003),
        _Tube("shoulder", (0, 0, -0.068 * g), "+z", 0.130 * g, 0.060 * g, "round"),
        _Tube("shoulder", (0, 0, 0), "-y", side - 0.064 * g, 0.059 * g, "ring"),
        _Tube("upper_arm", (0, 0, side - 0.060 * g), "+z", 0.118 * g, 0.059 * g, "cap"),
        _Tube("upper_arm", (0, 0, side), "-x", -a2, 0.048 * g),
        _Tube("upper_arm", (a2, 0, side + 0.058 * g), "-z", 0.122 * g, 0.054 * g, "ring"),
        _Tube("forearm", (0, 0, side - 0.068 * g), "-z", beside, 0.054 * g, "cap"),
        _Tube("forearm", (0, 0, elbow), "-x", -a3, 0.0385 * g),
        _Tube("forearm", (a3, 0, elbow - 0.049 * g), "+z", across, 0.041 * g, "ring"),
        _Tube("wrist_1", (0, 0, -0.063 * g), "+z", 0.063 * g, 0.039 * g),
        _Tube("wrist_1", (0, 0.0497 * g - d5, 0), "+y", d5 - 0.0027 * g, 0.041 * g, "cap"),
        _Tube("wrist_2", (0, 0, -0.046 * g), "+z", 0.046 * g, 0.039 * g),
        _Tube("wrist_2", (0, d6 - 0.0496 * g, 0), "-y", d6 - 0.0026 * g, 0.041 * g, "cap"),
        _Tube("wrist_3", (0, 0, -0.048 * g), "+z", 0.048 * g, 0.0365 * g, "ring", 0.001),
    )  # fmt: skip


def _add_tube(model: SdfModel, tube: _Tube, index: int) -> None:
    """Add the visible and the collision shape of one tube."""
    link, name = f"{tube.link}_link", f"{tube.link}_{index}"
    middle = pointing(tube.axis, tube.start, tube.length / 2)
    if tube.end in ("cap", "round"):
        color = BLUE if tube.end == "cap" else GREY
        body = tube.length - 0.02
        shape = model.mesh(f"end_{index}", rounded_cylinder(tube.radius, 0.02, 0.012))
        model.visual(link, f"{name}_end", shape, color, pointing(tube.axis, tube.start, body))
    else:
        body = tube.length
    trunk = pointing(tube.axis, tube.start, body / 2)
    model.visual(link, name, cylinder(tube.radius, body), GREY, trunk)
    if tube.end == "ring":
        ring = pointing(tube.axis, tube.start, tube.length - 0.0035)  # Protrudes from the end.
        model.visual(link, f"{name}_ring", cylinder(tube.radius + 0.0008, 0.008), DARK, ring)
    radius = tube.radius + tube.clearance
    long = tube.length > 4 * tube.radius
    hull = capsule(radius, tube.length) if long else cylinder(radius, tube.length)
    model.collision(link, name, hull, ARM_CONTACT, middle)


# The seven-axis arm: capsules that overlap at the joints, drawn from the link lengths; visual and
# collision shapes agree. The forearm is slimmer at the wrist: the flange clears it with the wrist
# fully bent.

BASE_RADIUS, BASE_LENGTH = 0.078, 0.150
# Link, axis, start and end of the straight part of the capsule on it [m], radius [m].
CAPSULES = (
    ("link_1", "+z", 0.075, 0.2025, 0.070),
    ("link_2", "+y", 0.0, 0.175, 0.070),
    ("link_3", "+z", 0.030, 0.2155, 0.065),
    ("link_4", "+y", 0.0, 0.155, 0.065),
    ("link_5", "+z", 0.020, 0.120, 0.055),
    ("link_5", "+z", 0.120, 0.2155, 0.045),
    ("link_6", "+y", 0.0, 0.050, 0.050),
)
FLANGE_RADIUS, FLANGE_START = 0.042, 0.010
RING = 0.008  # Length of the dark ring around the flange.


def seven_axis(arm: ArmModel) -> SdfModel:
    """Return the model of the seven-axis arm."""
    com, moments = (-0.1, 0.0, 0.07), (0.05, 0.06, 0.03)  # [R] as the links.
    base = LinkInertia(arm.base_mass, com, moments)
    model = arm_skeleton(arm, base)
    foot = cylinder(BASE_RADIUS, BASE_LENGTH)
    model.visual(arm.base_frame, "base", foot, DARK, Pose(z=BASE_LENGTH / 2))
    model.collision(arm.base_frame, "base", foot, ARM_CONTACT, Pose(z=BASE_LENGTH / 2))
    for index, (link, axis, start, end, radius) in enumerate(CAPSULES):
        shape = capsule(radius, end - start)
        pose = pointing(axis, (0.0, 0.0, 0.0), (start + end) / 2)
        color = BLUE if link in ("link_2", "link_4", "link_6") else GREY
        model.visual(link, f"tube_{index}", shape, color, pose)
        model.collision(link, f"tube_{index}", shape, ARM_CONTACT, pose)
    last = arm.links[-1].name
    length = arm.flange_z - FLANGE_START
    plate, middle = cylinder(FLANGE_RADIUS, length), Pose(z=FLANGE_START + length / 2)
    model.visual(last, "plate", plate, GREY, middle)
    model.collision(last, "plate", plate, ARM_CONTACT, middle)
    ring = Pose(z=arm.flange_z - RING / 2)
    model.visual(last, "ring", cylinder(FLANGE_RADIUS + 0.0008, RING), DARK, ring)
    model.frame(arm.flange_frame, last, Pose(z=arm.flange_z))
    return model
