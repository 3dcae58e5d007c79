"""SDF models of the static furniture: table, riser, force plate and the base of the jig.

Each model has one link. The table's origin is the centre of its top face; riser, force plate and
jig base share the jig frame J (centre of the base plate's top face, +z up), so that one pose places
the whole stack. The riser is as high as J is above the table. The builder welds them: static
geometry must never belong to the world body, on which contact with locked parts crashes Drake 1.51
[M].

Sources: [S] the paper; [D] derived from it; [A] assumption. All lengths in metres.
"""

from __future__ import annotations

import math
from pathlib import Path

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
)
from cell.fixtures.jig_dimensions import (
    APERTURE_DIAMETER,
    BASE_DIAMETER,
    BASE_HEIGHT,
    BEAD_MASS,
    J_HEIGHT,
    JIG_MASS,
    SCREW_CIRCLE_RADIUS,
)

ALUMINIUM: Color = (0.66, 0.67, 0.69)
PROFILE: Color = (0.50, 0.52, 0.54)
STEEL: Color = (0.40, 0.41, 0.43)
DARK: Color = (0.20, 0.21, 0.22)
TOP: Color = (0.62, 0.58, 0.50)

CORNERS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
TABLE_SIZE = (1.8, 1.2, 0.05)  # [A]
TABLE_HEIGHT = 0.75  # Above the floor; visual only [A].
FORCE_PLATE_SIZE = (0.30, 0.30, 0.035)  # [A] a common size.
RIM_HEIGHT = 0.006  # [A]
FORCE_PLATE_TOP = -BASE_HEIGHT  # In J.
RISER_TOP = FORCE_PLATE_TOP - FORCE_PLATE_SIZE[2]
RISER_SIZE = (0.26, 0.26, J_HEIGHT + RISER_TOP)

# Rigid: every part that is set down has a compliant side. Friction of metal on metal [A].
STATIC_CONTACT = LinkContact("rigid", friction=0.3, hint=0.05)
# Compliant, so that a sliding jig rests on an area instead of a point; its joint with the force
# plate is softer, see `cell.machines.jig_base.stand_on`. Thirteen sectors: with three it tips over
# the edges of a triangle [M]. Friction 0.3 [A].
JIG_CONTACT = LinkContact("compliant", friction=0.3, modulus=1e8, dissipation=100.0, hint=0.04)


def table() -> SdfModel:
    """Return the table: a thick top on a frame of profiles."""
    x, y, z = TABLE_SIZE
    model = _slab("table", TABLE_SIZE, mass=80.0)
    model.visual("table", "top", box(x, y, z - 0.004), PROFILE, Pose(z=-z / 2 - 0.002))
    model.visual("table", "sheet", box(x, y, 0.004), TOP, Pose(z=-0.002))
    height = TABLE_HEIGHT - z
    for i, (sx, sy) in enumerate(CORNERS):
        corner = Pose(sx * (x / 2 - 0.06), sy * (y / 2 - 0.06), -z - height / 2)
        model.visual("table", f"leg_{i}", box(0.08, 0.08, height), PROFILE, corner)
        foot = Pose(corner.x, corner.y, 0.01 - TABLE_HEIGHT)
        model.visual("table", f"foot_{i}", cylinder(0.055, 0.02), DARK, foot)
    for i, side in enumerate((1, -1)):
        long, short = box(x - 0.12, 0.05, 0.05), box(0.05, y - 0.12, 0.05)
        model.visual("table", f"rail_{i}", long, PROFILE, Pose(y=side * (y / 2 - 0.06), z=-0.6))
        model.visual("table", f"tie_{i}", short, PROFILE, Pose(x=side * (x / 2 - 0.06), z=-0.6))
    return model


def riser() -> SdfModel:
    """Return the riser: two plates on four posts."""
    x, y, z = RISER_SIZE
    model = _slab("riser", RISER_SIZE, mass=8.0, top=RISER_TOP)
    for name, height in (("top", -0.006), ("bottom", 0.006 - z)):
        model.visual("riser", name, box(x, y, 0.012), ALUMINIUM, Pose(z=RISER_TOP + height))
    for i, (sx, sy) in enumerate(CORNERS):
        post = Pose(sx * (x / 2 - 0.03), sy * (y / 2 - 0.03), RISER_TOP - z / 2)
        model.visual("riser", f"post_{i}", box(0.045, 0.045, z - 0.024), PROFILE, post)
    return model


def force_plate() -> SdfModel:
    """Return the force plate: two aluminium plates with a load cell in each corner."""
    x, y, z = FORCE_PLATE_SIZE
    top = FORCE_PLATE_TOP
    model = _slab("force_plate", FORCE_PLATE_SIZE, mass=5.0, top=top)
    model.visual("force_plate", "top", box(x, y, 0.014), ALUMINIUM, Pose(z=top - 0.007))
    model.visual("force_plate", "bottom", box(x, y, 0.008), ALUMINIUM, Pose(z=top + 0.004 - z))
    for i, (sx, sy) in enumerate(CORNERS):
        cell = Pose(sx * (x / 2 - 0.03), sy * (y / 2 - 0.03), top - 0.0205)
        model.visual("force_plate", f"cell_{i}", cylinder(0.018, 0.013), DARK, cell)
        screw = Pose(cell.x, cell.y, top)
        model.visual("force_plate", f"screw_{i}", cylinder(0.006, 0.001), STEEL, screw)
    return model


def jig_base() -> SdfModel:
    """Return the jig's base plate; its link frame is the jig frame J.

    The clamping rim and its four screws at 90 deg [S] are visual only: nothing reaches them but the
    bag, which is part of the soft jig.
    """
    radius, aperture = BASE_DIAMETER / 2, APERTURE_DIAMETER / 2
    model = SdfModel("jig_base")
    mass, middle = JIG_MASS - BEAD_MASS, (0, 0, -BASE_HEIGHT / 2)
    model.link("jig_base", LinkInertia.of_cylinder(mass, radius, BASE_HEIGHT, middle))
    body = model.mesh("body", rounded_cylinder(radius, BASE_HEIGHT - RIM_HEIGHT, 0.0005))
    model.visual("jig_base", "body", body, DARK, Pose(z=-BASE_HEIGHT))
    floor = cylinder(aperture, RIM_HEIGHT - 0.0005)
    model.visual("jig_base", "floor", floor, DARK, Pose(z=-RIM_HEIGHT / 2 - 0.00025))
    rim = trimesh.creation.annulus(aperture, radius, RIM_HEIGHT, sections=96)
    model.visual("jig_base", "rim", model.mesh("rim", rim), ALUMINIUM, Pose(z=-RIM_HEIGHT / 2))
    for i in range(4):
        angle, r = math.pi / 4 + i * math.pi / 2, SCREW_CIRCLE_RADIUS
        x, y = r * math.cos(angle), r * math.sin(angle)
        model.visual("jig_base", f"screw_{i}", cylinder(0.0045, 0.001), STEEL, Pose(x, y, 0))
        model.visual("jig_base", f"socket_{i}", cylinder(0.002, 0.0012), DARK, Pose(x, y, 0))
    port = cylinder(0.005, 0.03)
    side = Pose(x=-radius - 0.01, z=-BASE_HEIGHT / 2 - 0.003, pitch=math.pi / 2)
    model.visual("jig_base", "vacuum_port", port, STEEL, side)
    hull = cylinder(radius, BASE_HEIGHT)
    model.collision("jig_base", "base", hull, JIG_CONTACT, Pose(z=-BASE_HEIGHT / 2))
    return model


def _slab(name: str, size: tuple[float, float, float], mass: float, top: float = 0.0) -> SdfModel:
    """Return a model with one link and one collision box whose top face is at z = ``top``."""
    model = SdfModel(name)
    middle = top - size[2] / 2
    model.link(name, LinkInertia.of_box(mass, size, (0, 0, middle)))
    model.collision(name, name, box(*size), STATIC_CONTACT, Pose(z=middle))
    return model


def write_models(folder: Path) -> None:
    """Write table, riser, force_plate and jig_base into ``folder`` (models/sdf)."""
    for model in (table(), riser(), force_plate(), jig_base()):
        model.write(folder)
