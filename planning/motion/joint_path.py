"""A way through joint space: straight segments with rounded corners, so that it can be timed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.polynomial import Polynomial
from pydrake.trajectories import PiecewisePolynomial

SAME = 1e-9  # Waypoints closer than this are one [rad].


@dataclass(frozen=True)
class JointPath:
    """Waypoints and how much of the segments beside each one its rounding takes.

    A corner p between unit directions u and w is replaced, from ``radius`` before it to ``radius``
    behind it, by the parabola p + (-(r - s)^2 u + (r + s)^2 w) / (4 r) with s in [-r, r]: it leaves
    and joins the segments tangentially and stays within r/2 of the corner.

    Attributes:
        waypoints: (n, dof) joint angles [rad], n >= 1, neighbours distinct.
        radii: (n,) [rad]; 0 at both ends.
    """

    waypoints: np.ndarray
    radii: np.ndarray

    @staticmethod
    def through(waypoints: np.ndarray, radius: float) -> JointPath:
        """Return the path through (n, dof) waypoints with corners rounded by at most ``radius``."""
        points = np.atleast_2d(np.asarray(waypoints, dtype=float))
        moved = np.linalg.norm(np.diff(points, axis=0), axis=1) > SAME
        points = points[np.concatenate([[True], moved])]
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        radii = np.zeros(len(points))
        # A little less than half, so that a straight piece is left between two corners.
        radii[1:-1] = np.minimum(radius, 0.49 * np.minimum(lengths[:-1], lengths[1:]))
        return JointPath(points, radii)

    @property
    def length(self) -> float:
        """Length of the polyline through the waypoints [rad]."""
        return float(np.linalg.norm(np.diff(self.waypoints, axis=0), axis=1).sum())

    def curve(self) -> PiecewisePolynomial:
        """Return q(s), once differentiable, with s the length along the unrounded polyline."""
        steps = np.diff(self.waypoints, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        directions = steps / lengths[:, None]
        corners = np.concatenate([[0.0], np.cumsum(lengths)])
        breaks, pieces = [0.0], []
        for i, direction in enumerate(directions):
            if self.radii[i] > 0:
                r, u = self.radii[i], directions[i - 1]
                pieces.append(_parabola(self.waypoints[i], u, direction, r))
                breaks.append(corners[i] + r)
            start = self.waypoints[i] + self.radii[i] * direction
            pieces.append(_polynomials([start, direction]))
            breaks.append(corners[i + 1] - self.radii[i + 1])
        return PiecewisePolynomial(pieces, breaks)

    def samples(self, step: float) -> np.ndarray:
        """Return (m, dof) points of the curve at most ``step`` [rad] apart, both ends included."""
        if len(self.waypoints) == 1:
            return self.waypoints
        curve = self.curve()
        count = int(np.ceil(curve.end_time() / step)) + 1
        grid = np.linspace(0.0, curve.end_time(), max(count, 2))
        return curve.vector_values(grid).T


def _parabola(p: np.ndarray, u: np.ndarray, w: np.ndarray, r: float) -> np.ndarray:
    """Return the corner's polynomials in s + r, which starts at 0."""
    return _polynomials([p - r * u, u, (w - u) / (4 * r)])


def _polynomials(coefficients: list[np.ndarray]) -> np.ndarray:
    """Return (dof, 1) polynomials from coefficients by rising power, each (dof,)."""
    columns = np.stack(coefficients, axis=1)
    return np.array([[Polynomial(row)] for row in columns])
