"""A contact that sticks as six springs.

While no polygon opens, slides or yields, the force between two bodies A and B changes linearly with
their small relative displacement. A polygon of area a whose pressure grows by g per depth resists
it with a g along its normal and with a share of that along its face, so that the contact has the
6x6 stiffness

    K = sum_i a_i g_i (n n' + c (1 - n n'))   as line springs through the polygons' centroids.

Any such K is the sum of six line springs: K = N N', and since turning the columns of N into each
other changes nothing, they can be turned until each one is a pure force along a line (Roberts 1999,
"Minimal realization of a spatial stiffness matrix with simple springs connected in parallel"; the
pitches of all columns add up to the trace of the coupling block, which line springs leave at zero).
Drake takes line springs as distance constraints, implicitly. Their free lengths are such that the
six forces are the wrench that the contact carries at the moment: nothing jumps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cell.contact.polygons import Polygons

Array = NDArray[np.float64]

# Tangential over normal stiffness of a sticking contact, 2 (1 - nu) / (2 - nu) (Mindlin 1949):
# 0.82 for metal, 0.67 for rubber [D].
TANGENTIAL = 0.8
# Distance between the two ends of a spring [m]: long against displacements, so that its direction
# stays, and a preload of 1 kN turns with 2e4 N/m only [A].
LENGTH = 0.05


@dataclass(frozen=True)
class Springs:
    """Six springs between a body A and a body B; A is pushed along `directions`.

    Attributes:
        points: (6, 3) on A, in W [m].
        directions: (6, 3) unit vectors in W, from the end on B to that on A.
        stiffness: (6,) [N/m].
        forces: (6,) that they exert at present, positive if they push [N].
    """

    points: Array
    directions: Array
    stiffness: Array
    forces: Array

    @staticmethod
    def of(polygons: Polygons, wrench: Array) -> Springs:
        """Return the springs of a contact.

        Args:
            polygons: Of the contact.
            wrench: (6,) torque about the origin of W [N m] and force [N] that A feels.

        Raises:
            LinAlgError: The polygons do not resist every displacement.
        """
        centre = np.average(polygons.points, axis=0, weights=polygons.areas)
        arm = np.sqrt(np.mean(np.sum((polygons.points - centre) ** 2, axis=1)))
        # Torques are divided by a length of the contact's size: numbers of like magnitude.
        scale = np.array([1.0 / max(arm, 1e-4)] * 3 + [1.0] * 3)
        K = stiffness_matrix(polygons, centre) * scale[:, None] * scale
        rows = simple_springs(K) / scale
        stiffness = np.sum(rows[:, 3:] ** 2, axis=1)
        unit = rows / np.sqrt(stiffness)[:, None]
        directions, torques = unit[:, 3:], unit[:, :3]
        points = centre + np.cross(directions, torques)
        about_centre = wrench.copy()
        about_centre[:3] -= np.cross(centre, wrench[3:])
        forces = np.linalg.solve(unit.T * scale[:, None], about_centre * scale)
        return Springs(points, directions, stiffness, forces)

    @cached_property
    def lines(self) -> Array:
        """Wrenches (6, 6) of unit forces of the springs on A, about the origin of W."""
        return line_wrenches(self.points, self.directions)


def line_wrenches(points: Array, directions: Array) -> Array:
    """Return the wrenches (n, 6), torque first, of unit forces along lines (n, 3), (n, 3)."""
    return np.concatenate([np.cross(points, directions), directions], axis=1)


def stiffness_matrix(polygons: Polygons, centre: Array) -> Array:
    """Return K (6, 6) of a sticking contact about a point, torque first [N m/rad, N, N/m]."""
    arms, normal = polygons.points - centre, polygons.areas * polygons.gradients
    W = line_wrenches(arms, polygons.normals)
    # c k (1 - n n') + k n n', with 1 as the sum over the axes of W.
    K = (1.0 - TANGENTIAL) * (W * normal[:, None]).T @ W
    for axis in np.eye(3):
        T = line_wrenches(arms, np.broadcast_to(axis, arms.shape))
        K += TANGENTIAL * (T * normal[:, None]).T @ T
    return K


def simple_springs(K: Array) -> Array:
    """Return six line springs as wrenches (6, 6) whose outer products add up to K (6, 6).

    The square of the force in a row is the stiffness of its spring.

    Raises:
        LinAlgError: K is not positive definite.
    """
    columns = np.linalg.cholesky(K)
    # Turned at random first: a column that is a pure couple has no line.
    columns = columns @ np.linalg.qr(np.random.default_rng(0).normal(size=(6, 6)))[0]
    left = list(range(6))
    while len(left) > 1:
        pitches = {i: columns[:3, i] @ columns[3:, i] for i in left}
        i, j = max(left, key=pitches.__getitem__), min(left, key=pitches.__getitem__)
        if pitches[i] <= 0.0 or pitches[j] >= 0.0:
            break  # What is left is rounding: the pitches add up to zero.
        a, b = columns[:, i].copy(), columns[:, j].copy()
        # The pitch of a + t b is h_i + m t + h_j t^2; h_i and h_j differ in sign, so it has a root.
        m = a[:3] @ b[3:] + b[:3] @ a[3:]
        root = np.sqrt(m * m - 4.0 * pitches[i] * pitches[j])
        t = 2.0 * pitches[i] / (root - m) if m < 0.0 else -2.0 * pitches[i] / (root + m)
        cosine = 1.0 / np.sqrt(1.0 + t * t)
        columns[:, i] = cosine * (a + t * b)
        columns[:, j] = cosine * (b - t * a)
        left.remove(i)
    return np.asarray(columns.T, dtype=np.float64)
