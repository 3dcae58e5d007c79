"""Screw threads as CAD draws them, recognised from the meshes alone.

CAD usually draws a thread as two cylinders that overlap: the hole at the minor (or tap drill)
diameter, the bolt at the nominal one. Their common volume is a tube whose wall is as thick as a
thread is high. Such a tube is taken for a thread, whatever the names of the parts: the part inside
the tube is the bolt, the one around it has the inner thread, and the bolt is free to leave along
the tube's axis. The collar of a prevailing-torque nut is a short tube that the bolt passes through.

A tube too thin for any thread is a press fit, and a ring that is wider than it is long is a part
driven into a shoulder: an overlap. All is measured where it goes all around, in sections through
the axis, so that films between facets count for nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
from manifold3d import CrossSection, JoinType, OpType

from planning.feasibility.axial_sections import axial_sections, filled_widths
from planning.feasibility.screw_axis import fitted_axis, integration_points
from planning.feasibility.solids import Solid

THREAD_HEIGHT_PER_PITCH = 0.5413  # [S] ISO 68-1: 5/8 H = 0.5413 P from major to minor diameter.
LARGEST_PITCH = 0.25  # [S] ISO 261: of the diameter, M1 coarse; larger threads are finer.
SMALLEST_HEIGHT = 0.02  # [D] Of the diameter: 3/4 of the depth of a thread of pitch d / 20, fine.
ENGAGED = 0.15  # [S] ISO 261: of the diameter, a coarse pitch of M3 to M8; less holds nothing.
SLENDER = 2.0  # [A] Length of a thread by its height, at least, where the bolt ends in it.
DRILL_POINT = 0.6  # [S] DIN 338: length of a drill's point of 118 degrees by its radius.
ROUND = 0.04  # [A] Of the radius: sagitta of 12 facets, the coarsest circle that CAD exports.
PROBES = 8  # [A] Points about the axis at which a part is tested for material.
HEIGHTS = 400  # At which the wall of a tube is measured.
WALL = 0.3  # Sine of 17 degrees to the axis: walls are steeper, tips and countersinks are not.
SLIVER = 1e-3  # [A] Of the largest face: smaller ones are edges of films.
SAME = 1e-3  # [mm] Film that no section can tell from none.


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
        pitch: Along the axis from one turn of the thread to the next, negative if left-handed [m];
            None for a thread that is drawn as overlapping cylinders.
        starts: How many threads run side by side.
        both_ways: Whether nothing but the shape decides if the bolt leaves against the axis as
            well; False where a helical thread does not turn out that way.
    """

    bolt: str
    nut: str
    axis: tuple[float, float, float]
    p_AoT: tuple[float, float, float]
    diameter: float
    height: float
    length: float
    pitch: float | None = None
    starts: int = 1
    both_ways: bool = True


@dataclass(frozen=True)
class PressFit:
    """A pin that is thicker than its hole, by less than any thread is high.

    Attributes:
        pin: Name of the inner part.
        hole: Name of the part around it.
        axis: (3,) unit vector in A.
        diameter: Of the pin [m].
        interference: Radial depth of the overlap, where it goes all around [m].
        length: Of the fit [m].
    """

    pin: str
    hole: str
    axis: tuple[float, float, float]
    diameter: float
    interference: float
    length: float


def find_thread(a: Solid, b: Solid, tolerance: float) -> CadThread | None:
    """Return the thread that joins two overlapping parts, or None.

    Args:
        a: One part.
        b: The other part; either may be the bolt.
        tolerance: Overlap that does not count [m].
    """
    ring = _ring(a, b, tolerance)
    if ring is None:
        return None
    low, high = ring.run(ring.walls >= SMALLEST_HEIGHT * 2.0 * ring.outer)
    length, height = high - low, ring.wall_between(low, high)
    deep = (ring.walls > ring.largest) | (ring.walls > ring.outer / 2.0)
    # The tip of a bolt may be drawn into the cone that a drill leaves, not more.
    if height > ring.largest or deep.sum() * ring.step > DRILL_POINT * ring.outer:
        return None
    parts = _inside_out(a, b, ring, (low + high) / 2.0, height)
    if parts is None:
        return None
    bolt, nut = parts
    beyond = height + 1e3 * tolerance
    through = all(
        ring.fills(bolt, z, ring.outer - height / 2.0) for z in (low - beyond, high + beyond)
    )
    if length < (height if through else max(SLENDER * height, ENGAGED * 2.0 * ring.outer)):
        return None
    # The bolt leaves on the side on which it protrudes further from the nut.
    bolt_along, nut_along = bolt.vertices @ ring.axis, nut.vertices @ ring.axis
    ahead, behind = bolt_along.max() - nut_along.max(), nut_along.min() - bolt_along.min()
    middle = ring.centre + ring.axis * 1e-3 * (low + high) / 2.0
    px, py, pz = (float(value) for value in middle)
    return CadThread(
        bolt=bolt.name,
        nut=nut.name,
        axis=_rounded(ring.axis if ahead >= behind else -ring.axis),
        p_AoT=(px, py, pz),
        diameter=2e-3 * ring.outer,
        height=1e-3 * height,
        length=1e-3 * length,
    )


def find_press_fit(a: Solid, b: Solid, tolerance: float) -> PressFit | None:
    """Return the press fit of two overlapping parts, or None.

    It is a tube of overlap, deeper than the tolerance [m] and too thin for a thread, longer than
    its wall is thick; what else the two share is thinner than the tolerance.
    """
    ring = _ring(a, b, tolerance)
    if ring is None or ring.walls.max() >= SMALLEST_HEIGHT * 2.0 * ring.outer:
        return None
    low, high = ring.run(ring.walls > 0.0)
    depth = ring.wall_between(low, high)
    if high - low < ENGAGED * 2.0 * ring.outer or depth <= 1e3 * tolerance:
        return None
    parts = _inside_out(a, b, ring, (low + high) / 2.0, depth)
    if parts is None:
        return None
    names = parts[0].name, parts[1].name
    sizes = 2e-3 * ring.outer, 1e-3 * depth, 1e-3 * (high - low)
    return PressFit(*names, _rounded(ring.axis), *sizes)


def thickness(piece: manifold3d.Manifold) -> float:
    """Return 2 V / A [m]: exact for a thin layer, 2/3 of the radius for a ball."""
    return 2.0 * piece.volume() / piece.surface_area()


@dataclass(frozen=True, eq=False)
class _Ring:
    """Overlap of two parts that goes all around an axis.

    Attributes:
        axis: (3,) unit vector in A.
        centre: (3,) point on it, in A [m].
        outer: Radius of the overlap [mm].
        heights: (HEIGHTS,) along the axis from the centre [mm].
        walls: (HEIGHTS,) radial thickness of the overlap at each, where it is thinnest [mm].
        depths: (HEIGHTS,) the mean around the axis [mm].
        largest: Thickness up to which it may be a thread [mm].
    """

    axis: np.ndarray
    centre: np.ndarray
    outer: float
    heights: np.ndarray
    walls: np.ndarray
    depths: np.ndarray
    largest: float

    @property
    def step(self) -> float:
        """Distance between the heights [mm]."""
        return float(self.heights[1] - self.heights[0])

    def run(self, chosen: np.ndarray) -> tuple[float, float]:
        """Return the ends of the longest run of heights that are chosen [mm]."""
        edges = np.flatnonzero(np.diff(np.r_[False, chosen, False].astype(int)))
        if not len(edges):
            return 0.0, 0.0
        first, last = max(edges.reshape(-1, 2), key=lambda ends: ends[1] - ends[0])
        half = self.step / 2.0
        return float(self.heights[first] - half), float(self.heights[last - 1] + half)

    def wall_between(self, low: float, high: float) -> float:
        """Return the usual depth of the overlap between two heights [mm]."""
        chosen = self.depths[(self.heights > low) & (self.heights < high)]
        return float(np.median(chosen)) if len(chosen) else 0.0

    def fills(self, solid: Solid, height: float, radius: float) -> bool:
        """Return whether a part has material all around the axis at a height and radius [mm]."""
        side = np.linalg.svd(self.axis[None])[2][1]
        ray = np.cross(self.axis, side)
        middle = self.centre + 1e-3 * height * self.axis
        angles = 2.0 * np.pi * (np.arange(PROBES) + 0.37) / PROBES
        points = [middle + 1e-3 * radius * (np.cos(t) * side + np.sin(t) * ray) for t in angles]
        size = 0.02e-3 * radius
        probes = [manifold3d.Manifold.sphere(size, 6).translate(list(p)) for p in points]
        return all((solid.manifold ^ p).volume() > 0.5 * p.volume() for p in probes)


def _ring(a: Solid, b: Solid, tolerance: float) -> _Ring | None:
    """Return the overlap of two parts where it goes all around an axis, or None."""
    common = a.manifold ^ b.manifold
    if common.is_empty():
        return None
    axis, centre = _axis_of(common)
    sections = axial_sections(common, axis, centre)
    around = CrossSection.batch_boolean(sections, OpType.Intersect).simplify(SAME)
    if around.is_empty():
        return None
    _, low, outer, high = around.bounds()
    step = (high - low) / HEIGHTS
    heights = low + step * (np.arange(HEIGHTS) + 0.5)
    walls = filled_widths([around], 0.0, outer, heights)[0]
    # Whatever else they share, outside or beyond the tube, is an overlap of another kind, except
    # for films between the facets of the two circles.
    length, film = (high - low) / 2.0, ROUND * outer
    tube = CrossSection.square([outer + film + 1e3 * tolerance, 4.0 * length])
    tube = tube.translate([0.0, low - length])
    more = CrossSection.batch_boolean(sections, OpType.Add)
    _, bottom, _, top = more.bounds()
    films = CrossSection.square([2.0 * film, top - bottom]).translate([outer - film, bottom])
    more = more - tube - films
    if not more.offset(-1e3 * tolerance / 2.0, JoinType.Miter, 2.0).is_empty():
        return None
    largest = THREAD_HEIGHT_PER_PITCH * LARGEST_PITCH * 2.0 * outer + ROUND * outer
    depths = filled_widths(sections, 0.0, 2.0 * outer, heights).mean(axis=0)
    corners = 1e3 * (_wall_corners(_triangles(common), axis) - centre)
    radii = np.linalg.norm(np.cross(corners, axis), axis=1)
    outer = float(radii[radii < outer + film + 1e3 * tolerance].max(initial=0.0))
    if not outer > 0.0:
        return None
    return _Ring(axis, centre, outer, heights, walls, depths, largest + 1e3 * tolerance)


def _axis_of(common: manifold3d.Manifold) -> tuple[np.ndarray, np.ndarray]:
    """Return axis (3,) about which a volume is round, and a point on it [m]."""
    triangles = _triangles(common)
    points, normals, areas = integration_points(triangles)
    axis, centre, _ = fitted_axis(points, normals, areas)
    # Facets of two circles disturb that a little; straight walls and outermost corners are exact.
    walls = np.abs(normals @ axis) < WALL
    if walls.any():
        form = np.einsum("i,ij,ik->jk", areas[walls], normals[walls], normals[walls])
        axis = np.linalg.eigh(form)[1][:, 0]
    across = np.linalg.svd(axis[None])[2][1:]
    flat, middle = _wall_corners(triangles, axis) @ across.T, across @ centre
    for _ in range(2):  # Corners of the outer circle, as they are seen from the first centre.
        radii = np.linalg.norm(flat - middle, axis=1)
        outermost = flat[radii >= (radii.min() + radii.max()) / 2.0]
        system = np.c_[2.0 * outermost, np.ones(len(outermost))]
        squares = (outermost**2).sum(axis=1)
        middle = np.linalg.lstsq(system, squares, rcond=None)[0][:2]
    return axis, across.T @ middle + axis * (centre @ axis)


def _triangles(shape: manifold3d.Manifold) -> np.ndarray:
    """Return the corners of a volume's faces, (m, 3, 3) [m]."""
    mesh = shape.to_mesh64()
    return np.array(mesh.vert_properties)[:, :3][np.array(mesh.tri_verts, int)]


def _wall_corners(triangles: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return the corners (n, 3) of faces along an axis.

    Where faces lie on each other, films of common volume reach beyond a tube; their edges are far
    smaller than its walls.
    """
    first, second, third = (triangles[:, corner] for corner in range(3))
    doubled = np.cross(second - first, third - first)
    areas = np.linalg.norm(doubled, axis=1)
    walls = (np.abs(doubled @ axis) < WALL * areas) & (areas > SLIVER * areas.max(initial=0.0))
    return (triangles[walls] if walls.any() else triangles).reshape(-1, 3)


def _inside_out(
    a: Solid, b: Solid, ring: _Ring, height: float, wall: float
) -> tuple[Solid, Solid] | None:
    """Return the part inside a ring and the one around it, or None if neither is."""
    inner = ring.outer - wall
    radius = inner - min(ROUND * ring.outer, inner / 2.0)
    fills = [ring.fills(solid, height, radius) for solid in (a, b)]
    if fills[0] == fills[1]:
        return None
    return (a, b) if fills[0] else (b, a)


def _rounded(axis: np.ndarray) -> tuple[float, float, float]:
    """Return a unit vector without the rounding of zeros."""
    axis = np.where(np.abs(axis) < 1e-6, 0.0, axis)
    x, y, z = (float(value) + 0.0 for value in axis / np.linalg.norm(axis))
    return x, y, z
