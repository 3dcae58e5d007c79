"""Random drafts of fits: pegs, prints, boxes, seats, gears. Lengths in mm."""

from __future__ import annotations

import numpy as np
from assembly_drafts import (
    UP_OR_ASIDE,
    Draft,
    Rng,
    around,
    at,
    between,
    box,
    cone,
    grid,
    rod,
    square_rod,
)
from manifold3d import Manifold


def pegs(rng: Rng) -> Draft:
    """Pegs in holes of a block: through or blind, round or square, with or without a shoulder."""
    draft = Draft("pegs")
    count, height = int(rng.integers(1, 5)), between(rng, 8, 20)
    places = dict(zip([f"peg_{k}" for k in range(count)], grid(rng, count, 20), strict=True))
    x0, y0, x1, y1 = around(places.values(), 12)
    block = box((x0, y0, 0), (x1, y1, height))
    for name, place in places.items():
        radius, facets = between(rng, 2, 5), int(rng.choice([32, 48, 64]))
        through, square, shoulder = (bool(bit) for bit in rng.integers(0, 2, 3))
        low = -2.0 if through else height / 2
        top = height + between(rng, 3, 10)

        def bar(a: float, b: float, r: float = radius, s: bool = square, f: int = facets):
            return square_rod(r, a, b) if s else rod(r, a, b, f)

        hole = bar(-1.0 if through else low, height + 1)
        block -= at(hole, *place)
        shape = bar(low, top)
        if shoulder:
            shape += rod(radius + 3, height, top, 24)
        draft.shapes[name] = at(shape, *place)
        draft.pair(name, "block", "+z -z" if through and not shoulder else "+z", touch=True)
    draft.shapes["block"] = block
    draft.side_by_side(places, places)
    return draft


def print_with_clearance(rng: Rng) -> Draft:
    """Printed parts with a clearance all round: they touch nowhere."""
    draft = Draft("print with clearance")
    gap, n = between(rng, 0.15, 0.35), int(rng.integers(1, 4))
    draft.gap, wide = gap, between(rng, 6, 12)
    places = {f"key_{k}": (30.0 * k, 0.0) for k in range(n)}
    body = box((-15, -15, 0), (30.0 * n - 15, 15, 20))
    for name, place in places.items():
        body -= at(square_rod(wide + gap, 8, 21), *place)
        key = square_rod(wide, 8 + gap, 25)
        draft.shapes[name] = at(key, *place)
        draft.pair(name, "body", "+z", touch=True)
    draft.shapes["body"] = body
    draft.side_by_side(places, places)
    return draft


def box_in_box(rng: Rng) -> Draft:
    """A box in a box in a box, each with play, under a common lid."""
    draft = Draft("box in box")
    levels, play, wall = int(rng.integers(2, 5)), between(rng, 0.5, 2), between(rng, 1.5, 3)
    half, low, top = 4.0, 0.0, 30.0
    for k in range(levels):
        name = f"box_{k}"
        if k == 0:
            draft.shapes[name] = square_rod(half, low, top)
        else:
            cavity = square_rod(half + play, low, top + 1)
            half += play + wall
            low -= wall
            draft.shapes[name] = square_rod(half, low, top) - cavity
        for inner in range(k):
            draft.pair(f"box_{inner}", name, "+z", touch=inner == k - 1)
    draft.shapes["lid"] = square_rod(half, top, top + 4)
    for k in range(levels):
        draft.pair("lid", f"box_{k}", UP_OR_ASIDE, touch=True)
    return draft


def cone_in_seat(rng: Rng) -> Draft:
    """A frustum in a conical seat, with facets that match or do not."""
    draft = Draft("cone in seat")
    top, bottom = between(rng, 6, 9), between(rng, 2, 5)
    seat, own = (int(n) for n in rng.choice([48, 64, 100], 2))
    block = box((-15, -15, -12), (15, 15, 10)) - cone(bottom, top, 0, 10, seat)
    slope = (top - bottom) / 10
    plug = cone(bottom, top + 3 * slope, 0, 13, own)
    draft.shapes |= {"block": block, "plug": plug}
    draft.pair("plug", "block", "+z", touch=True)
    return draft


def ball_in_seat(rng: Rng) -> Draft:
    """A ball in a shallow spherical seat."""
    draft = Draft("ball in seat")
    radius = between(rng, 5, 9)
    seat, own = (Manifold.sphere(radius, int(n)) for n in rng.choice([64, 100], 2))
    block = box((-15, -15, -15), (15, 15, -between(rng, 0.3, 0.7) * radius)) - seat
    draft.shapes |= {"block": block, "ball": own}
    draft.pair("ball", "block", "+z", touch=True)
    return draft


def meshing_gears(rng: Rng) -> Draft:
    """Two gears on pins of a plate, in mesh with backlash."""
    draft = Draft("meshing gears")
    teeth, module = int(rng.integers(10, 18)), 2.0
    radius = teeth * module / 2

    def gear(turn: float) -> Manifold:
        shape = rod(radius - 1.1 * module, 0, 8, 4 * teeth)
        outline = [(radius - 1.5 * module, 0.63 * module), (radius + 0.9 * module, 0.3 * module)]
        corners = [[r, sign * w, z] for r, w in outline for sign in (-1, 1) for z in (0, 8)]
        tooth = Manifold.hull_points(np.array(corners, float))
        for k in range(teeth):
            shape += tooth.rotate([0, 0, 360 * k / teeth])
        return shape.rotate([0, 0, turn]) - rod(3, -1, 9, 32)

    plate = box((-radius - 5, -radius - 5, -5), (3 * radius + 5, radius + 5, 0))
    distance = 2 * radius + 0.3
    phase = 180.0 / teeth if teeth % 2 == 0 else 0.0
    for n, (name, turn) in enumerate((("left", 0.0), ("right", phase))):
        pin = at(rod(3, -5, 12, 32), n * distance, 0)
        plate -= pin
        draft.shapes |= {name: at(gear(turn), n * distance, 0), f"{name}_pin": pin}
        draft.pair(f"{name}_pin", "plate", "+z -z", touch=True)
        draft.pair(name, f"{name}_pin", "+z -z", touch=True)
        draft.pair(name, "plate", UP_OR_ASIDE, touch=True)
    draft.shapes["plate"] = plate
    return draft


def tapered_plug(rng: Rng) -> Draft:
    """A plug in a hole with draft, as moulded parts have it, tessellated each in its own way."""
    draft = Draft("tapered plug")
    seat, own = (int(n) for n in rng.choice([48, 64, 100], 2))
    slope, radius = float(np.tan(np.deg2rad(between(rng, 0.5, 5)))), between(rng, 5, 8)
    block = box((-16, -16, -4), (16, 16, 20)) - cone(radius, radius + 20 * slope, 0, 20, seat)
    draft.shapes |= {"block": block, "plug": cone(radius, radius + 30 * slope, 0, 30, own)}
    draft.pair("plug", "block", "+z", touch=True)
    return draft
