"""Screw threads as CAD draws them, recognised from the meshes alone.

CAD usually draws a thread as two cylinders that overlap: the hole at the minor (or tap drill)
diameter, the bolt at the nominal one. Their common volume is a thin tube. Such a tube is taken for
a thread, whatever the names of the parts: the part inside the tube is the bolt, the one around it
has the inner thread, and the bolt is free to leave along the tube's axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import manifold3d
import numpy as np

from planning.feasibility.solids import Solid

THREAD_HEIGHT_PER_PITCH = 0.5413  # [S] ISO 68-1: 5/8 H = 0.5413 P from major to minor diameter.
LARGEST_PITCH = 0.25  # [S] ISO 261: of the diameter, M1 coarse; larger threads are finer.
SMALLEST_HEIGHT = 0.02  # [D] Of the diameter: 3/4 of the depth of a thread of pitch d / 20, fine.
ROUND = 0.04  # [A] Of the radius: sagitta of 12 facets, the coarsest circle that CAD exports.
PROBES = 8  # [A] Points about the axis at which a part is tested for material.
SIDES = 5  # [A] Faces that are tried for walls, the largest that face different ways.
STRAIGHT = 0.02  # [A] Sine of 1 degree, and 1 less the cosine of 11: walls across, ends along.
WALL = 0.5  # Cosine: faces within 60 degrees of the axis are ends, as of chamfers.
RARE = 0.05  # [A] Of the walls' area, by which single slivers do not set a radius.
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
    inside = [_fills(solid, middle, axis, radius) for solid in (a, b)]
    if inside[0] == inside[1]:
        return None
    bolt, nut = (a, b) if inside[0] else (b, a)
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
    axis = _axis_of(normals, areas)
    if axis is None:
        return None
    across = np.linalg.svd(axis[None])[2][1:].T
    length = float(np.ptp(vertices @ axis))
    # Films of rounding, where the bolt's end or head lies on the nut, belong to neither wall.
    walls = np.abs(normals @ axis) < WALL
    triangles, areas, facing = triangles[walls], areas[walls], (normals @ across)[walls]
    if not len(triangles):
        return None
    seen = triangles @ across
    centre = _centre_of_walls(seen, facing, areas)
    outward = (facing * (seen.mean(axis=1) - centre)).sum(axis=1) > 0.0
    radii = np.linalg.norm(seen - centre, axis=2)
    inner = _usual(radii[~outward], areas[~outward], RARE)
    outer = _usual(radii[outward], areas[outward], 1.0 - RARE)
    limit = THREAD_HEIGHT_PER_PITCH * LARGEST_PITCH * 2.0 * outer + ROUND * outer + tolerance
    height = outer - inner
    if inner < 0.5 * outer or not SMALLEST_HEIGHT * 2.0 * outer <= height <= limit:
        return None
    if length < 2.0 * height:
        return None
    # A tube surrounds its axis without a gap: no large step between the angles of its corners.
    angle = np.sort(np.arctan2(*(seen - centre).reshape(-1, 2).T[::-1]))
    if np.diff(angle, append=angle[0] + 2.0 * np.pi).max() >= COARSEST_FACET:
        return None
    along = vertices @ axis
    middle = across @ centre + axis * float(along.min() + along.max()) / 2.0
    return axis, middle, inner, outer, length


def _axis_of(normals: np.ndarray, areas: np.ndarray) -> np.ndarray | None:
    """Return the unit vector that most of a tube's faces lie along or across, None for no tube.

    Any two walls determine it. They are taken from the largest faces, of which those of a film at
    an end all face the same way.
    """
    largest = np.argsort(-areas)
    chosen: list[np.ndarray] = []
    while len(chosen) < SIDES and len(largest):
        chosen.append(normals[largest[0]])
        largest = largest[np.abs(normals[largest] @ chosen[-1]) < 1.0 - STRAIGHT]
    tried = np.array([np.cross(a, b) for a, b in combinations(chosen, 2)]).reshape(-1, 3)
    if not len(tried):
        return None
    tried /= np.linalg.norm(tried, axis=1)[:, None]
    cosine = np.abs(normals @ tried.T)
    fitting = areas @ ((cosine < STRAIGHT) | (cosine > 1.0 - STRAIGHT))
    return tried[int(fitting.argmax())]


def _centre_of_walls(seen: np.ndarray, normals: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """Return the point (2,) at which the lines across all walls, through their middles, meet.

    Least squares weighted by area, so that it does not matter into which triangles a wall is cut.

    Args:
        seen: (m, 3, 2) corners of the triangles across the axis [m].
        normals: (m, 2) their normals, across the axis.
        areas: (m,) their weights.
    """
    along = np.c_[-normals[:, 1], normals[:, 0]]
    weight = np.sqrt(areas)[:, None]
    offset = (along * seen.mean(axis=1)).sum(axis=1)
    return np.linalg.lstsq(weight * along, weight[:, 0] * offset, rcond=None)[0]


def _usual(radii: np.ndarray, areas: np.ndarray, share: float) -> float:
    """Return the radius below which a share of the walls lies; 0 if there are none.

    Args:
        radii: (m, 3) of the corners of the walls' triangles [m].
        areas: (m,) of the triangles.
        share: Of the area, from 0 to 1.
    """
    if not len(radii):
        return 0.0
    order = np.argsort(radii, axis=None)
    below = np.cumsum(np.repeat(areas, 3)[order])
    return float(radii.ravel()[order[np.searchsorted(below, share * below[-1])]])


def _fills(solid: Solid, middle: np.ndarray, axis: np.ndarray, radius: float) -> bool:
    """Return whether a part has material all around the axis at a radius just inside the tube."""
    side = np.linalg.svd(axis[None])[2][1]
    ray = np.cross(axis, side)
    angles = 2.0 * np.pi * (np.arange(PROBES) + 0.37) / PROBES
    points = [middle + radius * (np.cos(t) * side + np.sin(t) * ray) for t in angles]
    probe = manifold3d.Manifold.sphere(0.02 * radius, 6)
    probes = manifold3d.Manifold.compose([probe.translate(list(p)) for p in points])
    found = [piece.volume() for piece in (solid.manifold ^ probes).decompose()]
    return sum(volume > 0.5 * probe.volume() for volume in found) == PROBES
