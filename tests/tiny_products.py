"""Small products with known answers, built in code. Lengths in metres."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import trimesh
from manifold3d import Manifold
from pydrake.math import RigidTransform

from cell.products.joints import Screw
from cell.products.product import Part, Product

MM = 1e-3


def box(size: tuple[float, float, float], lower: tuple[float, float, float]) -> Manifold:
    """Box by its size and lower corner [mm]."""
    return Manifold.cube(list(size)).translate(list(lower))


def rod(diameter: float, z_low: float, z_high: float, facets: int = 64) -> Manifold:
    """Cylinder about z [mm]."""
    radius = diameter / 2
    return Manifold.cylinder(z_high - z_low, radius, radius, facets).translate([0, 0, z_low])


def to_trimesh(shape: Manifold) -> trimesh.Trimesh:
    """Convert from millimetres to a mesh in metres."""
    mesh = shape.to_mesh64()
    vertices = np.array(mesh.vert_properties)[:, :3] * MM
    return trimesh.Trimesh(vertices, np.array(mesh.tri_verts, int), process=False)


def product_of(shapes: Mapping[str, Manifold], **fields) -> Product:
    """Parts of equal density (water) in assembled poses, modelled in A."""
    meshes = {name: to_trimesh(shape) for name, shape in shapes.items()}
    parts = {
        name: Part(name, mesh, 1000.0 * mesh.volume, RigidTransform())
        for name, mesh in meshes.items()
    }
    return Product("tiny", parts, **fields)


def peg_in_hole(peg: float = 10.0, hole: float = 10.0, hole_facets: int = 64) -> Product:
    """A peg in a blind hole: it leaves along +z only. Line to line by default."""
    block = box((40, 40, 20), (-20, -20, 0)) - rod(hole, 5, 25, hole_facets)
    return product_of({"block": block, "peg": rod(peg, 5, 35)})


def interlocked_links() -> Product:
    """Two links of a chain that touch on one face: nothing leaves along any axis."""
    link = box((30, 30, 5), (-15, -15, -2.5)) - box((20, 20, 20), (-10, -10, -10))
    return product_of({"link_1": link, "link_2": link.rotate([90, 0, 0]).translate([20, 0, 0])})


def stack_of_three() -> Product:
    """Three plates on each other."""
    return product_of({f"plate_{k}": box((40, 40, 10), (-20, -20, 10 * k)) for k in range(3)})


def bolted(thread: float = 3.0) -> Product:
    """Base with a threaded blind hole, a lid with a clearance hole, a headed bolt."""
    base = box((30, 30, 20), (-15, -15, -20)) - rod(thread, -10, 5, 32)
    lid = box((30, 30, 5), (-15, -15, 0)) - rod(3.4, -5, 10, 32)
    bolt = rod(3, -5, 6, 32) + rod(5.5, 5, 8, 32)
    screw = Screw("bolt", "base", "lid", "M3", 3e-3, 5e-4, 5e-3, 0.5, 0.2)
    shapes = {"base": base, "lid": lid, "bolt": bolt}
    return product_of(shapes, joints=(screw,), orders=(("base", "lid", "bolt"),))


def tube_and_pins() -> Product:
    """A plate with two through holes and headless pins that leave both ways, as a group."""
    plate = box((60, 30, 10), (-30, -15, 0))
    for x in (-15, 15):
        plate -= rod(6, -5, 15, 32).translate([x, 0, 0])
    pin = rod(6, 2, 30, 32)
    pins = {"pin_1": pin.translate([-15, 0, 0]), "pin_2": pin.translate([15, 0, 0])}
    return product_of({"plate": plate, **pins}, groups={"pins": ("pin_1", "pin_2")})
