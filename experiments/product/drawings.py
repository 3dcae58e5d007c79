"""Small products drawn in code, to be drafted from meshes, and what a person says about each.

All in assembled pose, in millimetres, z up.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from manifold3d import CrossSection, Manifold

from cell.cad.shapes import boss, box, cylinder, hexagon_prism
from cell.products.screw_table import SIZES
from experiments.product.random_drawing import screw as pan_or_cap

FACETS = 64


@dataclass(frozen=True)
class Kind:
    """A product of which a drawing is kept.

    Attributes:
        draw: Returns its parts by name.
        materials: What a person gives `init` for ``--material``.
    """

    draw: Callable[[], Mapping[str, Manifold]]
    materials: tuple[str, ...] = ()


def screw(x: float, y: float, z: float, d: float, length: float) -> Manifold:
    """Return a socket cap screw with the underside of its head at a point."""
    shape = cylinder(d / 2, -length, 0.0, FACETS) + cylinder(0.875 * d, 0.0, d, FACETS)
    shape -= hexagon_prism(0.75 * d, d / 2, d + 1)
    return shape.translate([x, y, z])


def bearing_block(clearance: float = 0.05, depth: float = 18.0) -> dict[str, Manifold]:
    """Return a block with a blind hole, a flanged bush in it, and a cover on four M4 x 16.

    Args:
        clearance: Radial, of the bush in the block; negative for a press fit. That of its flange
            in the cover is 0.3 mm. Of POM, -7 um take some 20 N over 5 mm.
        depth: Of the bush in the block.
    """
    block = box((-22, -22, -40), (22, 22, 0))
    block -= cylinder(10.0 + clearance, -depth - 2.0, 1.0, FACETS)
    bush = boss(10.0, 0.0, depth, 0.5, FACETS).rotate([180, 0, 0])
    bush = bush + boss(13.0, 0.0, 6.0, 0.5, FACETS) - cylinder(6.0, -depth - 1.0, 7.0, FACETS)
    cover = box((-22, -22, 0), (22, 22, 10)) - cylinder(7.0, -1.0, 11.0, FACETS)
    cover -= cylinder(13.3, -1.0, 6.2, FACETS)
    parts = {"block": block, "bush": bush, "cover": cover}
    places = [(x, y) for x in (-16.0, 16.0) for y in (-16.0, 16.0)]
    for number, (x, y) in enumerate(places, start=1):
        parts["block"] -= cylinder(1.65, -9.0, 1.0, FACETS).translate([x, y, 0])
        parts["cover"] -= cylinder(2.25, -1.0, 11.0, FACETS).translate([x, y, 0])
        parts[f"screw_{number}"] = screw(x, y, 10.0, 4.0, 16.0)
    return parts


def bar_puzzle(clearance: float = 0.25) -> dict[str, Manifold]:
    """Return five printed bars that stack by pegs and holes, without screws.

    Two bars lie across the lowest on a peg each, a fourth bridges them over two pegs, and the last
    lies across that one.
    """
    low = box((-32, -12, -36), (32, 12, 0))
    across = box((-9, -24, 0), (9, 24, 12)) + _peg(12.0) - _socket(0.0, clearance)
    parts = {"bar_1": low}
    bridge = box((-32, -9, 12), (32, 9, 24)) + _peg(24.0)
    for number, x in enumerate((-20.0, 20.0), start=2):
        parts["bar_1"] += _peg(0.0).translate([x, 0, 0])
        parts[f"bar_{number}"] = across.translate([x, 0, 0])
        bridge -= _socket(12.0, clearance).translate([x, 0, 0])
    last = box((-9, -24, 24), (9, 24, 36)) - _socket(24.0, clearance)
    return {**parts, "bar_4": bridge, "bar_5": last}


def box_with_lid(side_plate: bool = False) -> dict[str, Manifold]:
    """Return an open box and its lid with a lip, on four M3 x 10 with cross recesses.

    The lip goes 3 mm deep between walls and corner posts, with 0.2 mm on all sides.

    Args:
        side_plate: Whether a side of the box is open, and closed by a plate from that side.
    """
    body = box((-22, -22, -32), (22, 22, 0)) - box((-17, -17, -27), (17, 17, 1))
    lid = box((-22, -22, 0), (22, 22, 5)) + box((-11.8, -16.8, -3), (11.8, 16.8, 1))
    parts = {"box": body, "lid": lid}
    if side_plate:
        opening = box((16, -11, -26), (23, 11, -6))
        parts["box"] -= opening
        parts["plate"] = box((17, -10.9, -25.9), (24, 10.9, -6.1))
    size = SIZES[2]
    for number, (x, y) in enumerate([(x, y) for x in (-17.0, 17.0) for y in (-17.0, 17.0)], 1):
        parts["box"] += box((x - 5, y - 5, -27), (x + 5, y + 5, 0))
        parts["box"] -= cylinder(1.25, -9.0, 1.0, FACETS).translate([x, y, 0])
        parts["lid"] -= cylinder(1.7, -1.0, 6.0, FACETS).translate([x, y, 0])
        parts[f"screw_{number}"] = pan_or_cap(size, size.heads[1], 10.0).translate([x, y, 5])
    return parts


def gear_pair(backlash: float = 0.4) -> dict[str, Manifold]:
    """Return a base, two gears that mesh, each on a shaft of its own, and a bridge over both.

    The bridge holds the shafts' upper ends, and is screwed down by two M4 x 30.

    Args:
        backlash: Between two flanks, on the pitch circles.
    """
    teeth, module, distance = 12, 1.5, 18.0
    parts = {"base": box((-30, -16, -32), (30, 16, 0))}
    bridge = box((-30, -12, 16), (30, 12, 22))
    bridge += box((-30, -12, 0), (-21, 12, 17)) + box((21, -12, 0), (30, 12, 17))
    for number, x in enumerate((-distance / 2, distance / 2), start=1):
        shaft = boss(3.0, 0.0, 22.0, 0.5, FACETS) + boss(3.0, 0.0, 12.0, 0.5, FACETS).rotate(
            [180, 0, 0]
        )
        parts["base"] -= cylinder(3.05, -12.0, 1.0, FACETS).translate([x, 0, 0])
        bridge -= cylinder(3.15, 15.0, 23.0, FACETS).translate([x, 0, 0])
        turned = gear(teeth, module, 8.0, backlash).rotate([0, 0, (number - 1) * 180 / teeth])
        parts[f"shaft_{number}"] = shaft.translate([x, 0, 0])
        parts[f"gear_{number}"] = turned.translate([x, 0, 0])
    for number, x in enumerate((-25.5, 25.5), start=1):
        parts["base"] -= cylinder(1.65, -10.0, 1.0, FACETS).translate([x, 0, 0])
        bridge -= cylinder(2.25, -1.0, 23.0, FACETS).translate([x, 0, 0])
        parts[f"screw_{number}"] = screw(x, 0.0, 22.0, 4.0, 30.0)
    return {**parts, "bridge": bridge}


def gear(teeth: int, module: float, width: float, backlash: float) -> Manifold:
    """Return a gear on the origin with a bore of 6.2 mm, a hub on top, and straight flanks.

    A flank is its tangent at the pitch circle, at 20 degrees; a tooth is thinner by half the
    backlash.
    """
    pitch = module * teeth / 2
    tip, root = pitch + 0.9 * module, pitch - 1.2 * module
    half = np.pi * pitch / (2 * teeth) - backlash / 2
    outline = []
    for middle in 2 * np.pi * np.arange(teeth) / teeth:
        for radius, side in ((root, -1), (tip, -1), (tip, 1), (root, 1)):
            wide = half - (radius - pitch) * np.tan(np.deg2rad(20.0))
            angle = middle + side * np.arcsin(wide / radius)
            outline.append([radius * np.cos(angle), radius * np.sin(angle)])
    solid = Manifold.extrude(CrossSection([np.array(outline)]), width)
    solid += boss(6.0, width - 1.0, width + 6.0, 0.5, FACETS)
    return solid - cylinder(3.1, -1.0, width + 7.0, FACETS)


def _peg(z: float) -> Manifold:
    """Return a peg that stands at a height, rooted in what is below it."""
    return boss(4.0, 0.0, 8.0, 0.8, FACETS).translate([0, 0, z]) + cylinder(4.0, z - 1.0, z, FACETS)


def _socket(z: float, clearance: float) -> Manifold:
    """Return the hole for a peg that stands at a height."""
    return cylinder(4.0 + clearance, z - 1.0, z + 9.0, FACETS)


KINDS = {
    "bearing block": Kind(lambda: bearing_block(-0.007, 5.0), ("pom",)),
    "box with lid": Kind(box_with_lid),
    "gear pair": Kind(gear_pair),
    "bar puzzle": Kind(bar_puzzle, ("pla",)),
}
