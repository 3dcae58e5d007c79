"""Screw threads as CAD draws them, recognised from the meshes alone.

CAD usually draws a thread as two cylinders that overlap: the hole at the minor (or tap drill)
diameter, the bolt at the nominal one. Their common volume is a thin tube. Such a tube is taken for
a thread, whatever the names of the parts: the part inside the tube is the bolt, the one around it
has the inner thread, and the bolt is free to leave along the tube's axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np

from planning.feasibility.solids import Solid

THREAD_HEIGHT_PER_PITCH = 0.5413  # [S] ISO 68-1: 5/8 H = 0.5413 P from major to minor diameter.
LARGEST_PITCH = 0.25  # [S] ISO 261: of the diameter, M1 coarse; larger threads are finer.
SMALLEST_HEIGHT = 0.02  # [D] Of the diameter: 3/4 of the depth of a thread of pitch d / 20, fine.
ROUND = 0.04  # [A] Of the radius: sagitta of 12 facets, the coarsest circle that CAD exports.
PROBES = 8  # [A] Points about the axis at which a part is tested for material.
COARSEST_FACET = 0.7  # [rad] [A] Nine facets a turn: the largest step between corners of a tube.


@dataclass(frozen=True)
class CadThread:
    """A bolt in the part with its inner thread, as an overlap of their meshes.

    Attributes:
        bolt: Name of the part with the outer thread.
        nut: Name of the part with the inner thread.
        axis: (3,) unit vector in A along which the bolt leaves the nut.
        p_AoT: (3,) middle of the engaged thread on its axis, in A [m].
        diameter: Outer diameter of the overlap, the thread's nominal one [m].
        height: Radial depth of the overlap [m].
        length: Of the engaged thread [m].
    """

    bolt: str
    nut: str
    axis: tuple[float, float, float]
    p_AoT: tuple[float, float, float]
    diameter: float
    height: float
    length: float


def find_thread(a: Solid, b: Solid, tolerance: float) -> CadThread | None:
    """Return the thread that joins two overlapping parts, or None.

    Args:
        a: One part.
        b: The other part; either may be the bolt.
        tolerance: Overlap that does not count [m].
    """
    common = a.manifold ^ b.manifold
    pieces = [piece for piece in common.decompose() if piece.volume() > 0.0]
    thick = [piece for piece in pieces if thickness(piece) > tolerance]
    if len(thick) != 1:  # A bolt has one thread; several tubes are not one fastener.
        return None
    tube = _tube(thick[0], tolerance)
    if tube is None:
        return None
    axis, middle, inner, outer, length = tube
    radius = inner - min(ROUND * outer + tolerance, inner / 2)
    if _fills(a, middle, axis, radius) == _fills(b, middle, axis, radius):
        return None
    bolt, nut = (a, b) if _fills(a, middle, axis, radius) else (b, a)
    # The bolt leaves on the side on which it protrudes further from the nut.
    bolt_along, nut_along = bolt.vertices @ axis, nut.vertices @ axis
    ahead, behind = bolt_along.max() - nut_along.max(), nut_along.min() - bolt_along.min()
    axis = axis if ahead >= behind else -axis
    axis = np.where(np.abs(axis) < 1e-6, 0.0, axis)  # Rounding of zeros.
    axis = axis / np.linalg.norm(axis)
    x, y, z = (float(value) for value in axis)
    px, py, pz = (float(value) for value in middle)
    height = outer - inner
    return CadThread(bolt.name, nut.name, (x, y, z), (px, py, pz), 2.0 * outer, height, length)


def thickness(piece: manifold3d.Manifold) -> float:
    """Return 2 V / A [m]: exact for a thin layer, 2/3 of the radius for a ball."""
    return 2.0 * piece.volume() / piece.surface_area()


def _tube(
    piece: manifold3d.Manifold, tolerance: float
) -> tuple[np.ndarray, np.ndarray, float, float, float] | None:
    """Return axis, middle, inner and outer radius, and length of a thin tube; None for others."""
    mesh = piece.to_mesh64()
    vertices = np.array(mesh.vert_properties)[:, :3]
    triangles = vertices[np.array(mesh.tri_verts, int)]
    doubled = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(doubled, axis=1)
    normals = doubled / np.maximum(areas, 1e-30)[:, None]
    # The walls' normals lie across the axis; those along it, of the narrow ends, add little.
    _, vectors = np.linalg.eigh(np.einsum("i,ij,ik->jk", areas, normals, normals))
    axis = vectors[:, 0]
    across = vectors[:, 1:]
    flat = vertices @ across
    # Two concentric circles: the first fit is between them, the second on the outer one.
    rough = _fitted_centre(flat)
    radii = np.hypot(*(flat - rough).T)
    centre = _fitted_centre(flat[radii >= (radii.min() + radii.max()) / 2.0])
    radii = np.hypot(*(flat - centre).T)
    inner, outer = float(radii.min()), float(radii.max())
    along = vertices @ axis
    length = float(np.ptp(along))
    limit = THREAD_HEIGHT_PER_PITCH * LARGEST_PITCH * 2.0 * outer + ROUND * outer + tolerance
    height = outer - inner
    if inner < 0.5 * outer or not SMALLEST_HEIGHT * 2.0 * outer <= height <= limit:
        return None
    if length < 2.0 * height:
        return None
    # A tube surrounds its axis without a gap: no large step between the angles of its corners.
    seen = triangles @ across - centre
    angle = np.sort(np.arctan2(seen[..., 1], seen[..., 0]).ravel())
    if np.diff(angle, append=angle[0] + 2.0 * np.pi).max() >= COARSEST_FACET:
        return None
    middle = across @ centre + axis * float(along.min() + along.max()) / 2.0
    return axis, middle, inner, outer, length


def _fitted_centre(points: np.ndarray) -> np.ndarray:
    """Return the centre of the least-squares circle: |p|^2 = 2 c.p + constant."""
    system = np.c_[2.0 * points, np.ones(len(points))]
    return np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0][:2]


def _fills(solid: Solid, middle: np.ndarray, axis: np.ndarray, radius: float) -> bool:
    """Return whether a part has material all around the axis at a radius just inside the tube."""
    side = np.linalg.svd(axis[None])[2][1]
    ray = np.cross(axis, side)
    angles = 2.0 * np.pi * (np.arange(PROBES) + 0.37) / PROBES
    points = [middle + radius * (np.cos(t) * side + np.sin(t) * ray) for t in angles]
    size = 0.02 * radius
    probes = [manifold3d.Manifold.sphere(size, 6).translate(list(p)) for p in points]
    inside = [(solid.manifold ^ probe).volume() > 0.5 * probe.volume() for probe in probes]
    return all(inside)
