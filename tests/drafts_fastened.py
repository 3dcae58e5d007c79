"""Random drafts of parts held by screws, pins, keys, clips, press and snap fits. Lengths in mm."""

from __future__ import annotations

import numpy as np
from assembly_drafts import UP_OR_ASIDE, Draft, Rng, around, at, between, box, grid, rod
from manifold3d import Manifold

PITCHES = {3.0: 0.5, 4.0: 0.7, 5.0: 0.8, 6.0: 1.0, 8.0: 1.25}  # [S] ISO 261, coarse.


def screwed_cover(rng: Rng) -> Draft:
    """A cover on a base with screws, whose threads are drawn as overlapping cylinders."""
    draft = Draft("screwed cover")
    size = float(rng.choice(list(PITCHES)))
    count, thick, deep = int(rng.integers(1, 7)), between(rng, 3, 6), between(rng, 2.0, 2.5) * size
    places = dict(
        zip([f"screw_{k}" for k in range(count)], grid(rng, count, 6 * size), strict=True)
    )
    x0, y0, x1, y1 = around(places.values(), 3 * size)
    base, cover = box((x0, y0, -3 * size), (x1, y1, 0)), box((x0, y0, 0), (x1, y1, thick))
    facets = int(rng.choice([24, 32, 48]))
    minor = size - 1.0825 * PITCHES[size]  # [S] ISO 68-1: D1 = d - 1.0825 P.
    beyond = float(
        rng.choice([0.0, 1.0])
    )  # The screws' ends lie on the floor of their holes, or not.
    bore = float(rng.choice([minor, size - PITCHES[size]]))  # Or the tap drill's diameter.
    head = rod(0.8 * size, thick, thick + size, 24)
    for name, place in places.items():
        turn = between(rng, 0, 360)
        base -= at(rod(bore / 2, -deep - beyond, 1, facets).rotate([0, 0, turn]), *place)
        cover -= at(rod(0.55 * size, -1, thick + 1, facets), *place)
        draft.shapes[name] = at(rod(size / 2, -deep, thick + 1, facets) + head, *place)
        draft.pair(name, "base", "+z", touch=True)
        draft.pair(name, "cover", "+z", touch=True)
        draft.threads.add((name, "base"))
    draft.shapes |= {"base": base, "cover": cover}
    draft.pair("cover", "base", UP_OR_ASIDE, touch=True)
    draft.side_by_side(places, places)
    return draft


def stack_with_nut(rng: Rng) -> Draft:
    """Plates held together by a screw through all of them, and a nut below."""
    draft = Draft("stack with nut")
    size, plates = float(rng.choice(list(PITCHES))), int(rng.integers(1, 5))
    facets = int(rng.choice([24, 32, 48]))
    edges = np.cumsum([0.0, *rng.uniform(2, 6, plates)])
    top, wide, half = float(edges[-1]), between(rng, 2.5, 5) * size, size / 2
    bore = rod(1.1 * half, -1, top + 1, facets)
    names = [f"plate_{k}" for k in range(plates)]
    for k, name in enumerate(names):
        low, high = float(edges[k]), float(edges[k + 1])
        draft.shapes[name] = box((-wide, -wide, low), (wide, wide, high)) - bore
        draft.pair(name, "nut", UP_OR_ASIDE, touch=k == 0)
        draft.pair("bolt", name, "+z", touch=k == plates - 1)
        for below in range(k):
            draft.pair(name, names[below], UP_OR_ASIDE, touch=below == k - 1)
    thick = 0.8 * size
    bolt = rod(half, -thick - 1, top + 1, facets) + rod(0.8 * size, top, top + 0.7 * size, 6)
    minor = half - 0.54125 * PITCHES[size]
    nut = rod(0.9 * size, -thick, 0, 6) - rod(minor, -thick - 1, 1, facets)
    draft.shapes |= {"bolt": bolt, "nut": nut}
    draft.pair("bolt", "nut", "+z", touch=True)
    draft.threads.add(("bolt", "nut"))
    return draft


def stud_with_nuts(rng: Rng) -> Draft:
    """A stud in a tapped hole, a plate over it, and one nut or two against each other."""
    draft = Draft("stud with nuts")
    size, count = float(rng.choice(list(PITCHES))), int(rng.integers(1, 3))
    minor, thick, plate = size / 2 - 0.54125 * PITCHES[size], 0.8 * size, between(rng, 3, 6)
    wide, top = 3 * size, plate + count * 0.8 * size
    base = box((-wide, -wide, -3 * size), (wide, wide, 0)) - rod(minor, -2.5 * size, 1, 32)
    cover = box((-wide, -wide, 0), (wide, wide, plate)) - rod(0.55 * size, -1, plate + 1, 32)
    draft.shapes |= {"base": base, "cover": cover}
    draft.shapes["stud"] = rod(size / 2, -2 * size, top + size, 32)
    draft.pair("stud", "base", "+z", touch=True)
    draft.pair("stud", "cover", "+z -z", touch=False)
    draft.pair("cover", "base", UP_OR_ASIDE, touch=True)
    draft.threads.add(("stud", "base"))
    for k in range(count):
        low, name = plate + k * thick, f"nut_{k}"
        draft.shapes[name] = rod(0.9 * size, low, low + thick, 6) - rod(minor, 0, top + 1, 32)
        draft.threads.add(("stud", name))
        draft.pair(name, "stud", "+z -z", touch=True)
        draft.pair(name, "cover", UP_OR_ASIDE, touch=k == 0)
        draft.pair(name, "base", UP_OR_ASIDE, touch=False)
    if count == 2:
        draft.pair("nut_1", "nut_0", UP_OR_ASIDE, touch=True)
    return draft


def set_screw(rng: Rng) -> Draft:
    """A screw without a head in a tapped hole, flush or sunk: it leaves where the hole is open."""
    draft = Draft("set screw")
    size = float(rng.choice(list(PITCHES)))
    through, sunk = bool(rng.integers(0, 2)), between(rng, 0, 1) * size
    minor, long = size - 1.0825 * PITCHES[size], 2 * size
    bottom = -sunk - long - 0.5 * size
    block = box((-15, -15, bottom - 5), (15, 15, 0))
    block -= rod(minor / 2, bottom - (6 if through else 0), 1, 32)
    draft.shapes |= {"block": block, "screw": rod(size / 2, -sunk - long, -sunk, 32)}
    draft.pair("screw", "block", "+z -z" if through else "+z", touch=True)
    draft.threads.add(("screw", "block"))
    return draft


def press_fit(rng: Rng) -> Draft:
    """A pin that is thicker than its hole, by more than the usual tolerance on each side."""
    draft = Draft("press fit", alone=False)
    radius, excess = between(rng, 4, 6), between(rng, 0.056, 0.075)
    facets = 48
    block = box((-15, -15, 0), (15, 15, 15)) - rod(radius, 5, 16, facets)
    draft.shapes |= {"block": block, "pin": rod(radius + excess, 5, 30, facets)}
    pair = frozenset({"block", "pin"})
    draft.touching.add(pair)
    draft.press.add(pair)
    # Facets of equal number lie on each other: the flats are excess cos(pi / n) apart.
    draft.overlaps[pair] = excess * float(np.cos(np.pi / facets))
    return draft


def light_press_fit(rng: Rng) -> Draft:
    """A pin that is thicker than its hole by less than the usual tolerance: it counts as a fit."""
    draft = Draft("light press fit")
    radius, excess, facets = between(rng, 3, 6), between(rng, 0.005, 0.03), 48
    block = box((-15, -15, 0), (15, 15, 15)) - rod(radius, 5, 16, facets)
    draft.shapes |= {"block": block, "pin": rod(radius + excess, 5, 30, facets)}
    draft.pair("pin", "block", "+z", touch=True)
    return draft


def snap_fit(rng: Rng) -> Draft:
    """A cap whose hooks reach behind two noses of a body; between side walls it is caught."""
    draft = Draft("snap fit", alone=False)
    under, half = between(rng, 0.3, 1.2), between(rng, 6, 12)
    body = box((-half, -half, 0), (half, half, 20))
    cap = box((-half - 3, -half - 3, 20), (half + 3, half + 3, 23))
    for sign in (-1.0, 1.0):
        nose = box((half, -half, 8), (half + under, half, 12))
        arm = box((half + under, -half, 4), (half + 3, half, 21))
        hook = box((half, -half, 4), (half + 3, half, 8))
        turn = 0.0 if sign > 0 else 180.0
        body += nose.rotate([0, 0, turn])
        cap += (arm + hook).rotate([0, 0, turn])
    draft.shapes |= {"body": body, "cap": cap}
    draft.pair("cap", "body", "+y -y", touch=True)
    draft.alone = True  # It slides off sideways; with side walls it does not:
    if rng.random() < 0.7:
        walls = box((-half, half, 15), (half, half + 2, 20)) + box(
            (-half, -half - 2, 15), (half, -half, 20)
        )
        rim = box((-half - 3, half + 2, 15), (half + 3, half + 3, 21))
        rim += rim.rotate([0, 0, 180])
        draft.shapes["body"] += walls
        draft.shapes["cap"] += rim
        draft.pair("cap", "body", "", touch=True)
        draft.alone = False
        draft.snap.add(frozenset({"body", "cap"}))
    return draft


def key_in_keyway(rng: Rng) -> Draft:
    """A hub on a shaft with a key in a closed keyway of the shaft and an open one of the hub."""
    draft = Draft("key in keyway")
    radius, wide, facets = between(rng, 6, 9), between(rng, 1.2, 2.0), 48
    low, high = radius - 2.0, radius + 1.5
    key = box((-wide, low, -6), (wide, high, 6))
    shaft = rod(radius, -30, 30, facets) - key
    hub = rod(radius + 6, -9, 9, facets) - rod(radius, -10, 10, facets)
    hub -= box((-wide, 0, -10), (wide, high, 10))
    draft.shapes |= {"shaft": shaft, "key": key, "hub": hub}
    draft.pair("key", "shaft", "+y", touch=True)
    draft.pair("hub", "shaft", "+z -z", touch=True)
    draft.pair("hub", "key", "+z -z", touch=True)
    return draft


def clip_in_groove(rng: Rng) -> Draft:
    """A clip in the groove of a shaft: a wide mouth lets it out sideways, a closed one does not."""
    draft = Draft("clip in groove")
    radius, depth, facets = between(rng, 5, 8), between(rng, 0.6, 1.5), 48
    inner = radius - depth
    shaft = rod(radius, -20, 20, facets) - (
        rod(radius + 1, 0, 2, facets) - rod(inner, -1, 3, facets)
    )
    clip = rod(radius + 2, 0, 2, facets) - rod(inner, -1, 3, facets)
    opens = bool(rng.integers(0, 2))
    if opens:
        clip -= box((0, -inner, -1), (radius + 5, inner, 3))
    draft.shapes |= {"shaft": shaft, "clip": clip}
    draft.pair("clip", "shaft", "-x" if opens else "", touch=True)
    draft.feasible = draft.alone = opens
    return draft


def shaft_in_bearings(rng: Rng) -> Draft:
    """A tube, a shaft with a shoulder in the middle, and a bearing pushed on from each end."""
    draft = Draft("shaft in bearings")
    shaft_radius, wall, facets = between(rng, 3, 5), between(rng, 3, 5), 48
    outer, shoulder = shaft_radius + wall, shaft_radius + wall / 2
    tube = rod(outer + 4, -20, 20, facets) - rod(outer, -21, 21, facets)
    shaft = rod(shaft_radius, -30, 40, facets) + rod(shoulder, -10, 10, facets)
    ring = rod(outer, 10, 16, facets) - rod(shaft_radius, 9, 17, facets)
    draft.shapes |= {"tube": tube, "shaft": shaft, "front": ring, "back": ring.mirror([0, 0, 1])}
    draft.pair("shaft", "tube", "+z -z", touch=False)
    draft.pair("front", "tube", "+z -z", touch=True)
    draft.pair("back", "tube", "+z -z", touch=True)
    draft.pair("front", "shaft", "+z", touch=True)
    draft.pair("back", "shaft", "-z", touch=True)
    draft.pair("front", "back", UP_OR_ASIDE, touch=False)
    return draft


def hinge(rng: Rng) -> Draft:
    """Two leaves with interleaved knuckles, and a pin through them."""
    draft = Draft("hinge")
    outer, pin, long, facets = between(rng, 3, 4), between(rng, 1.2, 2), between(rng, 8, 12), 32
    knuckle = rod(outer, 0, long, facets).rotate([-90, 0, 0])
    bore = rod(pin, -1, 3 * long + 1, facets).rotate([-90, 0, 0])
    plate = box((-30, 0, -outer / 2), (-outer - 1, 3 * long, outer / 2))

    def tab(n: int) -> Manifold:
        arm = box((-outer - 2, n * long, -outer / 2), (0, (n + 1) * long, outer / 2))
        return at(knuckle, 0, n * long) + arm

    left = plate + tab(0) + tab(2) - bore
    right = plate.mirror([1, 0, 0]) + tab(1).mirror([1, 0, 0]) - bore
    draft.shapes |= {"left": left, "right": right}
    draft.shapes["pin"] = rod(pin, -2, 3 * long + 2, facets).rotate([-90, 0, 0])
    draft.pair("left", "right", "-x +z -z", touch=True)
    for leaf in ("left", "right"):
        draft.pair("pin", leaf, "+y -y", touch=True)
    return draft


def clevis(rng: Rng) -> Draft:
    """A lug with play between the arms of a fork, and a pin through both: only the pin touches."""
    draft = Draft("clevis with play")
    play, half, pin = between(rng, 0.1, 0.3), between(rng, 3, 6), between(rng, 1.5, 3)
    draft.gap = play
    bore = rod(pin, -40, 40, 32).rotate([0, 90, 0])
    fork = box((-half - 4, -8, -20), (half + 4, 8, 6)) - box((-half, -9, -8), (half, 9, 7))
    lug = box((play - half, -6, -5), (half - play, 6, 30))
    draft.shapes |= {"fork": fork - bore, "lug": lug - bore}
    draft.shapes["pin"] = rod(pin, -half - 6, half + 6, 32).rotate([0, 90, 0])
    draft.pair("lug", "fork", "+y -y +z", touch=True)
    draft.pair("pin", "fork", "+x -x", touch=True)
    draft.pair("pin", "lug", "+x -x", touch=True)
    return draft


def squeezed_ring(rng: Rng) -> Draft:
    """An O-ring drawn round although its lid squeezes it."""
    draft = Draft("squeezed ring", feasible=False, alone=False)
    wire, squeeze = between(rng, 1.0, 2.0), between(rng, 0.15, 0.4)
    section = Manifold.cylinder(1, wire, wire, 24).project().translate([8.0, wire])
    ring = Manifold.revolve(section, 48)
    groove = rod(8 + wire, 0, 10, 48) - rod(8 - wire, -1, 11, 48)
    depth = 2 * wire - squeeze
    base = rod(16, -6, depth, 48) - (groove ^ rod(20, 0, 20, 48))
    lid = rod(16, depth, depth + 4, 48)
    draft.shapes |= {"ring": ring, "base": base, "lid": lid}
    pair = frozenset({"ring", "lid"})
    draft.overlaps[pair] = squeeze
    draft.touching.add(pair)
    draft.pair("lid", "base", UP_OR_ASIDE, touch=True)
    draft.pair("ring", "base", "+z", touch=True)
    return draft
