"""Screw threads, recognised from the meshes alone.

CAD usually draws a thread as two cylinders that overlap: the hole at the minor (or tap drill)
diameter, the bolt at the nominal one. Their common volume is a thin tube. What looks like that is
taken for a thread, whatever the parts are called: the part inside the tube is the bolt, the one
around it carries the thread, and the bolt is free to leave along the tube's axis.
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
FULL_TURN = 8  # [A] A tube shows itself in each of so many sectors about its axis.
COARSEST_FACET = 0.7  # [rad] [A] Nine facets a turn: the largest step between corners of a tube.


@dataclass(frozen=True)
class Thread:
    """A bolt in the part that carries its thread.

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


def find_thread(a: Solid, b: Solid, tolerance: float) -> Thread | None:
    """Return the thread by which two overlapping parts hold each other, or None.

    Args:
        a: One part.
        b: The other part; either may be the bolt.
        tolerance: Overlap that does not count [m].
    """
    common = a.manifold ^ b.manifold
    pieces = [piece for piece in common.decompose() if piece.volume() > 0.0]
    thick = [piece for piece in pieces if thickness(piece) > tolerance]
    if len(thick) != 1:  # A bolt is in one thread; several tubes are not one fastener.
        return None
    tube = _tube(thick[0], tolerance)
    if tube is None:
        return None
    axis, middle, inner, outer, length = tube
    radius = inner - min(ROUND * outer + tolerance, inner / 2)
    if _holds(a, middle, axis, radius) == _holds(b, middle, axis, radius):
        return None
    bolt, nut = (a, b) if _holds(a, middle, axis, radius) else (b, a)
    axis = _outwards(bolt, nut, axis)
    x, y, z = (float(value) for value in axis)
    px, py, pz = (float(value) for value in middle)
    height = outer - inner
    return Thread(bolt.name, nut.name, (x, y, z), (px, py, pz), 2.0 * outer, height, length)


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
    centre = _circle_centre(flat)
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
    if not _full_turn(triangles @ across - centre):
        return None
    middle = across @ centre + axis * float(along.min() + along.max()) / 2.0
    return axis, middle, inner, outer, length


def _circle_centre(points: np.ndarray) -> np.ndarray:
    """Return the centre (2,) of two concentric circles that points lie on, or between."""
    rough = _fitted_circle(points)
    radii = np.hypot(*(points - rough).T)
    return _fitted_circle(points[radii >= (radii.min() + radii.max()) / 2.0])


def _fitted_circle(points: np.ndarray) -> np.ndarray:
    """Return the centre of the least-squares circle: |p|^2 = 2 c.p + constant."""
    system = np.c_[2.0 * points, np.ones(len(points))]
    return np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0][:2]


def _full_turn(triangles: np.ndarray) -> bool:
    """Say whether projected triangles (m, 3, 2) go all around the origin with small steps."""
    angle = np.sort(np.arctan2(triangles[..., 1], triangles[..., 0]).ravel())
    steps = np.diff(angle, append=angle[0] + 2.0 * np.pi)
    return bool(steps.max() < COARSEST_FACET)


def _holds(solid: Solid, middle: np.ndarray, axis: np.ndarray, radius: float) -> bool:
    """Say whether a part fills the wall of a thin cylinder just inside the tube."""
    side = np.linalg.svd(axis[None])[2][1]
    ray = np.cross(axis, side)
    angles = 2.0 * np.pi * (np.arange(FULL_TURN) + 0.37) / FULL_TURN
    points = [middle + radius * (np.cos(t) * side + np.sin(t) * ray) for t in angles]
    size = 0.02 * radius
    probes = [manifold3d.Manifold.sphere(size, 6).translate(list(p)) for p in points]
    inside = [(solid.manifold ^ probe).volume() > 0.5 * probe.volume() for probe in probes]
    return all(inside)


def _outwards(bolt: Solid, nut: Solid, axis: np.ndarray) -> np.ndarray:
    """Return the axis, turned to the side on which the bolt reaches further out of the nut."""
    bolt_along, nut_along = bolt.vertices @ axis, nut.vertices @ axis
    ahead, behind = bolt_along.max() - nut_along.max(), nut_along.min() - bolt_along.min()
    return _clean(axis if ahead >= behind else -axis)


def _clean(axis: np.ndarray) -> np.ndarray:
    """Return the axis with the rounding of its zeros removed, of length 1."""
    axis = np.where(np.abs(axis) < 1e-6, 0.0, axis)
    return axis / np.linalg.norm(axis)
