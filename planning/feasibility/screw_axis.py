"""The axis about which two interlocking surfaces could turn against each other, from their normals.

A surface that slides on itself under a screw motion satisfies n . (v + w x p) = 0 at each of its
points p with normal n: solids of revolution, cylinders and threads do. The motion for which this
holds best on the faces that two parts turn towards each other is the smallest eigenvector of a
quadratic form in (v, w) ("slippage": Gelfand and Guibas, Shape segmentation using local slippage
analysis, 2004). Faces that do not fit, such as the flats of a nut, lose their weight as the fit is
repeated. Only the axis is taken from it: the pitch is weakly determined by normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from planning.feasibility.solids import Solid

# [m] [A] Largest gap of an engaged thread: 0.3 mm of a print and its facets, with a third more.
THREAD_CLEARANCE = 4e-4
SAMPLES = 4000  # Points on each part: 0.2 mm apart on an M8 nut.
MOST_FACES = 8_000  # Of each part that are looked at: every second, third ... of larger ones.
DEGREE_TWO = (np.ones((3, 3)) + 3.0 * np.eye(3)) / 6.0  # Barycentric points that integrate exactly.
FEWEST = 50  # Near points of each part below which nothing can be said about its shape.
ROUNDS = 12  # Repetitions of the fit, until its weights have settled.
STRAY = 0.15  # Sine of 9 degrees: half a facet of 20 a turn; larger residuals lose their weight.
PLANE_END = 0.99  # Cosine of 8 degrees to the axis.
FINEST = 1e-3  # Sine below which all residuals count alike.
SLIDING = 0.6  # [A] Of the near surface must slide on itself: the rest are ends and chamfers.


@dataclass(frozen=True, eq=False)
class ScrewAxis:
    """An axis that two parts share, and which of them is inside.

    Attributes:
        axis: (3,) unit vector in A.
        p_AoC: (3,) point on it, in A [m].
        outward: Mean of n . e_r over the near faces of each part, e_r away from the axis: positive
            for a bolt, negative for a nut.
    """

    axis: np.ndarray
    p_AoC: np.ndarray
    outward: tuple[float, float]


def screw_axis(a: Solid, b: Solid) -> ScrewAxis | None:
    """Return the axis about which the near faces of two parts are round, or None."""
    low = np.maximum(a.lower, b.lower) - THREAD_CLEARANCE
    high = np.minimum(a.upper, b.upper) + THREAD_CLEARANCE
    own_a, own_b = (_sampled(solid, low, high) for solid in (a, b))
    if own_a is None or own_b is None:
        return None
    points, normals, areas, of_a = _near(own_a, own_b)
    if min(of_a.sum(), (~of_a).sum()) < FEWEST:
        return None
    axis, centre, residuals = fitted_axis(points, normals, areas)
    # Plane ends slide on themselves if nothing advances, and would draw the fit towards that.
    walls = np.abs(normals @ axis) < PLANE_END
    if min(walls[of_a].sum(), walls[~of_a].sum()) < FEWEST:
        return None
    axis, centre, residuals = fitted_axis(points[walls], normals[walls], areas[walls])
    points, normals, areas, of_a = points[walls], normals[walls], areas[walls], of_a[walls]
    if np.average(residuals < STRAY, weights=areas) < SLIDING:
        return None
    radial = points - centre
    radial -= np.outer(radial @ axis, axis)
    radial /= np.maximum(np.linalg.norm(radial, axis=1), 1e-12)[:, None]
    out = (normals * radial).sum(axis=1)
    inner, outer = (float(np.average(out[w], weights=areas[w])) for w in (of_a, ~of_a))
    return ScrewAxis(axis, centre, (inner, outer))


def integration_points(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return three points on each triangle (m, 3, 3) [m], their normals, and areas they stand for.

    Their weighted sum is the exact integral of a quadratic form over the triangles.
    """
    first, second, third = (triangles[:, corner] for corner in range(3))
    doubled = np.cross(second - first, third - first)
    lengths = np.linalg.norm(doubled, axis=1)
    normals = doubled / np.maximum(lengths, 1e-30)[:, None]
    points = np.einsum("ij,ljk->lik", DEGREE_TWO, triangles).reshape(-1, 3)
    return points, np.repeat(normals, 3, axis=0), np.repeat(lengths / 6.0, 3)


def fitted_axis(
    points: np.ndarray, normals: np.ndarray, areas: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return axis (3,), point on it (3,) [m], and sines of how far each normal is off (n,)."""
    middle = points.mean(axis=0)
    size = float(np.linalg.norm(points - middle, axis=1).mean())
    x = (points - middle) / size
    rows = np.concatenate([normals, np.cross(x, normals)], axis=1)  # n . v + (x x n) . w
    weights = areas
    axis, velocity, residuals = np.zeros(3), np.zeros(3), areas
    for _ in range(ROUNDS):
        form = (rows * weights[:, None]).T @ rows
        solved = np.linalg.lstsq(form[:3, :3], form[:3, 3:], rcond=1e-9)[0]
        axis = np.linalg.eigh(form[3:, 3:] - form[3:, :3] @ solved)[1][:, 0]
        velocity = -solved @ axis
        speed = np.linalg.norm(velocity + np.cross(axis, x), axis=1)
        residuals = np.abs(rows @ np.r_[velocity, axis]) / np.maximum(speed, 1e-9)
        scale = float(np.clip(2.0 * np.median(residuals), FINEST, STRAY))
        weights = areas / (1.0 + (residuals / scale) ** 2) ** 2
    return axis, middle + size * np.cross(axis, velocity), residuals


@dataclass(frozen=True, eq=False)
class _Surface:
    """Faces of a part in a box: three points on each, and points spread evenly.

    Attributes:
        points: (n, 3) by whose mean a quadratic form is integrated exactly over each face [m].
        normals: (n, 3) at them.
        areas: (n,) that each stands for [m2].
        spread: (SAMPLES, 3) uniform by area [m].
        spacing: Between those [m].
    """

    points: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    spread: np.ndarray
    spacing: float


def _sampled(solid: Solid, low: np.ndarray, high: np.ndarray) -> _Surface | None:
    face_low, face_high = solid.face_boxes
    faces = np.flatnonzero((face_low <= high).all(axis=1) & (face_high >= low).all(axis=1))
    faces = faces[:: 1 + len(faces) // MOST_FACES]
    doubled, corners = solid.doubled_areas[faces], solid.triangles[faces]
    areas = np.linalg.norm(doubled, axis=1) / 2.0
    if not areas.sum() > 0.0:
        return None
    ends = np.cumsum(areas)
    rng = np.random.default_rng(0)
    chosen = np.searchsorted(ends, ends[-1] * rng.random(SAMPLES)).clip(0, len(faces) - 1)
    weights = rng.dirichlet(np.ones(3), SAMPLES)
    spread = np.einsum("ij,ijk->ik", weights, corners[chosen])
    spacing = float(np.sqrt(ends[-1] / SAMPLES))
    return _Surface(*integration_points(corners), spread, spacing)


def _near(a: _Surface, b: _Surface) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the points of both surfaces near the other, normals, areas, and which are a's."""
    reach = THREAD_CLEARANCE + max(a.spacing, b.spacing)
    near = [
        KDTree(other.spread).query(own.points, distance_upper_bound=reach)[0] <= reach
        for own, other in ((a, b), (b, a))
    ]
    points, normals, areas = (
        np.concatenate([values[which] for values, which in zip(pair, near, strict=True)])
        for pair in ((a.points, b.points), (a.normals, b.normals), (a.areas, b.areas))
    )
    return points, normals, areas, np.arange(len(points)) < near[0].sum()
