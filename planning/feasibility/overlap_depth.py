"""How deep two parts overlap, and where: the depth where it is deepest, not an average.

The depth is the larger of two lengths:

- how far a point of one surface lies inside the other part, measured to that part's surface: 4 mm
  for a peg that sticks 4 mm into a block without a hole, the interference for a pin in its hole;
- the diameter of the largest ball in the common volume, for parts whose surfaces coincide, such as
  two copies of one part in one place.

Where faces lie on each other, rounding makes a film of common volume far thinner than any
tolerance, which may join a real overlap to a piece of large area. An average over the piece would
then say nothing; the deepest point does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import fcl
import manifold3d
import numpy as np

from planning.feasibility.solids import Solid, boxes_apart, surface_of

FEW, MOST = 600, 2400  # [A] Points on the surface of a piece at which the depth is measured.
CHORDS = 48  # [A] Chords through a piece, whose middles are tried as centres of a ball.
FILM = 1e-9  # [m] [D] Thinner common volume is rounding: float64 over 10 m, cubed by the boolean.


@dataclass(frozen=True)
class Depth:
    """The deepest place of an overlap.

    Attributes:
        depth: [m]; 0 where the parts share no volume.
        p_AoD: (3,) the place, in A [m].
        volume: Of the whole overlap [m3].
    """

    depth: float
    p_AoD: tuple[float, float, float]
    volume: float


NONE = Depth(0.0, (0.0, 0.0, 0.0), 0.0)


def overlap_of(a: Solid, b: Solid) -> Depth:
    """Return how deep two parts overlap where they do so most, and where that is."""
    if boxes_apart(a, b, 0.0):
        return NONE
    common = a.manifold ^ b.manifold
    pieces = [piece for piece in common.decompose() if piece.volume() > 0.0]
    found = [(depth, point) for piece in pieces for depth, point in _deepest(piece, a, b)]
    if not found:
        return NONE
    depth, point = max(found, key=lambda one: one[0])
    x, y, z = (float(value) for value in point)
    return Depth(depth, (x, y, z), common.volume()) if depth > FILM else NONE


def _deepest(piece: manifold3d.Manifold, a: Solid, b: Solid) -> Iterator[tuple[float, np.ndarray]]:
    """Yield depths [m] and places (3,) of a piece of common volume, the deepest of each kind."""
    fine = piece.refine(max(1, int(np.sqrt(FEW / piece.num_tri()))))
    mesh = fine.to_mesh64()
    vertices = np.array(mesh.vert_properties)[:, :3]
    corners = vertices[np.array(mesh.tri_verts, int)]
    points = np.concatenate([vertices, corners.mean(axis=1)])
    points = points[:: 1 + len(points) // MOST]
    for solid in (a, b):
        yield _furthest(points, solid.proximity)
    # The middles of chords that start on faces, widest first, and run across the piece.
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(doubled, axis=1)
    widest = np.argsort(-areas, kind="stable")
    widest = widest[areas[widest] > 0.0]
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    middles = []
    for face in widest[:: 1 + len(widest) // CHORDS]:
        start, inward = corners[face].mean(axis=0), -doubled[face] / areas[face]
        # From outside, so that the far side of a film is met before what lies beyond it.
        hits = piece.ray_cast(start - 1e-3 * size * inward, start + 2.0 * size * inward)
        places = [np.array(hit.position) for hit in hits]
        entry = next((n for n, at in enumerate(places) if (at - start) @ inward > -FILM), None)
        if entry is not None and entry + 1 < len(places):
            middles.append((places[entry] + places[entry + 1]) / 2.0)
    if middles:
        radius, centre = _furthest(np.array(middles), surface_of(corners))
        yield 2.0 * radius, centre


def _furthest(points: np.ndarray, surface: fcl.CollisionObject) -> tuple[float, np.ndarray]:
    """Return the largest distance of points (n, 3) from a surface [m], and that point."""
    probe = surface_of(np.zeros((1, 3, 3)))
    distances = []
    for point in points:
        probe.setTranslation(point)
        distances.append(fcl.distance(probe, surface))
    furthest = int(np.argmax(distances))
    return distances[furthest], points[furthest]
