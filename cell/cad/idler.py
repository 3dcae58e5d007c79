"""The product idler: a post with a shaft, the arm on it, two M3 x 10 bolts, and the tray.

Post and arm are drawn in the product frame A: origin on the shaft's axis at the post's upper face,
+z along the shaft. Boss, bore, thread and bolts have the sizes of the motor unit's: they are
standard sizes, and are defined there. Lengths in millimetres; all of the product's own are [A].
"""

from __future__ import annotations

from pathlib import Path

from manifold3d import Manifold

from cell.cad.motor_unit import (
    ALUMINIUM,
    ANODISED,
    BOLT_HOLE_RADIUS,
    BOSS_END,
    BOSS_RADIUS,
    EDGE_BREAK,
    FIT_FRICTION,
    METAL_DISSIPATION,
    METAL_MODULUS,
    MM,
    PLATE_THICKNESS,
    SEAT_DEPTH,
    SEAT_GAP,
    STEEL_GREY,
    THREAD_FACETS,
    THREAD_HOLE_DEPTH,
    bore_ring,
    bore_solid,
    boss_surface,
    box_piece,
    lumped_head_friction,
    mesh,
    upright_cylinder,
    washer_surface,
)
from cell.cad.sdf import Contact, Model, Piece, Visual, mesh_inertia, write_model
from cell.cad.shapes import boss, box, cylinder
from cell.cad.tray import BASE, BASE_GREY, NEST_TEAL, PLASTIC, PRINTED, bolt_nest

# The post is square: jaws and bed are in contact with flat sides.
POST_SIDE, POST_HEIGHT = 34.0, 50.0
SHAFT_RADIUS, SHAFT_END = 4.0, 24.0
TAP_DRILL_RADIUS = 1.25  # [R] ISO 2306 for M3 x 0.5.
# The arm, as thick as the motor's plate: the same bolts fit.
ARM_X, ARM_Y = 70.0, 40.0
BOLT_XY = ((13.0, 0.0), (-13.0, 0.0))
# Clearance of the face around the washers: the washers carry the clamp force, and the face keeps
# the arm from rocking on them.
FACE_GAP = 0.02
WINDOW_X, WINDOW_Y = 20.0, 12.0

# Places in the tray: the post stands, the arm lies on ledges.
POST_X, POST_Y = -70.0, 40.0
ARM_TRAY_X, ARM_TRAY_Y, ARM_TRAY_Z = 70.0, 40.0, 30.0
PLAY = 1.0  # Between a part and its stops.


def post_solid() -> Manifold:
    """Return the post in A [mm]."""
    half = POST_SIDE / 2
    post = box((-half, -half, -POST_HEIGHT), (half, half, 0))
    for x, y in BOLT_XY:
        hole = cylinder(TAP_DRILL_RADIUS, -THREAD_HOLE_DEPTH, 1.0, THREAD_FACETS)
        post -= hole.translate([x, y, 0])
    post += boss(BOSS_RADIUS, 0.0, BOSS_END, EDGE_BREAK)
    return post + boss(SHAFT_RADIUS, BOSS_END, SHAFT_END, EDGE_BREAK, 64)


def arm_solid() -> Manifold:
    """Return the arm in A [mm]."""
    top = PLATE_THICKNESS
    arm = box((-ARM_X / 2, -ARM_Y / 2, 0), (ARM_X / 2, ARM_Y / 2, top)) - bore_solid()
    for x, y in BOLT_XY:
        arm -= cylinder(BOLT_HOLE_RADIUS, -1, top + 1, 48).translate([x, y, 0])
    return arm


def post_pieces() -> list[Piece]:
    """Return the contact pieces of the post: its body for bed and jaws, its face for the arm."""
    metal = Contact(FIT_FRICTION, METAL_MODULUS, dissipation=METAL_DISSIPATION)
    half = POST_SIDE / 2
    # The pressure of a convex mesh grows evenly under the whole face.
    seat = mesh(box((-half, -half, -SEAT_DEPTH), (half, half, 0)))
    return [
        box_piece("bed_body", (-half, -half, -POST_HEIGHT), (half, half, -SEAT_GAP), Contact(0.9)),
        Piece("seat", seat, metal, convex=True),
        Piece("boss", boss_surface((0.0, 0.0)), metal, convex=True),
        upright_cylinder("shaft", SHAFT_RADIUS, 0, SHAFT_END, metal, hint=2.0),
    ]


def arm_pieces() -> list[Piece]:
    """Return the arm's contact pieces: bore, two washers, and boxes around them."""
    washer = Contact(lumped_head_friction())
    pieces = [Piece("bore", bore_ring((0.0, 0.0)), Contact(FIT_FRICTION))]
    for k, (x, y) in enumerate(BOLT_XY):
        pieces.append(Piece(f"washer_{k}", washer_surface((x * MM, y * MM)), washer))
    x, y, low, top = ARM_X / 2, ARM_Y / 2, FACE_GAP, PLATE_THICKNESS
    corners = {
        "bed_edge_left": ((-x, -y, low), (-WINDOW_X, y, top)),
        "bed_edge_right": ((WINDOW_X, -y, low), (x, y, top)),
        "bed_edge_far": ((-WINDOW_X, WINDOW_Y, low), (WINDOW_X, y, top)),
        "bed_edge_near": ((-WINDOW_X, -y, low), (WINDOW_X, -WINDOW_Y, top)),
    }
    boxes = [box_piece(name, *corner, Contact(0.8)) for name, corner in corners.items()]
    return [*pieces, *boxes]


def post_model() -> Model:
    """Return the post."""
    whole = mesh(post_solid())
    inertia = mesh_inertia(whole, ALUMINIUM * whole.volume, "idler_post")
    return Model("idler_post", inertia, post_pieces(), [Visual("post", whole, STEEL_GREY)], whole)


def arm_model() -> Model:
    """Return the arm."""
    whole = mesh(arm_solid())
    inertia = mesh_inertia(whole, ALUMINIUM * whole.volume, "idler_arm")
    return Model("idler_arm", inertia, arm_pieces(), [Visual("arm", whole, ANODISED)], whole)


def post_nest() -> list[Piece]:
    """Return four stops around the foot of the standing post."""
    x, y, out = POST_X, POST_Y, POST_SIDE / 2 + PLAY
    low, high, height = out, out + 4.0, 12.0
    return [
        box_piece("post_stop_left", (x - high, y - 8, 0), (x - low, y + 8, height), PLASTIC),
        box_piece("post_stop_right", (x + low, y - 8, 0), (x + high, y + 8, height), PLASTIC),
        box_piece("post_stop_near", (x - 8, y - high, 0), (x + 8, y - low, height), PLASTIC),
        box_piece("post_stop_far", (x - 8, y + low, 0), (x + 8, y + high, height), PLASTIC),
    ]


def arm_nest() -> list[Piece]:
    """Return two ledges under the arm and stops on four sides; below the bolts it is open."""
    x, y, z = ARM_TRAY_X, ARM_TRAY_Y, ARM_TRAY_Z
    out_x, out_y, top = ARM_X / 2 + PLAY, ARM_Y / 2 + PLAY, ARM_TRAY_Z + 3.0
    return [
        box_piece("arm_ledge_left", (x - 29.5, y - 18, 0), (x - 20.5, y + 18, z), PLASTIC),
        box_piece("arm_ledge_right", (x + 20.5, y - 18, 0), (x + 29.5, y + 18, z), PLASTIC),
        box_piece("arm_stop_left", (x - out_x - 4, y - 18, 0), (x - out_x, y - 9, top), PLASTIC),
        box_piece("arm_stop_right", (x + out_x, y - 18, 0), (x + out_x + 4, y - 9, top), PLASTIC),
        box_piece("arm_stop_near", (x - 15, y - out_y - 4, 0), (x + 15, y - out_y, top), PLASTIC),
        box_piece("arm_stop_far", (x - 15, y + out_y, 0), (x + 15, y + out_y + 4, top), PLASTIC),
    ]


def tray_model() -> Model:
    """Return the tray; the rails for bolts are those of the motor unit's tray."""
    x, y, height = BASE
    low, high = (-x / 2, -y / 2, -height), (x / 2, y / 2, 0.0)
    base = box_piece("base", low, high, PLASTIC)
    nests = [*post_nest(), *arm_nest(), *bolt_nest()]
    visuals = [Visual("base_look", base.shape, BASE_GREY, base.X_PS)]
    visuals += [Visual(f"{p.name}_look", p.shape, NEST_TEAL, p.X_PS) for p in nests]
    slab = mesh(box(low, high))
    inertia = mesh_inertia(slab, PRINTED * slab.volume, "idler_tray")
    return Model("idler_tray", inertia, [base, *nests], visuals)


def write_models(folder: Path) -> None:
    """Write idler_post, idler_arm and idler_tray into ``folder`` (``models/sdf``)."""
    for model in (post_model(), arm_model(), tray_model()):
        write_model(folder, model)
