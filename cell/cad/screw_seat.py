"""The face of a clamped part around a screw's hole: what bears the screw's clamp force.

A part of the simulation does not bend. Where it bears only beside its screws, the first one that is
tightened tips it over the edge of what bears, and the next one levers it back, which changes the
clamp force of the first by a third; a real plate bends by micrometres instead. Lengths in
millimetres.
"""

from __future__ import annotations

from manifold3d import Manifold

from cell.cad.convex_pieces import convex_pieces
from cell.cad.motor_unit import BOLT_HOLE_EDGE, SEAT_DEPTH
from cell.cad.round_features import Cylinder

SIDES = 4  # Of the opening for the shank: each side becomes a piece.
SHARE = 0.4  # [A] Of the thickness, at most: the wall of the hole is another piece's.


def screw_seat(solid: Manifold, window: Manifold, towards_head: Cylinder) -> list[Manifold]:
    """Return the lowest layer of a clamped part between a screw's hole and its window.

    Pressure grows over half the depth of a piece, which therefore decides how stiff it is: see
    `cell.cad.motor_unit.SEAT_DEPTH`.

    Args:
        solid: The part, its holes filled [mm].
        window: Around the hole, where the part has no other contact piece [mm].
        towards_head: The hole; its axis points to the screw's head [mm].
    """
    (mouth, bottom), (_, top) = towards_head.flare_low, towards_head.flare_high
    depth = min(SEAT_DEPTH, SHARE * (top - bottom))
    wide = 10.0 * (mouth + depth)
    layer = Manifold.cylinder(depth, wide, -1.0, SIDES)
    opening = Manifold.cylinder(
        3.0 * depth, (mouth + BOLT_HOLE_EDGE) * 2.0**0.5, -1.0, SIDES
    ).translate([0, 0, -depth])
    ring = (layer - opening).rotate([0, 0, 45]).translate([0, 0, bottom])
    return convex_pieces(ring.transform(towards_head.X[:3]) ^ window ^ solid)
