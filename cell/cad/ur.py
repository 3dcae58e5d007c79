"""SDF of the UR5e arm: published kinematics and masses, own shapes.

Link frames are those of the maker's description, so that ``base_link`` is the controller's base
frame, all joints turn about z, and ``flange`` is the tool0 frame (+z out of the flange). With all
joints at zero the arm points along -x of its base.

Sources: [R] Universal_Robots_ROS2_Description, commit 2221ec0f, for joint origins, masses, centres
of mass, inertias and limits; [A] assumption; [D] derived. Shapes are drawn by eye from the link
lengths [A]; the collision shapes enclose them by 1 to 3 mm and touch as points only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from cell.cad.sdf_model import (
    Color,
    Contact,
    Inertia,
    Pose,
    SdfModel,
    capsule,
    cylinder,
    pointing,
    rounded_cylinder,
    tag,
)

GREY: Color = (0.70, 0.71, 0.72)
BLUE: Color = (0.24, 0.48, 0.70)
DARK: Color = (0.16, 0.17, 0.18)

# Reflected rotor inertia 0.1 kg m2 on every joint [A]: the order of such drives; rotor times
# ratio squared. It also keeps explicit impedance control stable at 1 ms [M].
ROTOR_INERTIA = 1e-5
GEAR_RATIO = 100.0
JOINT_DAMPING = 0.5  # [N m s/rad] [A]: under 2 N m at full speed.
MAX_SPEED = math.pi  # 180 deg/s, all joints [R].
ARM_CONTACT = Contact("point", friction=0.3)  # [A] painted aluminium.

HALF, FULL = math.pi, 2 * math.pi


@dataclass(frozen=True)
class _Link:
    """One moving link: inertia, its joint's origin in the parent link, and the joint's limits."""

    name: str
    joint: str
    origin: Pose
    inertia: Inertia
    effort: float
    range: float


# The inertia of upper arm and forearm is published about an axis along x; here in link axes [R].
LINKS = (
    _Link(
        "shoulder_link",
        "shoulder_pan_joint",
        Pose(z=0.1625),
        Inertia(3.761, (0, -0.00193, -0.02561), (0.0102675, 0.0102675, 0.00666)),
        150.0,
        FULL,
    ),
    _Link(
        "upper_arm_link",
        "shoulder_lift_joint",
        Pose(roll=math.pi / 2),
        Inertia(8.058, (-0.2125, 0, 0.11336), (0.0151074, 0.1338858, 0.1338858)),
        150.0,
        FULL,
    ),
    _Link(
        "forearm_link",
        "elbow_joint",
        Pose(x=-0.425),
        Inertia(2.846, (-0.2422, 0, 0.0265), (0.004095, 0.0312094, 0.0312094)),
        150.0,
        HALF,
    ),
    _Link(
        "wrist_1_link",
        "wrist_1_joint",
        Pose(x=-0.3922, z=0.1333),
        Inertia(1.37, (0, -0.01634, -0.0018), (0.0025599, 0.0025599, 0.0021942)),
        28.0,
        FULL,
    ),
    _Link(
        "wrist_2_link",
        "wrist_2_joint",
        Pose(y=-0.0997, roll=math.pi / 2),
        Inertia(1.3, (0, 0.01634, -0.0018), (0.0025599, 0.0025599, 0.0021942)),
        28.0,
        FULL,
    ),
    _Link(
        "wrist_3_link",
        "wrist_3_joint",
        Pose(y=0.0996, roll=math.pi / 2, pitch=math.pi, yaw=math.pi),
        Inertia(0.365, (0, 0, -0.001159), (9.8904e-5, 9.8904e-5, 1.32117e-4)),
        28.0,
        FULL,
    ),
)


@dataclass(frozen=True)
class _Tube:
    """A round piece of a link's shape that starts at a point and goes along an axis.

    Attributes:
        link: Without the "_link".
        start: In the link frame [m].
        axis: "+x" ... "-z".
        length: [m].
        radius: Of the visible shape [m].
        end: "cap" (blue, rounded), "round" (grey, rounded), "ring" (dark ring at the end), "open".
        clearance: How far the collision shape stands off the visible one [m].
    """

    link: str
    start: tuple[float, float, float]
    axis: str
    length: float
    radius: float
    end: str = "open"
    clearance: float = 0.002


TUBES = (
    _Tube("base", (0, 0, 0), "+z", 0.092, 0.0725, "ring", 0.003),
    _Tube("shoulder", (0, 0, -0.068), "+z", 0.130, 0.060, "round"),
    _Tube("shoulder", (0, 0, 0), "-y", 0.074, 0.059, "ring"),
    _Tube("upper_arm", (0, 0, 0.078), "+z", 0.118, 0.059, "cap"),
    _Tube("upper_arm", (0, 0, 0.138), "-x", 0.425, 0.048),
    _Tube("upper_arm", (-0.425, 0, 0.196), "-z", 0.122, 0.054, "ring"),
    _Tube("forearm", (0, 0, 0.070), "-z", 0.121, 0.054, "cap"),
    _Tube("forearm", (0, 0, 0.007), "-x", 0.3922, 0.0385),
    _Tube("forearm", (-0.3922, 0, -0.042), "+z", 0.108, 0.041, "ring"),
    _Tube("wrist_1", (0, 0, -0.063), "+z", 0.063, 0.039),
    _Tube("wrist_1", (0, -0.050, 0), "+y", 0.097, 0.041, "cap"),
    _Tube("wrist_2", (0, 0, -0.046), "+z", 0.046, 0.039),
    _Tube("wrist_2", (0, 0.050, 0), "-y", 0.097, 0.041, "cap"),
    _Tube("wrist_3", (0, 0, -0.048), "+z", 0.048, 0.0365, "ring", 0.001),
)
# Rounded lids on the blind ends of the upper arm's and forearm's elbow-side housings.
LIDS = (
    ("upper_arm", (-0.425, 0, 0.194), "+z", 0.054),
    ("forearm", (-0.3922, 0, -0.040), "-z", 0.041),
)


def ur5e() -> SdfModel:
    """Return the model."""
    model = SdfModel("ur5e")
    base = Inertia.of_cylinder(4.0, 0.0725, 0.092, (0, 0, 0.046))  # Mass [R]; shape [D].
    model.link("base_link", base)
    parent = "base_link"
    for link in LINKS:
        model.link(link.name, link.inertia, parent=parent, pose=link.origin)
        _add_joint(model, link, parent)
        parent = link.name
    for index, tube in enumerate(TUBES):
        _add_tube(model, tube, index)
    for index, (link, start, axis, radius) in enumerate(LIDS):
        lid = model.mesh(f"lid_{index}", rounded_cylinder(radius, 0.014, 0.010))
        model.visual(f"{link}_link", f"lid_{index}", lid, BLUE, pointing(axis, start))
    model.visual("base_link", "foot", cylinder(0.0745, 0.012), DARK, Pose(z=0.006))
    model.frame("flange", "wrist_3_link")
    return model


def _add_joint(model: SdfModel, link: _Link, parent: str) -> None:
    drive = [tag("drake:rotor_inertia", ROTOR_INERTIA), tag("drake:gear_ratio", GEAR_RATIO)]
    model.joint(
        link.joint,
        "revolute",
        parent,
        link.name,
        position=(-link.range, link.range),
        velocity=MAX_SPEED,
        effort=link.effort,
        damping=JOINT_DAMPING,
        extra=drive,
    )


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
        ring = pointing(tube.axis, tube.start, tube.length - 0.0035)  # Proud of the end.
        model.visual(link, f"{name}_ring", cylinder(tube.radius + 0.0008, 0.008), DARK, ring)
    radius = tube.radius + tube.clearance
    long = tube.length > 4 * tube.radius
    hull = capsule(radius, tube.length) if long else cylinder(radius, tube.length)
    model.collision(link, name, hull, ARM_CONTACT, middle)


def write_models(folder: Path) -> None:
    """Write the arm into ``folder``/ur5e."""
    ur5e().write(folder)
