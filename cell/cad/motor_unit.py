"""The product motor_unit: a gear motor, its L-shaped plate and the M3 x 10 bolts.

Frames: motor and plate are drawn in the product frame A (origin on the gearbox axis at the
gearbox's front face, +z along the shaft). The bolt's origin is the centre of the underside of its
head, +z from shank to head. Lengths are millimetres in the constants and metres in the functions.
Tags: [M] measured from public CAD, [D] derived, [A] assumed.
"""

from __future__ import annotations

from functools import reduce
from itertools import pairwise
from operator import add
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import Manifold
from pydrake.geometry import Box, Cylinder
from pydrake.math import RigidTransform

from cell.cad.sdf import Contact, Model, Piece, Visual, mesh_inertia, write_model
from cell.cad.shapes import (
    boss,
    box,
    cone,
    convex_revolve,
    cylinder,
    hexagon_prism,
    joined,
    open_band,
    revolved_surface,
    shank,
    to_trimesh,
    vertex_radius,
)

MM = 1e-3

# Motor [M]: axial coordinates from the gearbox's front face, + along the shaft.
GEARBOX_RADIUS, GEARBOX_BACK = 18.4, -24.0
CAN_RADIUS, CAN_BACK = 17.4, -53.4
SHAFT_Y = 7.0  # Shaft and boss are this far from the gearbox axis.
SHAFT_RADIUS, SHAFT_END = 3.0, 22.0
FLAT_START, FLAT_ACROSS = 10.0, 5.4
BOSS_END = 6.0
REAR_BOSS_RADIUS, REAR_BOSS_TIP_RADIUS, REAR_BOSS_BACK = 3.9, 3.5, -56.3
TERMINAL_XY, TERMINAL_BACK = (9.2, 6.45), -59.7
TERMINAL_WIDTH, TERMINAL_THICKNESS = 2.3, 0.8  # [M], thickness [A].
THREAD_HOLE_DEPTH = 6.5
MOTOR_MASS = 0.195  # kg, the 70:1 version without encoder.

# Fit of boss and bore [A]: nominally line to line in the CAD, 0.02 .. 0.15 mm in reality.
BOSS_RADIUS = 11.95 / 2
BORE_RADIUS = 12.10 / 2
EDGE_BREAK = 0.5  # [A] chamfer of the boss and of both ends of the bore.

# Plate [M].
PLATE_X, PLATE_Y_LOW, PLATE_Y_HIGH, PLATE_THICKNESS = 35.0, -33.0, 27.0, 5.0
FOOT_THICKNESS, FOOT_BOTTOM = 5.0, -15.0
FOOT_HOLE_RADIUS, FOOT_HOLE_X, FOOT_HOLE_Z = 2.25, 29.0, -10.0
BOLT_HOLE_RADIUS = 1.7
BOLT_HOLE_EDGE = 0.2  # [A] deburred; contact begins outside of it.
WASHER_RADIUS = 3.4  # [D] of the clamped area; at 3.5 it would fill the chamfer of the bore.
ALUMINIUM = 2700.0  # kg/m3; the material is not in the files [A].

# Bolts: six, every 60 degrees about the gearbox axis [M]; socket head cap screw.
BOLT_CIRCLE = 15.5
BOLT_ANGLES_DEG = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)
THREAD_RADIUS, BOLT_LENGTH, TIP_CHAMFER = 1.5, 10.0, 0.3
HEAD_RADIUS, HEAD_HEIGHT = 2.75, 3.0
BEARING_RADIUS = 2.5  # [R] ISO 4762: 2.53 or more; reduced for the corners of a hexagon.
SOCKET_FLATS, SOCKET_DEPTH = 2.5, 2.0  # [M] 1.3 to 2 mm deep; 2 gives the measured volume.
THREAD_PITCH = 0.5
STEEL = 7850.0  # kg/m3

THREAD_FACETS = 32  # Shared by shank and hole, so that they touch line to line when assembled.
CAN_FACETS = 16  # With fewer the holding torque depends on the corners [M].
BORE_FACETS = 64  # Sagitta 7 micrometres against 75 of clearance.

# Contact [D]: softer metal would let a misplaced boss squeeze into the hole at tens of newtons.
METAL_MODULUS = 1e10  # Pa
# Metal rebounds from metal at no more than 1/d = 2 mm/s [A]: less than gravity adds in a step of
# 1 ms. With the 10 s/m of softer materials a part bounces on its stiff seat for ever [M].
METAL_DISSIPATION = 500.0  # s/m
FIT_FRICTION = 0.2  # [A] steel on aluminium, dry.
NUT_FACTOR = 0.202  # [D] K of T = K d F for mu = 0.14 in thread and under the head.

STEEL_GREY, ZINC, BRASS = (0.55, 0.56, 0.60), (0.74, 0.75, 0.77), (0.80, 0.62, 0.25)
ANODISED, BLACK_OXIDE, DARK = (0.62, 0.70, 0.80), (0.16, 0.16, 0.18), (0.28, 0.28, 0.30)


# Contact meshes [M]: a step costs about 8 us for every contact polygon.
BOSS_FACETS = 32  # Mean radius is kept; corners and flats differ by 14 um of 75 um clearance.
WASHER_FACETS, HOLE_FACETS = 6, 8
# The gearbox has two contact pieces: its face, compliant, for the plate; its side, rigid, for bed
# and jaws.
# Under a bolt the face yields like the clamped aluminium, 3.5e8 N/m [D]: a modulus of 1e10 over
# half of this depth on 27 mm2. The head likewise stands for bolt and head, about 1e8 N/m [D].
SEAT_FACETS, SEAT_DEPTH, SEAT_GAP = 8, 1.5, 0.2
HEAD_FACETS = 12  # A flat under each of the jaws, for grasps every 30 degrees.
HEAD_STIFFNESS = 1e8  # N/m


def lumped_head_friction() -> float:
    """Return the friction under the head that alone gives the nut factor K.

    K d = P / (2 pi) + mu r_eff, with the effective radius r_eff of the bearing annulus of the head:
    the thread itself is simulated without friction.
    """
    r_eff = friction_radius(BEARING_RADIUS, BOLT_HOLE_RADIUS + BOLT_HOLE_EDGE, WASHER_FACETS)
    return (NUT_FACTOR * 2.0 * THREAD_RADIUS - THREAD_PITCH / (2.0 * np.pi)) / r_eff


def friction_radius(outer: float, inner: float, facets: int) -> float:
    """Return the mean distance from the axis over a ring of two polygons of given mean radii.

    [D] Over a polygon with apothem a and half angle h of a facet the integral of r is
    n a^3 / 3 (sec h tan h + arsinh tan h), and the area n a^2 tan h; 2/3 of the radius for many
    facets.
    """
    half = np.pi / facets
    apothem = vertex_radius(1.0, facets) * np.cos(half)
    share = apothem / 3.0 * (1.0 / np.cos(half) + np.arcsinh(np.tan(half)) / np.tan(half))
    return share * (outer**3 - inner**3) / (outer**2 - inner**2)


def bolt_xy() -> list[tuple[float, float]]:
    """Return the centres of the six bolts in A [mm]."""
    angles = np.deg2rad(BOLT_ANGLES_DEG)
    return [(BOLT_CIRCLE * np.cos(a), BOLT_CIRCLE * np.sin(a)) for a in angles]


def motor_solids() -> dict[str, Manifold]:
    """Return the motor by material, disjoint, in A [mm]."""
    holes = [
        cylinder(THREAD_RADIUS, -THREAD_HOLE_DEPTH, 1.0, THREAD_FACETS).translate([x, y, 0])
        for x, y in bolt_xy()
    ]
    gearbox = cylinder(GEARBOX_RADIUS, GEARBOX_BACK, 0.0) - reduce(add, holes)
    can = cylinder(CAN_RADIUS, CAN_BACK, GEARBOX_BACK)
    can += cone(REAR_BOSS_TIP_RADIUS, REAR_BOSS_RADIUS, REAR_BOSS_BACK, CAN_BACK, 48)
    nose = boss(BOSS_RADIUS, 0.0, BOSS_END, EDGE_BREAK).translate([0, SHAFT_Y, 0])
    shaft = boss(SHAFT_RADIUS, BOSS_END, SHAFT_END, EDGE_BREAK, 64).translate([0, SHAFT_Y, 0])
    flat_y = SHAFT_Y + FLAT_ACROSS - SHAFT_RADIUS
    shaft -= box((-4, flat_y, FLAT_START), (4, flat_y + 4, SHAFT_END + 1))
    terminals = _terminal() + _terminal().rotate([0, 0, 180])
    return {"gearbox": gearbox, "can": can, "shaft": nose + shaft, "terminals": terminals}


def _terminal() -> Manifold:
    """Return one solder lug, broad side facing the axis [mm]."""
    radius = float(np.hypot(*TERMINAL_XY))
    angle = float(np.rad2deg(np.arctan2(TERMINAL_XY[1], TERMINAL_XY[0])))
    half_width, half_thickness = TERMINAL_WIDTH / 2, TERMINAL_THICKNESS / 2
    lug = box(
        (radius - half_thickness, -half_width, TERMINAL_BACK),
        (radius + half_thickness, half_width, CAN_BACK),
    )
    return lug.rotate([0, 0, angle])


def plate_solid() -> Manifold:
    """Return the plate in A [mm]; its foot hangs towards the motor."""
    top, bottom = PLATE_THICKNESS, FOOT_BOTTOM
    plate = box((-PLATE_X, PLATE_Y_LOW, 0), (PLATE_X, PLATE_Y_HIGH, top))
    plate += box((-PLATE_X, PLATE_Y_LOW, bottom), (PLATE_X, PLATE_Y_LOW + FOOT_THICKNESS, top))
    plate -= bore_solid().translate([0, SHAFT_Y, 0])
    for x, y in bolt_xy():
        plate -= cylinder(BOLT_HOLE_RADIUS, -1, top + 1, 48).translate([x, y, 0])
    for x in (-FOOT_HOLE_X, FOOT_HOLE_X):
        hole = cylinder(FOOT_HOLE_RADIUS, -10, 10, 48).rotate([90, 0, 0])
        plate -= hole.translate([x, PLATE_Y_LOW, FOOT_HOLE_Z])
    return plate


def bore_solid() -> Manifold:
    """Return the volume that the bore removes from a plate, about the z axis [mm]."""
    wide, top = BORE_RADIUS + EDGE_BREAK, PLATE_THICKNESS
    bore = cylinder(BORE_RADIUS, -1, top + 1, BORE_FACETS)
    bore += cone(wide + 1, wide - EDGE_BREAK, -1, EDGE_BREAK, BORE_FACETS)
    return bore + cone(wide - EDGE_BREAK, wide + 1, top - EDGE_BREAK, top + 1, BORE_FACETS)


def bolt_solid() -> Manifold:
    """Return the bolt in its own frame [mm]."""
    bolt = shank(THREAD_RADIUS, -BOLT_LENGTH, 0.0, TIP_CHAMFER, THREAD_FACETS)
    bolt += cylinder(HEAD_RADIUS, 0.0, HEAD_HEIGHT, 64)
    return bolt - hexagon_prism(SOCKET_FLATS, HEAD_HEIGHT - SOCKET_DEPTH, HEAD_HEIGHT + 1)


def motor_pieces() -> list[Piece]:
    """Return the motor's contact pieces.

    Rear boss and terminals have none: they sink into the beads, which are in contact with their
    real surface (`cell.fixtures.soft_jig.frozen.pins`), and nothing else ever reaches them.
    """
    metal = Contact(FIT_FRICTION, METAL_MODULUS, dissipation=METAL_DISSIPATION)
    return [
        Piece("bed_can", _can_surface(), Contact(0.9)),
        Piece(
            "bed_gearbox", _prism(CAN_FACETS, GEARBOX_BACK, -SEAT_GAP), Contact(0.9), convex=True
        ),
        # The pressure of a convex solid grows evenly under the whole face, and few tetrahedra touch
        # the plate.
        Piece("seat", _prism(SEAT_FACETS, -SEAT_DEPTH, 0.0), metal, convex=True),
        Piece("boss", boss_surface((0, SHAFT_Y * MM)), metal, convex=True),
        upright_cylinder("shaft", SHAFT_RADIUS, 0, SHAFT_END, metal, hint=2.0, y=SHAFT_Y),
    ]


def boss_surface(center: tuple[float, float]) -> trimesh.Trimesh:
    """Return the boss about an axis, extended 1 mm into its base [m]."""
    side = [(BOSS_RADIUS, -1.0), (BOSS_RADIUS, BOSS_END - EDGE_BREAK)]
    outline = [*side, (BOSS_RADIUS - EDGE_BREAK, BOSS_END)]
    return convex_revolve(_mm(outline), BOSS_FACETS, center)


def _can_surface() -> trimesh.Trimesh:
    """Return side and rear face of the can [m]; the rear face has every other corner of the side.

    The bed conforms to the side facet by facet. On the flat rear face few, large triangles carry as
    well as many, at a fifth of the cost; the omitted segments are a few % of its area.
    """
    angle = 2.0 * np.pi * (np.arange(CAN_FACETS) + 0.5) / CAN_FACETS
    radius = vertex_radius(CAN_RADIUS, CAN_FACETS)
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    points = [np.column_stack([ring, np.full(CAN_FACETS, z)]) for z in (CAN_BACK, GEARBOX_BACK)]
    here, beside = np.arange(CAN_FACETS), (np.arange(CAN_FACETS) + 1) % CAN_FACETS
    side = [
        np.column_stack([here, beside, beside + CAN_FACETS]),
        np.column_stack([here, beside + CAN_FACETS, here + CAN_FACETS]),
    ]
    corners = here[::2]
    face = np.array([[corners[0], j, i] for i, j in pairwise(corners[1:])])
    return trimesh.Trimesh(
        MM * np.concatenate(points), np.concatenate([*side, face]), process=False
    )


def _prism(facets: int, low: float, high: float) -> trimesh.Trimesh:
    """Return the gearbox as a prism between two heights [mm]."""
    outline = [(GEARBOX_RADIUS, low), (GEARBOX_RADIUS, high)]
    return convex_revolve(_mm(outline), facets, phase=0.5)


def plate_pieces() -> list[Piece]:
    """Return the plate's contact pieces: a ring, six washers, and boxes for hand, bed and tray.

    The ring's underside is 0.1 mm above the plate's, so that the washers alone carry the face.
    """
    washer = Contact(lumped_head_friction())
    pieces = [Piece("bore", bore_ring((0, SHAFT_Y * MM)), Contact(FIT_FRICTION))]
    for k, (x, y) in enumerate(bolt_xy()):
        pieces.append(Piece(f"washer_{k}", washer_surface((x * MM, y * MM)), washer))
    return pieces + _plate_boxes()


def washer_surface(center: tuple[float, float]) -> trimesh.Trimesh:
    """Return the contact surface around a bolt's hole [m]: under the head, on the seat, the wall.

    The wall ends short of both faces: where they are compressed by micrometres it would only add
    cost. Half a facet of phase keeps its corners inside the flats of the faces, whose edges would
    otherwise cut into a tilted shank and lift it.
    """
    inner, top = BOLT_HOLE_RADIUS + BOLT_HOLE_EDGE, PLATE_THICKNESS
    head = [(BEARING_RADIUS, top), (inner, top)]
    wall = [(BOLT_HOLE_RADIUS, top - BOLT_HOLE_EDGE), (BOLT_HOLE_RADIUS, BOLT_HOLE_EDGE)]
    seat = [(inner, 0.0), (WASHER_RADIUS, 0.0)]
    bands = [open_band(_mm(line), WASHER_FACETS, center) for line in (head, seat)]
    bands.append(open_band(_mm(wall), HOLE_FACETS, center, phase=0.5))
    return joined(bands)


# Edges of the ring's section in contact: the chamfers and the bore itself.
BORE_CONTACT_EDGES = 4


def bore_ring(center: tuple[float, float]) -> trimesh.Trimesh:
    """Return the wall of the bore about an axis [m]; rows of triangles are as tall as wide."""
    gap, outer, top = 0.1, 7.2, PLATE_THICKNESS
    wide = BORE_RADIUS + EDGE_BREAK
    inner = [(BORE_RADIUS, top - EDGE_BREAK), (BORE_RADIUS, top / 2), (BORE_RADIUS, EDGE_BREAK)]
    profile = [(wide, top), *inner, (wide - gap, gap), (outer, gap), (outer, top)]
    ring = revolved_surface(_mm(profile), BORE_FACETS, center)
    kept = np.tile(np.repeat(np.arange(len(profile)) < BORE_CONTACT_EDGES, BORE_FACETS), 2)
    ring.update_faces(kept)
    return ring


def _plate_boxes() -> list[Piece]:
    """Return boxes that fill the plate outside a 40 x 39 mm window, and the foot."""
    inner_x, inner_y, top = 20.0, 19.5, PLATE_THICKNESS
    foot_y = PLATE_Y_LOW + FOOT_THICKNESS
    corners = {
        "bed_edge_left": ((-PLATE_X, foot_y, 0), (-inner_x, PLATE_Y_HIGH, top)),
        "bed_edge_right": ((inner_x, foot_y, 0), (PLATE_X, PLATE_Y_HIGH, top)),
        "bed_edge_far": ((-inner_x, inner_y, 0), (inner_x, PLATE_Y_HIGH, top)),
        "bed_edge_near": ((-inner_x, foot_y, 0), (inner_x, -inner_y, top)),
        "bed_foot": ((-PLATE_X, PLATE_Y_LOW, FOOT_BOTTOM), (PLATE_X, foot_y, top)),
    }
    return [box_piece(name, low, high, Contact(0.8)) for name, (low, high) in corners.items()]


def bolt_pieces() -> list[Piece]:
    """Return the bolt's contact pieces."""
    # The pressure of a convex solid grows evenly from its underside to its middle.
    bearing = np.pi * (BEARING_RADIUS**2 - (BOLT_HOLE_RADIUS + BOLT_HOLE_EDGE) ** 2) * MM**2
    modulus = HEAD_STIFFNESS * HEAD_HEIGHT / 2 * MM / bearing
    head = Contact(lumped_head_friction(), modulus, dissipation=METAL_DISSIPATION)
    thread = Contact(FIT_FRICTION, 1e9, dissipation=METAL_DISSIPATION)
    crown = _mm([(HEAD_RADIUS, 0.0), (HEAD_RADIUS, HEAD_HEIGHT)])
    body = _mm([(THREAD_RADIUS - TIP_CHAMFER, -BOLT_LENGTH)])
    body += _mm([(THREAD_RADIUS, -BOLT_LENGTH + TIP_CHAMFER), (THREAD_RADIUS, 0.0)])
    return [
        Piece("head", convex_revolve(crown, HEAD_FACETS, phase=0.5), head, convex=True),
        Piece("shank", convex_revolve(body, 8), thread, convex=True),
    ]


def box_piece(
    name: str, low: tuple[float, ...], high: tuple[float, ...], contact: Contact
) -> Piece:
    """Return a box between two corners [mm]."""
    size, center = np.subtract(high, low) * MM, np.add(high, low) * MM / 2
    return Piece(name, Box(*size), contact, RigidTransform(center))


def upright_cylinder(
    name: str, radius: float, low: float, high: float, contact: Contact, hint: float, y: float = 0
) -> Piece:
    """Return an upright cylinder about (0, y) [mm] with a mesh hint [mm]."""
    touch = Contact(contact.friction, contact.modulus, hint * MM, contact.dissipation)
    center = np.array([0.0, y, (low + high) / 2]) * MM
    return Piece(name, Cylinder(radius * MM, (high - low) * MM), touch, RigidTransform(center))


def _mm(profile: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return a profile in metres."""
    return [(r * MM, z * MM) for r, z in profile]


def mesh(solid: Manifold) -> trimesh.Trimesh:
    """Return a solid drawn in millimetres as a surface in metres."""
    return to_trimesh(solid.scale([MM, MM, MM]))


def motor_model() -> Model:
    """Return the motor; its density is uniform."""
    solids = motor_solids()
    colors = {"gearbox": STEEL_GREY, "can": ZINC, "shaft": DARK, "terminals": BRASS}
    whole = mesh(reduce(add, solids.values()))
    visuals = [Visual(name, mesh(solid), colors[name]) for name, solid in solids.items()]
    inertia = mesh_inertia(whole, MOTOR_MASS, "motor")
    return Model("motor", inertia, motor_pieces(), visuals, whole)


def plate_model() -> Model:
    """Return the plate."""
    whole = mesh(plate_solid())
    inertia = mesh_inertia(whole, ALUMINIUM * whole.volume, "motor_plate")
    visual = Visual("plate", whole, ANODISED)
    return Model("motor_plate", inertia, plate_pieces(), [visual], whole)


def bolt_model() -> Model:
    """Return the bolt."""
    whole = mesh(bolt_solid())
    inertia = mesh_inertia(whole, STEEL * whole.volume, "bolt_m3x10")
    visual = Visual("bolt", whole, BLACK_OXIDE)
    return Model("bolt_m3x10", inertia, bolt_pieces(), [visual], whole)


def write_models(folder: Path) -> None:
    """Write motor, motor_plate and bolt_m3x10 into ``folder`` (``models/sdf``)."""
    for model in (motor_model(), plate_model(), bolt_model()):
        write_model(folder, model)
