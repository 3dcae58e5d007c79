"""A part's pose from depth images of several views, by matching its surface point to plane.

From a start that is a few millimetres and degrees off, the measured points are paired with the
nearest points of the surface that face the camera, and the pose is moved until their distances
across the surface are least (Chen and Medioni, Object modelling by registration of multiple range
images, 1992). Pairs are taken from a shrinking neighbourhood and weighted by a robust loss, since
the part stands in a bag whose surface no model describes. The start may be turned too far to lead
there: others, turned further about the vertical, tilted and shifted, are tried with few points, and
the best of them are carried on with all.

What a look hardly shows, such as the yaw of a plate sunk into the bag up to its face, is decided by
whatever happens to lie beside the part. A prior estimate holds it: it enters as one more
measurement, weighted by its covariance. Only if a free pose fits clearly better has the part moved
meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from cell.machines.cameras.camera import Picture
from planning.perception.surface import Sides, Surface

Array = NDArray[np.float64]

MARGIN = 8e-3  # Of the region about the believed pose that is looked at [m] [A].
POINTS = 2_000  # Of each view; more say the same again [M].
FEWEST = 60  # Pairs of all views, below which there is nothing to go by.
THIN = 5  # Of so many points one is used to choose among the starts.
# Rotation vectors of the starts, in W [deg]: the yaw of a placed part is known worst.
STARTS_DEG = (
    *((0.0, 0.0, yaw) for yaw in (0.0, -8.0, 8.0, -16.0, 16.0)),
    *((x, y, 0.0) for x, y in ((10.0, 0.0), (-10.0, 0.0), (0.0, 10.0), (0.0, -10.0))),
)
# Of further starts beside the best of these, in W [m]: a flat face lets the part slide.
SHIFTS = tuple(
    np.array(shift) for shift in ((4e-3, 0, 0), (-4e-3, 0, 0), (0, 4e-3, 0), (0, -4e-3, 0))
)
KEPT = 2  # Of all.
LEVELS = (-2.0, -1.0, 0.0, 1.0, 2.0)  # Of `starts_within`, in standard deviations.
CERTAIN = (*(np.deg2rad(0.5),) * 3, *(1e-3,) * 3)  # What is known better needs no start [rad, m].
REACH, LEAST_REACH, SHRINK = 4e-3, 1.2e-3, 0.8  # Of a pair at first and at last [m], per round.
LOSS = 6e-4  # Distances beyond this lose their weight [m]: 1.5 of a D435's at 0.32 m.
ROUNDS = 40
STILL = 2e-6  # A round that moves and turns by less is the last [m, rad].
# Errors are larger than independent distances would make them: the noise of neighbours is alike,
# and the points of the surface have a spacing [M: `python -m experiments.evaluate_pose`].
OPTIMISM = 2.5
# A pose that does not heed the prior has to fit that much better: its residual over that of the
# held one [A]. Of a plate sunk to its face, poses 9 to 15 degrees off in yaw: 1.0 to 1.13; one that
# had moved by 5 mm and 5 degrees: 0.87 to 0.94 [M].
CLEARLY = 0.95


@dataclass(frozen=True, eq=False)
class View:
    """Measured points and where they were seen from.

    Attributes:
        points: (n, 3) p_WQ [m].
        p_WC: (3,) position of the camera [m].
    """

    points: Array
    p_WC: Array


@dataclass(frozen=True, eq=False)
class Registration:
    """A registered pose.

    Attributes:
        X_WP: The pose.
        covariance: (6, 6) of its error, ordered as in `planning.perception.belief.Estimate`.
        residual: Mean distance of the points across the surface, those without a partner counted
            as `LEAST_REACH` [m].
        share: Of the points that have a partner.
    """

    X_WP: RigidTransform
    covariance: Array
    residual: float
    share: float


def views_of(
    pictures: Iterable[Picture], surface: Surface, X_WP: RigidTransform, rng: np.random.Generator
) -> list[View]:
    """Return what pictures show near the believed pose of a part.

    Args:
        pictures: With depth.
        surface: Of the part.
        X_WP: Believed pose.
        rng: Chooses among too many points.
    """
    views = (View(picture.points(), picture.X_WC.translation()) for picture in pictures)
    return [near_to(view, surface, X_WP, rng) for view in views]


def near_to(view: View, surface: Surface, X_WP: RigidTransform, rng: np.random.Generator) -> View:
    """Return what a view shows near the believed pose of a part, see `views_of`."""
    p_PQ = _in(X_WP, view.points)
    near = ((p_PQ > surface.lower - MARGIN) & (p_PQ < surface.upper + MARGIN)).all(axis=1)
    chosen = np.flatnonzero(near)
    if len(chosen) > POINTS:
        chosen = rng.choice(chosen, POINTS, replace=False)
    return View(view.points[chosen], view.p_WC)


def starts_within(X_WP: RigidTransform, covariance: Array) -> list[RigidTransform]:
    """Return poses up to two standard deviations away along all axes that are uncertain.

    A large part, seen from nearly above, is found from a few millimetres and degrees around only.

    Args:
        X_WP: Believed pose.
        covariance: (6, 6) of its error; what correlates is not looked at.
    """
    sigma = np.sqrt(np.diag(covariance))
    axes = [LEVELS if s > least else (0.0,) for s, least in zip(sigma, CERTAIN, strict=True)]
    starts = []
    for levels in product(*axes):
        step = np.array(levels) * sigma
        turn = RotationMatrix(Rotation.from_rotvec(step[:3]).as_matrix())
        shift = RigidTransform(step[3:])
        starts.append(shift @ X_WP @ RigidTransform(turn, np.zeros(3)))
    return starts


def register(
    surface: Surface,
    views: Sequence[View],
    X_WP: RigidTransform,
    more: Iterable[RigidTransform] = (),
    covariance: Array | None = None,
) -> Registration | None:
    """Return the pose that fits the views best, or None if they show too little of the part.

    Args:
        surface: Of the part.
        views: At least one.
        X_WP: Believed pose: the start.
        more: Further starts.
        covariance: (6, 6) of the error of the believed pose, which then holds what the views leave
            open; None: it is a start and nothing more.
    """
    sides = Sides(surface)
    few = [View(view.points[::THIN], view.p_WC) for view in views]
    centre = RigidTransform(X_WP @ surface.centre)
    turns = (RotationMatrix(Rotation.from_rotvec(t).as_matrix()) for t in np.deg2rad(STARTS_DEG))
    turned = [centre @ RigidTransform(R, np.zeros(3)) @ centre.inverse() @ X_WP for R in turns]
    tried = _best(sides, few, [*turned, *more], FEWEST // THIN)
    if not tried:
        return None
    shifted = [RigidTransform(shift) @ tried[0].X_WP for shift in SHIFTS]
    tried += _best(sides, few, shifted, FEWEST // THIN)
    tried.sort(key=lambda one: one.residual)
    ends = _best(sides, views, [one.X_WP for one in tried[:KEPT]], FEWEST)
    free = ends[0] if ends else None
    if covariance is None:
        return free
    information = np.asarray(np.linalg.inv(covariance), float)
    held = _registered(sides, views, X_WP, FEWEST, _Prior(X_WP, information))
    if held is None or (free is not None and free.residual < CLEARLY * held.residual):
        return free
    return held


@dataclass(frozen=True, eq=False)
class _Prior:
    """What is known of a pose beside the views: its mean, and (6, 6) the inverse covariance."""

    X_WP: RigidTransform
    information: Array

    def add_to(self, sums: _Sums, X_WP: RigidTransform) -> None:
        """Add it to the normal equations of pairs at a pose, in units of what a distance counts."""
        turn = self.X_WP.rotation().inverse() @ X_WP.rotation()
        rotation = Rotation.from_matrix(turn.matrix()).as_rotvec()
        off = np.r_[rotation, X_WP.translation() - self.X_WP.translation()]
        # A motion (w, v) of the points turns the pose by -w about P, and shifts it by -R v in W.
        J = np.zeros((6, 6))
        J[:3, :3], J[3:, 3:] = np.eye(3), X_WP.rotation().matrix()
        weighted = (OPTIMISM * sums.spread) ** 2 * J.T @ self.information
        sums.form += weighted @ J
        sums.side += weighted @ off


@dataclass
class _Sums:
    """Normal equations of the pairs of all views, for a small motion (w, v) of points in P."""

    form: Array
    side: Array
    distances: list[Array]
    pairs: int = 0

    @property
    def spread(self) -> float:
        """Standard deviation of a distance, by the median of their sizes [m]."""
        return 1.4826 * float(np.median(np.abs(np.concatenate(self.distances))))


def _best(
    sides: Sides, views: Sequence[View], starts: Iterable[RigidTransform], fewest: int
) -> list[Registration]:
    """Return where starts lead, that of the least residual first."""
    found = [_registered(sides, views, X_WP, fewest) for X_WP in starts]
    return sorted((one for one in found if one is not None), key=lambda one: one.residual)


def _registered(
    sides: Sides,
    views: Sequence[View],
    X_WP: RigidTransform,
    fewest: int,
    prior: _Prior | None = None,
) -> Registration | None:
    """Return the pose to which one start leads, or None with fewer pairs than that."""
    total = sum(len(view.points) for view in views)
    reach = REACH
    sums = _summed(sides, views, X_WP, reach, prior)
    for _ in range(ROUNDS):
        if sums.pairs < fewest:
            return None
        damping = 1e-9 * np.trace(sums.form) * np.eye(6)
        step = np.linalg.solve(sums.form + damping, sums.side)
        moved = RigidTransform(RotationMatrix(Rotation.from_rotvec(step[:3]).as_matrix()), step[3:])
        X_WP = X_WP @ moved.inverse()
        X_WP = RigidTransform(RotationMatrix.ProjectToRotationMatrix(X_WP.rotation().matrix()),
                              X_WP.translation())  # fmt: skip
        if reach == LEAST_REACH and np.abs(step).max() < STILL:
            break
        reach = max(LEAST_REACH, SHRINK * reach)
        sums = _summed(sides, views, X_WP, reach, prior)
    if sums.pairs < fewest:
        return None
    distances, spread = np.concatenate(sums.distances), sums.spread
    lost = (total - sums.pairs) * LEAST_REACH
    residual = (np.minimum(np.abs(distances), LEAST_REACH).sum() + lost) / max(total, 1)
    return Registration(
        X_WP, _covariance(sums, spread, X_WP), float(residual), sums.pairs / max(total, 1)
    )


def _summed(
    sides: Sides, views: Sequence[View], X_WP: RigidTransform, reach: float, prior: _Prior | None
) -> _Sums:
    """Return the normal equations of all pairs within a reach [m], and of what is known before."""
    sums = _Sums(np.zeros((6, 6)), np.zeros(6), [])
    for view in views:
        side = sides.facing(_in(X_WP, view.p_WC[None])[0])
        if side is None or not len(view.points):
            continue
        p_PQ = _in(X_WP, view.points)
        apart, partner = map(np.asarray, side.tree.query(p_PQ, distance_upper_bound=reach))
        near = np.isfinite(apart)
        p, n = p_PQ[near], side.normals[partner[near]]
        distance = np.einsum("ij,ij->i", p - side.points[partner[near]], n)
        weight = 1.0 / np.sqrt(1.0 + (distance / LOSS) ** 2)
        rows = np.concatenate([np.cross(p, n), n], axis=1)
        sums.form += (rows * weight[:, None]).T @ rows
        sums.side -= (rows * weight[:, None]).T @ distance
        sums.distances.append(distance)
        sums.pairs += len(p)
    if prior is not None and sums.pairs:
        prior.add_to(sums, X_WP)
    return sums


def _covariance(sums: _Sums, spread: float, X_WP: RigidTransform) -> Array:
    """Return the covariance of a pose: turns about the axes of P, offsets along those of W.

    Args:
        sums: Of the last round.
        spread: Standard deviation of a distance [m].
        X_WP: The pose.
    """
    form = sums.form + 1e-9 * np.trace(sums.form) * np.eye(6)
    R = np.kron(np.diag([1.0, 0.0]), np.eye(3))
    R[3:, 3:] = X_WP.rotation().matrix()
    return (OPTIMISM * spread) ** 2 * R @ np.linalg.inv(form) @ R.T


def _in(X_WP: RigidTransform, p_WQ: Array) -> Array:
    """Return points (n, 3) of W in P."""
    return (p_WQ - X_WP.translation()) @ X_WP.rotation().matrix()
