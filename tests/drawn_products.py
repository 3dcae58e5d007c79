"""Small products drawn in code, in assembled pose and in millimetres, to be drafted from meshes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import trimesh
from manifold3d import Manifold

from cell.cad.shapes import boss, box, cylinder, hexagon_prism, to_trimesh

FACETS = 64


def screw(x: float, y: float, z: float, d: float, length: float) -> Manifold:
    """Return a socket cap screw with the underside of its head at a point."""
    shape = cylinder(d / 2, -length, 0.0, FACETS) + cylinder(0.875 * d, 0.0, d, FACETS)
    shape -= hexagon_prism(0.75 * d, d / 2, d + 1)
    return shape.translate([x, y, z])


def covered_block(tap: float = 1.65) -> dict[str, Manifold]:
    """Return a block, a cover of the same outline, and two M4 x 12 that clamp it.

    Args:
        tap: Radius at which the threaded holes are drawn.
    """
    block, cover = box((-20, -20, -40), (20, 20, 0)), box((-20, -20, 0), (20, 20, 5))
    parts = {}
    for number, x in enumerate((-12.0, 12.0)):
        block -= cylinder(tap, -13.0, 1.0, FACETS).translate([x, 0, 0])
        cover -= cylinder(2.25, -1.0, 6.0, FACETS).translate([x, 0, 0])
        parts[f"screw_{number + 1}"] = screw(x, 0.0, 5.0, 4.0, 12.0)
    return {"block": block, "cover": cover, **parts}


def pinned_block(clearance: float = 0.1) -> dict[str, Manifold]:
    """Return a block with a blind hole, and a flanged pin in it."""
    block = box((-20, -20, -40), (20, 20, 0)) - cylinder(8.0 + clearance, -18.0, 1.0, FACETS)
    pin = boss(8.0, 0.0, 16.0, 0.5, FACETS).rotate([180, 0, 0])
    pin += cylinder(14.0, 0.0, 12.0, FACETS)
    return {"block": block, "pin": pin}


def bearing_block() -> dict[str, Manifold]:
    """Return a block with a blind hole, a flanged bush in it, and a cover on four M4 x 16.

    The bush has 50 um of radial clearance in the block, and its flange 0.3 mm in the cover.
    """
    block = box((-22, -22, -40), (22, 22, 0)) - cylinder(10.05, -20.0, 1.0, FACETS)
    bush = boss(10.0, 0.0, 18.0, 0.5, FACETS).rotate([180, 0, 0])
    bush = bush + boss(13.0, 0.0, 6.0, 0.5, FACETS) - cylinder(6.0, -19.0, 7.0, FACETS)
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


def _peg(z: float) -> Manifold:
    """Return a peg that stands at a height, rooted in what is below it."""
    return boss(4.0, 0.0, 8.0, 0.8, FACETS).translate([0, 0, z]) + cylinder(4.0, z - 1.0, z, FACETS)


def _socket(z: float, clearance: float) -> Manifold:
    """Return the hole for a peg that stands at a height."""
    return cylinder(4.0 + clearance, z - 1.0, z + 9.0, FACETS)


def write_meshes(parts: Mapping[str, Manifold], folder: Path) -> Path:
    """Write parts as STL files; return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, solid in parts.items():
        to_trimesh(solid).export(folder / f"{name}.stl")
    return folder


def meshes(parts: Mapping[str, Manifold]) -> dict[str, trimesh.Trimesh]:
    """Return parts as surfaces in metres."""
    return {name: to_trimesh(solid.scale([1e-3] * 3)) for name, solid in parts.items()}
