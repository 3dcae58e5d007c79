"""SDF of the electric driver: an inline driver held by a general-purpose gripper on the flange.

The gripper that holds the driver never opens, so it and the housing are one rigid ``body``. The
bit holder floats on two lateral slides and one axial slide with springs, like the heads of
screwdriving robots; the ``bit`` turns in it on ``spindle_joint`` about +z of ``mount``. The last
10 mm of the bit have no collision shape here: bit and socket are joined by a constraint when they
meet within their tolerances, and contact of the hex inside the socket would push the bolt around.
The cell adds one that is switched off there (``cell.workpieces.bit_end``).

Sources: lengths and masses [A], chosen so that the bit passes between bolt heads and motor shaft;
hex size 2.5 mm for M3 [R ISO 4762]. All lengths in metres.
"""

from __future__ import annotations

import math

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

BLACK: Color = (0.13, 0.13, 0.14)
GREEN: Color = (0.05, 0.42, 0.36)
STEEL: Color = (0.60, 0.61, 0.63)

BIT_TIP_Z = 0.280
SHAFT_LENGTH, SHAFT_RADIUS = 0.045, 0.002
NOSE_LENGTH, NOSE_RADIUS = 0.030, 0.009
HOUSING_RADIUS = 0.018
SHAFT_Z = BIT_TIP_Z - SHAFT_LENGTH  # Where the shaft begins.
NOSE_Z = SHAFT_Z - NOSE_LENGTH
HOUSING_Z = 0.085
BARE_END = 0.010  # End of the bit without a collision shape.
HEX_FLATS, HEX_LENGTH = 0.0025, 0.014

HOLDER_LENGTH, HOLDER_RADIUS, HOLDER_MASS = 0.095, 0.0375, 0.9
DRIVER_MASS = 0.45
BIT_MASS = 0.010
# Floating bit holder [A]: travel of commercial compliant heads is a few millimetres.
FLOAT_MASS = 0.020  # Of each slide.
FLOATS = (
    ("x", (1.0, 0.0, 0.0), 0.002),
    ("y", (0.0, 1.0, 0.0), 0.002),
    ("z", (0.0, 0.0, 1.0), 0.010),
)
FLOAT_EFFORT = 50.0  # Of the springs [N].
# Rotor and gear train seen at the spindle [A]: a 20 W driver motor of 1e-7 kg m2 behind 10:1.
SPINDLE_INERTIA = 1e-5
SPINDLE_EFFORT = 1.0  # [N m]; the clutch acts below it.
SPINDLE_SPEED = 105.0  # [rad/s], 1000 rpm.
SPINDLE_DAMPING = 1e-4  # [N m s/rad]
CONTACT = LinkContact("point", friction=0.3)


def screwdriver() -> SdfModel:
    """Return the model; the origin of ``body`` is ``mount``."""
    model = SdfModel("screwdriver")
    _add_body(model)
    _add_bit(model)
    model.frame("mount", "body")
    model.frame("bit_tip", "bit", Pose(z=SHAFT_LENGTH))
    # The end of the bit at rest: the arm aims with this frame, which does not turn.
    model.frame("tool_tip", "body", Pose(z=BIT_TIP_Z))
    model.ignore_contact_between("driver", ["body", "bit"])
    return model


def _add_body(model: SdfModel) -> None:
    driver_z = (HOUSING_Z + SHAFT_Z) / 2
    mass = HOLDER_MASS + DRIVER_MASS
    com = (HOLDER_MASS * HOLDER_LENGTH / 2 + DRIVER_MASS * driver_z) / mass
    model.link("body", LinkInertia.of_cylinder(mass, 0.030, SHAFT_Z, (0, 0, com)))
    holder = model.mesh("holder", rounded_cylinder(HOLDER_RADIUS, HOLDER_LENGTH, 0.008))
    model.visual("body", "holder", holder, BLACK)
    model.visual("body", "coupler", cylinder(0.0378, 0.011), STEEL, Pose(z=0.0055))
    length, r = NOSE_Z - HOUSING_Z, HOUSING_RADIUS
    # The housing has a waist at the grip and a shoulder towards the nose.
    grip = [(r, 0.062), (r - 0.002, 0.066), (r - 0.002, length - 0.022), (r, length - 0.018)]
    end = [(r, length - 0.008), (NOSE_RADIUS + 0.001, length), (0.0, length)]
    housing = model.mesh("housing", turned([(0.0, 0.0), (r, 0.0), *grip, *end]))
    model.visual("body", "housing", housing, GREEN, Pose(z=HOUSING_Z))
    tip = [(NOSE_RADIUS, NOSE_LENGTH - 0.010), (NOSE_RADIUS - 0.004, NOSE_LENGTH)]
    nose = model.mesh("nose", turned([(0, 0), (NOSE_RADIUS, 0), *tip, (0, NOSE_LENGTH)]))
    model.visual("body", "nose", nose, STEEL, Pose(z=NOSE_Z))
    model.visual("body", "collar", cylinder(0.0186, 0.006), BLACK, Pose(z=NOSE_Z - 0.012))
    for side, sign in (("left", 1), ("right", -1)):
        jaw, arm = Pose(sign * 0.023, 0, 0.122), Pose(sign * 0.027, 0, 0.100)
        model.visual("body", f"jaw_{side}", box(0.010, 0.024, 0.040), STEEL, jaw)
        model.visual("body", f"arm_{side}", box(0.014, 0.020, 0.020), BLACK, arm)
    _hull(model, "holder", HOLDER_RADIUS, 0.0, HOLDER_LENGTH)
    _hull(model, "housing", HOUSING_RADIUS + 0.001, HOUSING_Z, length)
    _hull(model, "nose", NOSE_RADIUS, NOSE_Z, NOSE_LENGTH)
    model.collision("body", "jaws", box(0.068, 0.026, 0.054), CONTACT, Pose(z=0.117))


def _hull(model: SdfModel, name: str, radius: float, start: float, length: float) -> None:
    """Add a collision cylinder of ``body`` that begins at ``start`` on z."""
    model.collision("body", name, cylinder(radius, length), CONTACT, Pose(z=start + length / 2))


def _add_bit(model: SdfModel) -> None:
    """Add the bit; its link frame is where the shaft leaves the nose."""
    shaft = LinkInertia.of_cylinder(BIT_MASS, SHAFT_RADIUS, SHAFT_LENGTH, (0, 0, SHAFT_LENGTH / 2))
    model.link("bit", shaft, parent="body", pose=Pose(z=SHAFT_Z))
    model.joint(
        "spindle_joint",
        "continuous",
        _add_floats(model),
        "bit",
        velocity=SPINDLE_SPEED,
        effort=SPINDLE_EFFORT,
        damping=SPINDLE_DAMPING,
        extra=[tag("drake:rotor_inertia", SPINDLE_INERTIA), tag("drake:gear_ratio", 1.0)],
    )
    round_length = SHAFT_LENGTH - HEX_LENGTH
    round_part = cylinder(SHAFT_RADIUS, round_length)
    model.visual("bit", "shaft", round_part, STEEL, Pose(z=round_length / 2))
    corner = HEX_FLATS / 2 / math.cos(math.pi / 6)
    hexagon = trimesh.creation.cylinder(corner, HEX_LENGTH, sections=6)
    model.visual("bit", "hex", model.mesh("hex", hexagon), STEEL, Pose(z=SHAFT_LENGTH - 0.007))
    covered = SHAFT_LENGTH - BARE_END
    model.collision("bit", "shaft", cylinder(SHAFT_RADIUS, covered), CONTACT, Pose(z=covered / 2))


def _add_floats(model: SdfModel) -> str:
    """Add the slides of the bit holder; return the last link of the chain."""
    parent = "body"
    for name, axis, travel in FLOATS:
        link = f"float_{name}"
        inertia = LinkInertia.of_cylinder(FLOAT_MASS, NOSE_RADIUS, NOSE_LENGTH, (0, 0, 0))
        model.link(link, inertia, parent="body", pose=Pose(z=SHAFT_Z))
        model.joint(
            f"float_{name}_joint",
            "prismatic",
            parent,
            link,
            axis=axis,
            position=(-travel, travel),
            velocity=1.0,
            effort=FLOAT_EFFORT,
            damping=0.0,
        )
        parent = link
    return parent
