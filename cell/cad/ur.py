"""SDF of the six-axis arms: kinematics and masses of `cell.machines.arms.ur`, own shapes.

Link frames are those of the maker's description, so that ``base_link`` is the controller's base
frame, all joints turn about z, and ``flange`` is the tool0 frame (+z out of the flange). With all
joints at zero the arm points along -x of its base.

The shapes are drawn by eye on the ur5e [A]; its sisters have them stretched to their link lengths
and as thick as their base is wide. The collision shapes enclose them by 1 to 3 mm and touch as
points only.
"""

from __future__ import annotations

from dataclasses import dataclass

from cell.cad.arm_model import ARM_CONTACT, BLUE, DARK, GREY, arm_skeleton
from cell.cad.sdf_model import (
    Inertia,
    Pose,
    SdfModel,
    capsule,
    cylinder,
    pointing,
    rounded_cylinder,
)
from cell.machines.arms.ur import UrArm


@dataclass(frozen=True)
class Shape:
    """What the drawing of an arm takes besides its Denavit-Hartenberg lengths.

    Attributes:
        girth: Thickness of everything relative to the ur5e: ratio of the bases' diameters, about
            128, 149 and 190 mm [A].
        shoulder_offset: Of the upper arm's tube beside the shoulder [m] [R "measured from model"].
        elbow_offset: Of the forearm's tube beside the shoulder [m] [R "measured from model"].
    """

    girth: float
    shoulder_offset: float
    elbow_offset: float


# Offsets [R Universal_Robots_ROS2_Description, config/*/physical_parameters.yaml].
SHAPES = {
    "ur3e": Shape(0.86, 0.120, 0.027),
    "ur5e": Shape(1.0, 0.138, 0.007),
    "ur10e": Shape(1.275, 0.1762, 0.0393),
}


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


def ur(arm: UrArm) -> SdfModel:
    """Return the model of an arm of the family."""
    g = SHAPES[arm.name].girth
    height = arm.d[0] - 0.0705 * g  # Of the base's tube.
    base = Inertia.of_cylinder(arm.base_mass, 0.0725 * g, height, (0, 0, height / 2))  # Shape [D].
    model = arm_skeleton(arm, base)
    for index, tube in enumerate(_tubes(arm)):
        _add_tube(model, tube, index)
    for index, (link, start, axis, radius) in enumerate(_lids(arm)):
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


def _lids(arm: UrArm) -> tuple[tuple[str, tuple[float, float, float], str, float], ...]:
    """Return the rounded lids on the blind ends of upper arm and forearm, at elbow and wrist."""
    shape = SHAPES[arm.name]
    g, side, elbow = shape.girth, shape.shoulder_offset, shape.elbow_offset
    return (
        ("upper_arm", (arm.a[1], 0, side + 0.056 * g), "+z", 0.054 * g),
        ("forearm", (arm.a[2], 0, elbow - 0.047 * g), "-z", 0.041 * g),
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
        ring = pointing(tube.axis, tube.start, tube.length - 0.0035)  # Protrudes from the end.
        model.visual(link, f"{name}_ring", cylinder(tube.radius + 0.0008, 0.008), DARK, ring)
    radius = tube.radius + tube.clearance
    long = tube.length > 4 * tube.radius
    hull = capsule(radius, tube.length) if long else cylinder(radius, tube.length)
    model.collision(link, name, hull, ARM_CONTACT, middle)
