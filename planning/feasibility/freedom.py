"""Local freedom of the parts of a step, and all ways out at an angle: a report for the reader.

What a plan needs of slanted directions it finds itself (``planning.ordering.further``). This looks
at one step more closely. Candidate directions come from contact: where two faces lie on each other,
the incoming part cannot move against the target's normal there. The directions that all those
normals allow form a cone; its edges (along two contact faces at once), the normals of its faces and
the axes of threads are tried, first against the contact normals, then exactly against the whole
shapes, as for the six.

Local freedom is the distance that a part can move before it hits something: the clearance to the
faces ahead of it, over their common projection. It is infinite only if the part leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planning.feasibility.blocking import decisions
from planning.feasibility.clipping import triangle_overlaps
from planning.feasibility.contact_normals import SAME_DIRECTION, contact_normals, distinct
from planning.feasibility.directions import DIRECTIONS, unit_vector
from planning.feasibility.envelope import Envelope, envelope
from planning.feasibility.face_pairs import overlapping_faces
from planning.feasibility.slanted import turned_to_z
from planning.feasibility.solids import Solid

ALONG = 0.01  # Sine of 0.6 degrees: sliding along a face, within its rounding.
MOST_NORMALS = 12  # Largest contact faces that candidates are made from.
MOST_CANDIDATES = 60  # Tried exactly, those with the widest angle to the contact faces first.


@dataclass(frozen=True)
class Freedom:
    """How far some parts can move along a direction.

    Attributes:
        direction: (3,) unit vector in A.
        travel: Distance until they hit [m]; infinite if they leave altogether.
        hits: Name of the part that is hit; "" if they leave.
    """

    direction: tuple[float, float, float]
    travel: float
    hits: str

    @property
    def leaves(self) -> bool:
        """Whether the parts leave to infinity."""
        return not self.hits


def freedoms(
    incoming: Sequence[Solid],
    target: Sequence[Solid],
    tolerance: float,
    axes: Sequence[Sequence[float]] = (),
) -> list[Freedom]:
    """Return how the incoming parts can move together while the target stays.

    Args:
        incoming: Parts that move as one.
        target: Parts that stay.
        tolerance: Largest overlap that does not block and largest gap that counts as contact [m].
        axes: Further directions to try, for example of threads.

    Returns:
        Those of the six directions along which the parts can move further than the tolerance, then
        the slanted ones along which they leave; furthest first within each.
    """
    six = [freedom_along(incoming, target, unit_vector(j), tolerance) for j in DIRECTIONS]
    moving = [freedom for freedom in six if freedom.travel > tolerance]
    normals = contact_normals(incoming, target, tolerance)
    slanted = [
        freedom_along(incoming, target, direction, tolerance)
        for direction in candidates(normals, np.array(axes, float).reshape(-1, 3))
    ]
    leaving = [freedom for freedom in slanted if freedom.leaves]
    return sorted(moving, key=lambda f: -f.travel) + leaving


def freedom_along(
    incoming: Sequence[Solid], target: Sequence[Solid], direction: np.ndarray, tolerance: float
) -> Freedom:
    """Return how far parts can move along one direction (3,)."""
    views = [
        [envelope(turned_to_z(solid, direction), axis=2) for solid in solids]
        for solids in (incoming, target)
    ]
    x, y, z = (float(value) for value in direction)
    furthest = Freedom((x, y, z), np.inf, "")
    for moving in views[0]:
        for staying in views[1]:
            decision = decisions([moving, staying], tolerance).get((0, 1))
            if decision is None or decision.point is None:
                continue
            travel = travel_along(moving, staying, tolerance)
            if travel < furthest.travel:
                furthest = Freedom((x, y, z), travel, staying.name)
    return furthest


def travel_along(moving: Envelope, staying: Envelope, tolerance: float) -> float:
    """Return how far a part moves up before it hits another one above it [m]."""
    pairs = overlapping_faces(moving.up, staying.down)
    if not len(pairs):
        return 0.0
    regions = triangle_overlaps(moving.up.corners[pairs.d], staying.down.corners[pairs.u])
    gap = staying.down.planes[pairs.u] - moving.up.planes[pairs.d]
    heights = (regions.closed() * gap[:, None, :2]).sum(axis=2) + gap[:, 2:]
    wide = (regions.count >= 3) & (regions.discs()[1] > tolerance / 4.0)
    ahead = heights[wide & (heights.max(axis=1) > -tolerance)]
    return max(0.0, float(ahead.min())) if len(ahead) else 0.0


def candidates(normals: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return directions (n, 3) that no contact normal forbids, other than the six.

    Args:
        normals: (k, 3) directions against which the parts cannot move.
        axes: (m, 3) further directions to try, both ways.
    """
    chosen = normals[:MOST_NORMALS]
    edges = [np.cross(a, b) for a, b in combinations(chosen, 2)]
    tried = np.array([*chosen, chosen.sum(axis=0), *edges, *axes]).reshape(-1, 3)
    lengths = np.linalg.norm(tried, axis=1)
    tried = tried[lengths > 1e-3] / lengths[lengths > 1e-3, None]
    tried = np.concatenate([tried, -tried])
    slanted = np.abs(tried).max(axis=1) < SAME_DIRECTION
    allowed = (tried @ normals.T >= -ALONG).all(axis=1) if len(normals) else slanted
    tried = tried[slanted & allowed]
    clear = (tried @ normals.T).min(axis=1) if len(normals) else np.zeros(len(tried))
    return distinct(tried, clear)[0][:MOST_CANDIDATES]
