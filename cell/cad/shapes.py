"""Solids for drawing parts (manifold3d) and well-shaped surfaces of revolution for contact.

Lengths are in metres. A solid of revolution has its axis along +z through the origin.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold

Point = Sequence[float]


def box(low: Point, high: Point) -> Manifold:
    """Return the axis-aligned box between two corners [m]."""
    size = np.subtract(high, low)
    return Manifold.cube(size.tolist()).translate(list(low))


def cylinder(radius: float, z_low: float, z_high: float, facets: int = 96) -> Manifold:
    """Return an upright cylinder; vertex 0 lies on +x, all vertices at ``radius``."""
    return Manifold.cylinder(z_high - z_low, radius, radius, facets).translate([0, 0, z_low])


def cone(r_low: float, r_high: float, z_low: float, z_high: float, facets: int = 96) -> Manifold:
    """Return an upright frustum with radius ``r_low`` at ``z_low`` and ``r_high`` at ``z_high``."""
    return Manifold.cylinder(z_high - z_low, r_low, r_high, facets).translate([0, 0, z_low])


def hexagon_prism(across_flats: float, z_low: float, z_high: float) -> Manifold:
    """Return a hexagonal prism with two corners on the x axis."""
    return cylinder(across_flats / np.sqrt(3.0), z_low, z_high, facets=6)


def shank(radius: float, z_low: float, z_high: float, chamfer: float, facets: int) -> Manifold:
    """Return a cylinder whose lower end has a 45 degree chamfer."""
    profile = [(0, z_low), (radius - chamfer, z_low), (radius, z_low + chamfer), (radius, z_high)]
    return _turn([*profile, (0, z_high)], facets)


def boss(radius: float, z_low: float, z_high: float, chamfer: float, facets: int = 96) -> Manifold:
    """Return a cylinder whose upper end has a 45 degree chamfer."""
    profile = [(0, z_low), (radius, z_low), (radius, z_high - chamfer), (radius - chamfer, z_high)]
    return _turn([*profile, (0, z_high)], facets)


def _turn(profile: Sequence[tuple[float, float]], facets: int) -> Manifold:
    """Return the solid that a half section (r, z) sweeps around the z axis."""
    return Manifold.revolve(CrossSection([np.array(profile, dtype=float)]), facets)


def to_trimesh(solid: Manifold) -> trimesh.Trimesh:
    """Return the closed surface of a solid [m]."""
    mesh = solid.to_mesh64()
    return trimesh.Trimesh(
        np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts), process=False
    )


def vertex_radius(mean_radius: float, facets: int) -> float:
    """Return the radius of the corners of a polygon whose corners and flats average to a radius.

    A faceted peg in a faceted hole then has the clearance of the round pair on average.
    """
    return mean_radius * 2.0 / (1.0 + np.cos(np.pi / facets))


def revolved_surface(
    profile: Sequence[tuple[float, float]], facets: int, center: Point = (0, 0), phase: float = 0.0
) -> trimesh.Trimesh:
    """Return the closed surface that a closed profile sweeps around the vertical through a centre.

    Args:
        profile: (m) corners (mean radius, z) [m], counter-clockwise with r right and z up, none on
            the axis. Every edge becomes one ring of ``2 * facets`` triangles, whose shape is
            thus up to the caller.
        facets: Number of sectors.
        center: (x, y) of the axis [m].
        phase: Angle of the first vertices, in sectors.
    """
    angle = 2.0 * np.pi * (np.arange(facets) + phase) / facets
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = [
        np.column_stack([vertex_radius(r, facets) * unit + center, np.full(facets, z)])
        for r, z in profile
    ]
    return trimesh.Trimesh(np.concatenate(rings), _ring_faces(len(profile), facets), process=False)


def open_band(
    profile: Sequence[tuple[float, float]], facets: int, center: Point = (0, 0), phase: float = 0.0
) -> trimesh.Trimesh:
    """Return the open surface of revolution of a line of (mean radius, z) corners [m].

    The arguments are those of `revolved_surface`; the surface faces right of the line.
    """
    band = revolved_surface(profile, facets, center, phase)
    # The last edge of the closed profile leads back to its start.
    kept = np.tile(np.repeat(np.arange(len(profile)) < len(profile) - 1, facets), 2)
    band.update_faces(kept)
    return band


def joined(surfaces: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return several surfaces as one, without merging corners."""
    first = np.cumsum([0, *(len(surface.vertices) for surface in surfaces[:-1])])
    return trimesh.Trimesh(
        np.concatenate([surface.vertices for surface in surfaces]),
        np.concatenate([s.faces + k for s, k in zip(surfaces, first, strict=True)]),
        process=False,
    )


def _ring_faces(rings: int, facets: int) -> np.ndarray:
    """Return (2 * rings * facets, 3) indices that join each ring of vertices to the next."""
    ring, sector = np.meshgrid(np.arange(rings), np.arange(facets), indexing="ij")
    here = (ring * facets + sector).ravel()
    beside = (ring * facets + (sector + 1) % facets).ravel()
    above = ((ring + 1) % rings * facets + sector).ravel()
    across = ((ring + 1) % rings * facets + (sector + 1) % facets).ravel()
    return np.concatenate(
        [np.column_stack([here, beside, across]), np.column_stack([here, across, above])]
    )


def convex_revolve(
    profile: Sequence[tuple[float, float]], facets: int, center: Point = (0, 0), phase: float = 0.0
) -> trimesh.Trimesh:
    """Return the convex solid with the given outline (mean radius, z) [m] about a vertical axis."""
    surface = revolved_surface(profile, facets, center, phase)
    return surface.convex_hull
