"""Random drafts that cannot be planned as they are, or only just. Lengths in mm."""

from __future__ import annotations

import numpy as np
from assembly_drafts import SIDEWAYS, UP_OR_ASIDE, Draft, Rng, between, box, rod
from drafts_fits import box_in_box, pegs
from manifold3d import Manifold


def stray(rng: Rng) -> Draft:
    """Pegs in a block, and a cube far away from both."""
    draft = pegs(rng)
    draft.kind, draft.feasible, draft.alone = "stray", False, False
    edge, far = between(rng, 2, 15), between(rng, 20, 200)
    high = max(shape.bounding_box()[5] for shape in draft.shapes.values())
    draft.shapes["cube"] = box((-3, -3, high + far), (edge - 3, edge - 3, high + far + edge))
    draft.strays = {"cube"}
    return draft


def overlapping_boxes(rng: Rng) -> Draft:
    """A row of boxes of equal section; some run into their neighbour, others touch it."""
    draft = Draft("overlapping boxes", feasible=False, alone=False)
    count, x = int(rng.integers(2, 6)), 0.0
    deep = [between(rng, 0.2, 2.0) if rng.random() < 0.5 else 0.0 for _ in range(count - 1)]
    if not any(deep):
        deep[int(rng.integers(count - 1))] = between(rng, 0.2, 2.0)
    names = [f"box_{k}" for k in range(count)]
    for k, name in enumerate(names):
        length = between(rng, 8, 20)
        half = between(rng, 6, 12)
        draft.shapes[name] = box((x, -half, -half), (x + length, half, half))
        x += length - (deep[k] if k < count - 1 else 0.0)
        for before in range(k):
            depth = deep[k - 1] if before == k - 1 else 0.0
            if depth:
                pair = frozenset({name, names[before]})
                draft.overlaps[pair] = depth
                draft.touching.add(pair)
            else:
                touch = before == k - 1
                draft.pair(name, names[before], "+x +y -y +z -z", touch=touch)
    return draft


def ball_in_cavity(rng: Rng) -> Draft:
    """A ball on the floor of a closed cavity: it can never have got there."""
    draft = Draft("ball in cavity", feasible=False, alone=False)
    radius, wall = between(rng, 3, 8), between(rng, 1, 4)
    half = radius + between(rng, 0.5, 4)
    outer = 2 * (half + wall)
    shell = Manifold.cube([outer] * 3, True) - Manifold.cube([2 * half] * 3, True)
    ball = Manifold.sphere(radius, 24).translate([0, 0, radius - half])
    draft.shapes |= {"shell": shell, "ball": ball}
    draft.pair("ball", "shell", "", touch=True)
    return draft


def bayonet(rng: Rng) -> Draft:
    """A bar with a cross head, turned behind the slot through which it came."""
    draft = Draft("bayonet", feasible=False, alone=False)
    wide, thin, turn = between(rng, 6, 9), between(rng, 1.5, 2.5), 90.0
    cup = rod(12, 0, 20, 32) - rod(wide + 0.5, 4, 14, 32)
    cup -= box((-wide - 0.3, -thin - 0.3, 13), (wide + 0.3, thin + 0.3, 21))
    cup -= rod(thin + 0.3, 13, 21, 32)
    key = box((-wide, -thin, 4), (wide, thin, 8)).rotate([0, 0, turn]) + rod(thin, 7, 30, 32)
    draft.shapes |= {"cup": cup, "key": key}
    draft.pair("key", "cup", "", touch=True)
    return draft


def dumbbell(rng: Rng) -> Draft:
    """A closed ring between the two flanges of a spool."""
    draft = Draft("captured ring", feasible=False, alone=False)
    radius, flange, low = between(rng, 3, 5), between(rng, 7, 10), between(rng, 2, 6)
    spool = rod(radius, -10, 10, 32) + rod(flange, -12, -8, 32) + rod(flange, 8, 12, 32)
    ring = rod(flange + 1, -8, -8 + low, 32) - rod(radius + 0.5, -9, 9, 32)
    draft.shapes |= {"spool": spool, "ring": ring}
    draft.pair("ring", "spool", "", touch=True)
    return draft


def touching_edges(rng: Rng) -> Draft:
    """Two boxes that touch along an edge only, on a common base."""
    draft = Draft("touching edges")
    a, b = between(rng, 5, 10), between(rng, 5, 10)
    draft.shapes |= {
        "base": box((-20, -20, -5), (20, 20, 0)),
        "one": box((-a, -a, 0), (0, 0, 10)),
        "other": box((0, 0, 0), (b, b, 10)),
    }
    draft.pair("one", "base", UP_OR_ASIDE, touch=True)
    draft.pair("other", "base", UP_OR_ASIDE, touch=True)
    draft.pair("one", "other", "+x -x +y -y +z -z", touch=True)
    return draft


def thin_sheets(rng: Rng) -> Draft:
    """Foils in a shallow tray with walls, thinner than two usual tolerances, under a lid."""
    draft = Draft("thin sheets")
    count, thick = int(rng.integers(1, 4)), between(rng, 0.06, 0.2)
    depth = count * thick
    tray = box((-15, -15, -4), (15, 15, depth)) - box((-10, -10, 0), (10, 10, depth + 1))
    names = [f"foil_{k}" for k in range(count)]
    for k, name in enumerate(names):
        draft.shapes[name] = box((-10, -10, k * thick), (10, 10, (k + 1) * thick))
        draft.pair(name, "tray", "+z", touch=True)
        draft.pair("lid", name, UP_OR_ASIDE, touch=k == count - 1)
        for below in range(k):
            draft.pair(name, names[below], UP_OR_ASIDE, touch=below == k - 1)
    draft.shapes |= {"tray": tray, "lid": box((-15, -15, depth), (15, 15, depth + 3))}
    draft.pair("lid", "tray", UP_OR_ASIDE, touch=True)
    return draft


def thin_wire(rng: Rng) -> Draft:
    """A headed pin locked by a wire across it, thinner than two usual tolerances."""
    draft = Draft("thin wire")
    wire = between(rng, 0.02, 0.045)
    block = box((-10, -10, 0), (10, 10, 15)) - rod(4, -1, 16, 32)
    pin = rod(4, -5, 15, 32) + rod(6, 15, 18, 32)
    across = rod(wire, -9, 9, 16).rotate([0, 90, 0]).translate([0, 0, -wire])
    draft.shapes |= {"block": block, "pin": pin - across, "wire": across}
    draft.pair("pin", "block", "+z", touch=True)
    draft.pair("wire", "pin", "+x -x", touch=True)
    draft.pair("wire", "block", "-z +x -x +y -y", touch=True)
    return draft


def tiny_beside_large(rng: Rng) -> Draft:
    """A grub screw of a millimetre in a shaft of a hundred, coarsely drawn, in its bore."""
    draft = Draft("tiny beside large")
    radius, tiny = between(rng, 30, 60), between(rng, 0.4, 0.8)
    ring = rod(radius + 20, 0, 40, 64) - rod(radius, -1, 41, 64).rotate([0, 0, 180 / 64])
    shaft = rod(radius, -50, 60, 64)
    pin = rod(tiny, 60 - 2 * tiny, 60 + 2 * tiny, 24)
    draft.shapes |= {"ring": ring, "shaft": shaft - pin, "grub": pin}
    draft.pair("grub", "shaft", "+z", touch=True)
    draft.pair("shaft", "ring", "+z -z", touch=True)
    draft.pair("grub", "ring", "+z -z " + SIDEWAYS, touch=False)
    return draft


def slivers(rng: Rng) -> Draft:
    """A box in a pocket, both cut up into sliver triangles by cuts that were filled again."""
    draft = box_in_box(rng)
    draft.kind = "slivers"
    for name in ("box_0", "box_1"):
        shape = draft.shapes[name]
        x0, y0, z0, x1, y1, z1 = shape.bounding_box()
        pieces = [
            shape.split_by_plane([np.cos(t), np.sin(t), 0.0], 1e-3 * between(rng, -1, 1))
            for t in rng.uniform(0, np.pi, 1)
        ]
        draft.shapes[name] = pieces[0][0] + pieces[0][1]
    return draft


def tied_pairs(rng: Rng) -> Draft:
    """Two tongues, each in its groove, in pockets of one body: a pair leaves as one, or not at all.

    A tongue leaves its groove along x only, and the pocket's walls forbid that; the body cannot
    leave either, as one pocket opens up and the other down.
    """
    draft = Draft("tied pairs", alone=False)
    half, long = between(rng, 6, 10), between(rng, 8, 14)
    slot, tongue = _tongue_and_groove(half, long)
    body = box((-long - 5, -half - 5, -20), (long + 5, half + 5, 20))
    body -= box((-long, -half, 4), (long, half, 21)) + box((-long, -half, -21), (long, half, -4))
    for side, turn in (("upper", 0), ("lower", 180)):
        way = "+z" if turn == 0 else "-z"
        for name, shape in (("groove", slot), ("tongue", tongue)):
            draft.shapes[f"{side}_{name}"] = shape.rotate([turn, 0, 0])
            draft.pair(f"{side}_{name}", "body", way, touch=True)
        draft.pair(f"{side}_groove", f"{side}_tongue", "+x -x", touch=True)
    for upper in ("upper_groove", "upper_tongue"):
        for lower in ("lower_groove", "lower_tongue"):
            draft.pair(upper, lower, UP_OR_ASIDE, touch=False)
    draft.shapes["body"] = body
    draft.together = tuple(
        frozenset({f"{side}_groove", f"{side}_tongue"}) for side in ("upper", "lower")
    )
    return draft


def _tongue_and_groove(half: float, long: float) -> tuple[Manifold, Manifold]:
    """A block with a T-slot along x from z = 4 to 14, and the T-shaped tongue in it, up to 24.

    The tongue's plate above the block makes both as wide as the pocket.
    """
    tee = box((-long, -half / 2, 6), (long, half / 2, 10)) + box(
        (-long, -half / 4, 9), (long, half / 4, 15)
    )
    groove = box((-long, -half, 4), (long, half, 14)) - tee
    tongue = tee + box((-long, -half, 14), (long, half, 24))
    return groove, tongue


def slanted_pin(rng: Rng) -> Draft:
    """A pin in a blind hole at an angle to all axes."""
    draft = Draft("slanted pin", alone=False)
    tilt, turn = between(rng, 12, 40), between(rng, 10, 80)
    radius, facets = between(rng, 2, 4), int(rng.choice([24, 32, 48]))
    shaft = rod(radius, -14, 30, facets).rotate([0, tilt, turn])
    block = box((-25, -25, -25), (25, 25, 0))
    draft.shapes |= {"block": block - shaft, "pin": shaft}
    draft.pair("pin", "block", "", touch=True)
    tilt, turn = np.deg2rad([tilt, turn])
    way = (np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt))
    x, y, z = (float(value) for value in way)
    draft.slanted["pin"] = (x, y, z)
    return draft
