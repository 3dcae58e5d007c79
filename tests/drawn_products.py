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


def write_meshes(parts: Mapping[str, Manifold], folder: Path) -> Path:
    """Write parts as STL files; return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, solid in parts.items():
        to_trimesh(solid).export(folder / f"{name}.stl")
    return folder


def meshes(parts: Mapping[str, Manifold]) -> dict[str, trimesh.Trimesh]:
    """Return parts as surfaces in metres."""
    return {name: to_trimesh(solid.scale([1e-3] * 3)) for name, solid in parts.items()}
