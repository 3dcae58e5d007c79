"""Kinematics of any chain of revolute joints by numbers: no closed form needed.

The inverse is found by damped Newton steps from many starting points at once. They come from a
table of random configurations, computed once: those whose flange is nearest to the wanted one when
the first and the last joint are left out of the comparison, because these two are then turned to
fit. On an arm with more joints than six, different starting points also end in different positions
of the elbow.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

SAMPLES = 4000  # Configurations in the table [A]; more fit better and take longer to compare.
SEEDS = 20  # Starting points of a search besides the given one [A].
ITERATIONS = 30  # Nothing that converges at all takes more [M].
PATIENCE = 9  # Iterations after which the stragglers are given up if there is any solution [A].
TOLERANCE = 1e-9  # Of a solution's pose [m] and [rad]: a thousandth of what is asked for.
LARGEST_STEP = 0.6  # Of a joint in one step [rad] [A].
DAMPING = 0.05  # Square of the damping per square of the pose's error: vanishes at the goal [A].
FLOOR = 1e-9  # Least square of the damping: at a singularity steps stay finite.
DISTINCT = 0.15  # Solutions whose joints all differ by less are one [rad] [A].


class Chain:
    """Forward kinematics of many configurations at once.

    Args:
        origins: (dof, 4, 4) pose of each link in the one before, at joint angle 0.
        flange_z: Flange in front of the last link's frame, along its z [m].
    """

    def __init__(self, origins: np.ndarray, flange_z: float) -> None:
        self.origins = origins
        self.dof = len(origins)
        self._flange_z = flange_z

    @cached_property
    def reach(self) -> float:
        """Length of the chain behind the second joint [m], which scales lengths against angles."""
        steps = np.linalg.norm(self.origins[2:, :3, 3], axis=1)
        return float(steps.sum() + abs(self._flange_z))

    def poses(self, q: np.ndarray) -> np.ndarray:
        """Return X_BF (n, 4, 4) for configurations (n, dof)."""
        T = self._frames(q)[:, -1].copy()
        T[:, :3, 3] += self._flange_z * T[:, :3, 2]
        return T

    def jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return X_BF (n, 4, 4) and J (n, 6, dof): rotational, then translational, in B."""
        T = self._frames(q)
        z, p = T[:, :, :3, 2], T[:, :, :3, 3]
        end = T[:, -1].copy()
        end[:, :3, 3] += self._flange_z * end[:, :3, 2]
        arm = end[:, None, :3, 3] - p
        J = np.empty((len(q), 6, self.dof))
        J[:, :3] = z.transpose(0, 2, 1)
        J[:, 3:] = _cross(z, arm).transpose(0, 2, 1)
        return end, J

    def _frames(self, q: np.ndarray) -> np.ndarray:
        """Return the poses (n, dof, 4, 4) of all link frames in B."""
        c, s = np.cos(q)[..., None], np.sin(q)[..., None]
        steps = np.empty((*q.shape, 4, 4))
        x, y = self.origins[:, :, 0], self.origins[:, :, 1]
        steps[..., 0] = c * x + s * y
        steps[..., 1] = c * y - s * x
        steps[..., 2:] = self.origins[:, :, 2:]
        frames = steps
        for joint in range(1, self.dof):
            frames[:, joint] = frames[:, joint - 1] @ steps[:, joint]
        return frames


class NumericInverse:
    """Joint angles that reach a pose, inside given limits.

    Args:
        chain: The arm.
        lower, upper: (dof,) [rad]; solutions stay between them.
    """

    def __init__(self, chain: Chain, lower: np.ndarray, upper: np.ndarray) -> None:
        self._chain, self._lower, self._upper = chain, lower, upper

    def solutions(self, X_BF: np.ndarray, near: np.ndarray) -> np.ndarray:
        """Return (n, dof) distinct joint angles [rad] for X_BF (4, 4), nearest to ``near`` first.

        The same arguments give the same solutions. An empty result means that no starting point
        led to the pose, which on a reachable pose is rare but possible.
        """
        q = np.vstack([np.clip(near, self._lower, self._upper), self._seeds(X_BF)])
        found = []
        for iteration in range(ITERATIONS):
            X, J = self._chain.jacobian(q)
            error = _pose_error(X, X_BF)
            size = np.abs(error).max(axis=1)
            done = size < TOLERANCE
            if done.any():
                found.append(q[done])
                q, error, J = q[~done], error[~done], J[~done]
            if not len(q) or (found and iteration >= PATIENCE):
                break
            q = np.clip(q + self._step(q, J, error), self._lower, self._upper)
        return _distinct(np.vstack(found), near) if found else np.zeros((0, self._chain.dof))

    def _step(self, q: np.ndarray, J: np.ndarray, error: np.ndarray) -> np.ndarray:
        """Return the damped Newton step (n, dof), with joints that push at a limit left out."""
        step = _damped(J, error)
        blocked = ((q <= self._lower) & (step < 0)) | ((q >= self._upper) & (step > 0))
        some = blocked.any(axis=1)
        if some.any():
            step[some] = _damped(np.where(blocked[some, None], 0.0, J[some]), error[some])
        largest = np.abs(step).max(axis=1, keepdims=True)
        return step * np.minimum(1.0, LARGEST_STEP / np.maximum(largest, 1e-12))

    def _seeds(self, X_BF: np.ndarray) -> np.ndarray:
        """Return (SEEDS, dof) configurations of the table, first and last joint turned to fit."""
        q, features, azimuth, x_axis = self._table
        wanted, turn, R = _features(X_BF[None])
        nearest = np.argpartition(((features - wanted) ** 2).sum(axis=1), SEEDS)[:SEEDS]
        nearest.sort()  # The order of a partition is not defined.
        seeds = q[nearest].copy()
        seeds[:, 0] = _wrapped(turn - azimuth[nearest])
        # The last joint turns the flange's x axis, both seen in the frame of the first joint's arm.
        x, axes = x_axis[nearest], R[0]
        seeds[:, -1] = np.arctan2(-x @ axes[:, 1], x @ axes[:, 0])
        return np.clip(seeds, self._lower, self._upper)

    @cached_property
    def _table(self) -> tuple[np.ndarray, ...]:
        rng = np.random.default_rng(0)
        q = rng.uniform(self._lower, self._upper, (SAMPLES, self._chain.dof))
        q[:, [0, -1]] = 0.0
        features, azimuth, R = _features(self._chain.poses(q))
        return q, features, azimuth, R[:, :, 0]


def _features(X_BF: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what neither the first nor the last joint changes, and what they do.

    Args:
        X_BF: (n, 4, 4).

    Returns:
        (n, 5) distance of the flange from the base's axis, height, and its z axis, seen from the
        vertical plane through it; (n,) angle of that plane; (n, 3, 3) flange's axes seen from it.
    """
    p = X_BF[:, :3, 3]
    azimuth = np.arctan2(p[:, 1], p[:, 0])
    c, s = np.cos(azimuth)[:, None], np.sin(azimuth)[:, None]
    R = X_BF[:, :3, :3].copy()
    R[:, 0] = c * X_BF[:, 0, :3] + s * X_BF[:, 1, :3]
    R[:, 1] = c * X_BF[:, 1, :3] - s * X_BF[:, 0, :3]
    distance = np.hypot(p[:, 0], p[:, 1])
    return np.column_stack([distance, p[:, 2], R[:, :, 2]]), azimuth, R


def _pose_error(X: np.ndarray, X_goal: np.ndarray) -> np.ndarray:
    """Return the turn [rad] and shift [m] (n, 6) from X (n, 4, 4) to the goal (4, 4), in B."""
    R = X_goal[:3, :3] @ X[:, :3, :3].transpose(0, 2, 1)
    axis = np.empty((len(X), 3))
    axis[:, 0] = R[:, 2, 1] - R[:, 1, 2]
    axis[:, 1] = R[:, 0, 2] - R[:, 2, 0]
    axis[:, 2] = R[:, 1, 0] - R[:, 0, 1]
    double_sine = np.sqrt((axis**2).sum(axis=1))
    angle = np.arctan2(double_sine, np.trace(R, axis1=1, axis2=2) - 1.0)
    error = np.empty((len(X), 6))
    error[:, :3] = axis * (angle / np.maximum(double_sine, 1e-12))[:, None]
    error[:, 3:] = X_goal[:3, 3] - X[:, :3, 3]
    return error


def _damped(J: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return J^T (J J^T + c I)^-1 e, (n, dof), with c growing with the error."""
    JJ = J @ J.transpose(0, 2, 1)
    damping = DAMPING * (error**2).sum(axis=1) + FLOOR
    JJ[:, range(6), range(6)] += damping[:, None]
    return (J.transpose(0, 2, 1) @ np.linalg.solve(JJ, error[..., None]))[..., 0]


def _distinct(q: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return the rows sorted by distance from ``near`` without those that repeat an earlier one."""
    q = q[np.argsort(np.linalg.norm(q - near, axis=1), kind="stable")]
    apart = np.abs(q[:, None] - q[None]).max(axis=2) >= DISTINCT
    kept: list[int] = []
    for row in range(len(q)):
        if apart[row, kept].all():
            kept.append(row)
    return q[kept]


def _wrapped(angle: np.ndarray) -> np.ndarray:
    """Return the angles in (-pi, pi]."""
    return np.pi - np.mod(np.pi - angle, 2 * np.pi)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross product along the last axis; NumPy's own takes four times as long."""
    out = np.empty(b.shape)
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out
