"""Contact pieces of any closed mesh: exact where something fits, convex everywhere else.

Round holes are cut out as a window of few flat sides, and their wall is a rigid open band of
facets; what a screw clamps keeps its face under the screw (`cell.cad.screw_seat`); round bosses are
convex solids of revolution; the rest is cut along the planes of its concave edges. The part that
the fixture holds is rigid, what is brought to it is compliant, so that two rigid surfaces never
meet: those would touch as their convex hulls. Lengths in metres outside, in millimetres inside.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold

from cell.cad.convex_pieces import CUT, Error, convex_pieces, error_of, to_manifold
from cell.cad.edge_breaks import with_broken_edges
from cell.cad.motor_unit import (
    BOLT_HOLE_EDGE,
    FIT_FRICTION,
    HOLE_FACETS,
    METAL_DISSIPATION,
    METAL_MODULUS,
    MM,
    WASHER_FACETS,
    friction_radius,
)
from cell.cad.round_features import Cylinder
from cell.cad.screw_seat import screw_seat
from cell.cad.sdf import Contact, Piece
from cell.cad.shapes import convex_revolve, joined, open_band, to_trimesh
from cell.cad.slivers import without_slivers

EDGE_BREAK = 0.3  # [A] Deburred edge where the CAD draws a sharp one; less on short fits [mm].
INSET = 0.1  # The wall of a hole ends this far before both faces [mm] [D].
BOSS_FACETS = 32  # [M] As those of the motor unit: 14 um between corners and flats at 12 mm.
SOLID = 0.97  # [A] Filled share of a boss from which it is no tube, and has no key way.
BED_FRICTION = 0.9  # [A] As the motor's: coated beads.
BODY_FRICTION = 0.5  # [A] Metal or plastic on metal, as drawn parts are handled, dry.
OVERLAP = 0.01  # Of a plug with the wall around it, where facets do not meet [mm].
WINDOW_SCALE, WINDOW_PLAY = 1.02, 0.15  # Of a window around the widest end of a hole [-], [mm].
THIN = 0.02  # [A] Share of a window that may lie outside of the material.
WINDOW_SIDES = (4, 8, 16)  # Of the window of a hole, the fewest that stay within the material.


@dataclass(frozen=True)
class Use:
    """What goes into a hole.

    Attributes:
        kind: "fit" for a shaft, "clearance" for a bolt whose head rests on its mouth, "thread".
        clearance: Radial, of a fit [m]: decides how finely the wall is faceted.
        bearing: Radius of the face under a bolt's head [m].
        widened: By how much the wall of a fit is wider than it is drawn, radially [m].
        head_up: Whether the head is at the end with the larger height along the hole's axis.
    """

    kind: str
    clearance: float = 1e-4
    bearing: float = 0.0
    widened: float = 0.0
    head_up: bool = True


@dataclass(frozen=True)
class ContactModel:
    """Contact pieces of a part.

    Attributes:
        pieces: In P [m].
        error: Of all but the walls of holes, which are exact but for their facets, and but for the
            breaks of edges.
        notes: What was simplified.
        friction_radius: By number of a clearance hole, the mean distance from its axis of the
            contact under the head [m].
    """

    pieces: list[Piece]
    error: Error
    notes: tuple[str, ...]
    friction_radius: Mapping[int, float] = field(default_factory=dict)


def contact_model(
    mesh: trimesh.Trimesh,
    cylinders: Sequence[Cylinder],
    uses: Mapping[int, Use],
    *,
    fixed: bool,
    shafts: Collection[int] | None = None,
) -> ContactModel:
    """Return the contact pieces of a part.

    Args:
        mesh: Closed surface in P [m].
        cylinders: Its round features, as `cylinders_of` finds them [m].
        uses: By number of a cylinder, what goes into it; all other holes are filled.
        fixed: Whether the fixture holds it: then it is rigid, and named for the bed.
        shafts: Numbers of the bosses that go into holes; None: all. Others of a part that is held
            are like the rest of it, such as round feet.
    """
    drawn = to_manifold(mesh.copy().apply_scale(1.0 / MM))
    features = {number: cylinder.scaled(1.0 / MM) for number, cylinder in enumerate(cylinders)}
    holes = {n: c for n, c in features.items() if c.hole}
    used = {n: c for n, c in holes.items() if n in uses and uses[n].kind != "thread"}
    solid = sum((_plug(c) for n, c in holes.items() if n not in used), drawn)
    pieces: list[Piece] = []
    notes: list[str] = []
    stand_ins: list[Manifold] = []
    rest = solid
    for number, cylinder in used.items():
        use = uses[number]
        window, exact = _fitting_window(solid, cylinder, use)
        rest = rest - window
        if not exact:
            notes.append(
                f"the thin wall around the hole of {2 * cylinder.radius:.3g} mm is missing"
            )
        kind = "wall" if use.kind == "fit" else "washer"
        band = _wall(cylinder, use) if use.kind == "fit" else _washer(cylinder, use)
        pieces.append(Piece(f"{kind}_{number}", _metres(band), Contact(FIT_FRICTION)))
        if use.kind == "clearance" and not fixed:
            for k, seat in enumerate(screw_seat(solid, window, _towards_head(cylinder, use))):
                surface = _metres(to_trimesh(seat))
                pieces.append(
                    Piece(f"seat_{number}_{k}", surface, _metal(BODY_FRICTION), convex=True)
                )
    for number, cylinder in features.items():
        if not cylinder.hole and _is_solid(solid, cylinder):
            surface, room = _boss(cylinder, drawn)
            rest = rest - room
            stand_ins.append(to_manifold(surface))
            in_bed = fixed and shafts is not None and number not in shafts
            name = f"{'bed_' if in_bed else ''}boss_{number}"
            metal = Contact(BED_FRICTION) if in_bed else _metal()
            pieces.append(Piece(name, _metres(surface), metal, convex=True))
    bodies = convex_pieces(rest)
    contact = Contact(BED_FRICTION) if fixed else _metal(BODY_FRICTION)
    shape = to_trimesh(solid)
    for number, body in enumerate(bodies):
        if not fixed:
            body = with_broken_edges(body, shape)
        name = f"{'bed' if fixed else 'body'}_{number}"
        surface = without_slivers(to_trimesh(body))
        pieces.append(Piece(name, _metres(surface), contact, convex=True))
    # The walls of used holes are exact, and what their windows leave out touches nothing.
    windows = sum((_window(c, uses[n], 4) for n, c in used.items()), Manifold())
    error = error_of([*bodies, *stand_ins], solid, but=windows)
    radii = {
        n: friction_radius(uses[n].bearing / MM, c.radius + BOLT_HOLE_EDGE, WASHER_FACETS) * MM
        for n, c in used.items()
        if uses[n].kind == "clearance"
    }
    return ContactModel(pieces, error, tuple(notes), radii)


def _metal(friction: float = FIT_FRICTION) -> Contact:
    return Contact(friction, METAL_MODULUS, dissipation=METAL_DISSIPATION)


def _metres(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    return surface.copy().apply_scale(MM)


def _turned(cylinder: Cylinder, profile: Sequence[tuple[float, float]], facets: int) -> Manifold:
    """Return the solid around a half section (r, z) about a cylinder's axis; z from its point."""
    outside = np.array(profile, float) / [np.cos(np.pi / facets), 1.0]
    solid = Manifold.revolve(CrossSection([outside]), facets)
    return solid.transform(cylinder.X[:3])


def _plug(cylinder: Cylinder) -> Manifold:
    """Return what fills a hole with its chamfers, or with the point of its drill."""
    (r_low, low), (r_high, high) = cylinder.flare_low, cylinder.flare_high
    wide = OVERLAP + cylinder.radius
    side = [(r_low + OVERLAP, low), (wide, cylinder.low), (wide, cylinder.high)]
    side += [(r_high + OVERLAP, high)]
    return _turned(cylinder, [(0.0, low), *side, (0.0, high)], 64)


def _window(cylinder: Cylinder, use: Use, sides: int) -> Manifold:
    """Return a prism around a hole, its chamfers and the bearing face of a bolt."""
    radius = max(cylinder.radius, cylinder.flare_low[0], cylinder.flare_high[0], use.bearing / MM)
    apothem = WINDOW_SCALE * radius + WINDOW_PLAY
    low, high = cylinder.flare_low[1], cylinder.flare_high[1]
    prism = Manifold.cylinder(high - low + 2.0 * CUT, apothem / np.cos(np.pi / sides), -1.0, sides)
    return (
        prism.rotate([0, 0, 180.0 / sides]).translate([0, 0, low - CUT]).transform(cylinder.X[:3])
    )


def _fitting_window(solid: Manifold, cylinder: Cylinder, use: Use) -> tuple[Manifold, bool]:
    """Return the window with the fewest sides that stays in the material, and whether one does."""
    plug = _plug(cylinder)
    for sides in WINDOW_SIDES:
        window = _window(cylinder, use, sides)
        ring = window - plug
        if (ring - solid).volume() < THIN * ring.volume():
            return window, True
    return window, False


def _is_solid(solid: Manifold, cylinder: Cylinder) -> bool:
    """Return whether a boss is full, and not a tube or a shaft with a key way."""
    low, high = cylinder.low + CUT, cylinder.high - CUT
    radius = 0.99 * cylinder.radius * np.cos(np.pi / cylinder.facets)
    core = _turned(cylinder, [(0.0, low), (radius, low), (radius, high), (0.0, high)], 64)
    return (core ^ solid).volume() > SOLID * core.volume()


def _open(solid: Manifold, cylinder: Cylinder, height: float, beyond: float) -> bool:
    """Return whether there is no material about the axis beyond an end; ``beyond`` is +-1."""
    near, far = sorted((height + 0.02 * beyond, height + 0.12 * beyond))
    radius = 0.5 * cylinder.radius
    probe = _turned(cylinder, [(0.0, near), (radius, near), (radius, far), (0.0, far)], 16)
    return (probe ^ solid).volume() < 0.5 * probe.volume()


def _ends(cylinder: Cylinder) -> tuple[tuple[float, tuple[float, float], float], ...]:
    """Return height of the end, radius and height of its chamfer, and the way out, of both ends."""
    return (
        (cylinder.low, cylinder.flare_low, -1.0),
        (cylinder.high, cylinder.flare_high, 1.0),
    )


def _boss(cylinder: Cylinder, solid: Manifold) -> tuple[trimesh.Trimesh, Manifold]:
    """Return the surface of a boss [mm], and what is taken off the rest for it."""
    radius, outline = cylinder.mean_radius, []
    broken = min(EDGE_BREAK, 0.25 * cylinder.length, 0.2 * radius)
    extent = [cylinder.low, cylinder.high]
    for k, (end, (flare, last), out) in enumerate(_ends(cylinder)):
        if flare < cylinder.radius and abs(last - end) > CUT:
            outline += [(radius, end), (flare, last)]
            extent[k] = last
        elif _open(solid, cylinder, end, out):
            outline += [(radius, end - out * broken), (radius - broken, end)]
        else:
            outline += [(radius, end)]
    surface = convex_revolve(outline, BOSS_FACETS)
    surface.apply_transform(cylinder.X)
    wide, low, high = cylinder.radius + OVERLAP, extent[0] - CUT, extent[1] + CUT
    room = _turned(cylinder, [(0.0, low), (wide, low), (wide, high), (0.0, high)], 64)
    return surface, room


def _wall(cylinder: Cylinder, use: Use) -> trimesh.Trimesh:
    """Return the wall of a hole that faces its axis [mm], with broken edges at both ends.

    The sagitta of its facets is an eighth of the clearance; rows are about as tall as wide.
    """
    radius, length = cylinder.mean_radius + use.widened / MM, cylinder.length
    clearance = max(use.clearance / MM, 0.02)
    least = np.pi / np.sqrt(2.0 * clearance / 8.0 / radius)
    facets = int(np.clip(4 * np.ceil(least / 4), 16, 64))
    inset, broken = min(INSET, 0.05 * length), min(EDGE_BREAK, 0.2 * length)
    lines = []
    for end, (flare, last), out in _ends(cylinder):
        if flare > cylinder.radius and abs(last - end) > inset:
            share = inset / abs(last - end)
            lines.append([(flare + share * (radius - flare), last - out * inset), (radius, end)])
        elif flare < cylinder.radius:  # The point of a drill.
            lines.append([(radius, end)])
        else:
            edge = (radius + broken - inset, end - out * inset)
            lines.append([edge, (radius, end - out * broken)])
    low, high = lines
    rows = int(np.clip(round(length / (2.0 * np.pi * radius / facets * 1.5)), 1, 12))
    between = np.linspace(high[-1][1], low[-1][1], rows + 1)[1:-1]
    profile = [*high, *((radius, float(z)) for z in between), *reversed(low)]
    band = open_band(profile, facets)
    band.apply_transform(cylinder.X)
    return band


def _towards_head(cylinder: Cylinder, use: Use) -> Cylinder:
    return cylinder if use.head_up else cylinder.reversed()


def _washer(cylinder: Cylinder, use: Use) -> trimesh.Trimesh:
    """Return the face under a bolt's head and the wall of its hole [mm].

    The wall ends short of both faces, and has its corners within the flats of those: see
    `cell.cad.motor_unit.washer_surface`.
    """
    towards_head = _towards_head(cylinder, use)
    top, bottom = towards_head.flare_high[1], towards_head.flare_low[1]
    inner, radius = cylinder.radius + BOLT_HOLE_EDGE, cylinder.mean_radius
    edge = min(BOLT_HOLE_EDGE, 0.2 * (top - bottom))
    face = open_band([(use.bearing / MM, top), (inner, top)], WASHER_FACETS)
    wall = open_band([(radius, top - edge), (radius, bottom + edge)], HOLE_FACETS, phase=0.5)
    band = joined([face, wall])
    band.apply_transform(towards_head.X)
    return band
