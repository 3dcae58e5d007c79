"""Small products drawn in code, in assembled pose and in millimetres, to be drafted from meshes."""

from __future__ import annotations

from collections.abc import Mapping

import trimesh
from manifold3d import Manifold

from cell.cad.shapes import boss, box, cylinder, to_trimesh
from experiments.product.drawings import FACETS, screw


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


def pressed_block(interference: float = 0.007) -> dict[str, Manifold]:
    """Return a block with a blind hole, and a flanged bush with interference in it.

    Of POM 7 um radially take some 19 N over the 8 mm of the bush.
    """
    block = box((-20, -20, -40), (20, 20, 0)) - cylinder(8.0 - interference, -14.0, 1.0, FACETS)
    bush = boss(8.0, 0.0, 8.0, 0.5, FACETS).rotate([180, 0, 0])
    bush += boss(12.0, 0.0, 6.0, 0.5, FACETS)
    return {"block": block, "bush": bush - cylinder(6.5, -9.0, 7.0, FACETS)}


def capped_post(interference: float = 0.006) -> dict[str, Manifold]:
    """Return a block with a post on it, and a cap with interference over that.

    Of POM 6 um radially take some 18 N over the 8 mm of the post.
    """
    post = cylinder(8.0, -1.0, 0.0, FACETS) + boss(8.0, 0.0, 8.0, 0.5, FACETS)
    cap = cylinder(10.0, 0.0, 14.0, FACETS) - cylinder(8.0 - interference, -1.0, 10.0, FACETS)
    return {"block": box((-20, -20, -40), (20, 20, 0)) + post, "cap": cap}


def meshes(parts: Mapping[str, Manifold]) -> dict[str, trimesh.Trimesh]:
    """Return parts as surfaces in metres."""
    return {name: to_trimesh(solid.scale([1e-3] * 3)) for name, solid in parts.items()}
