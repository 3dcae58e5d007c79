"""Vectors and poses as arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

Array = NDArray[np.float64]

_NEXT, _PREVIOUS = [1, 2, 0], [2, 0, 1]


def cross(a: Array, b: Array) -> Array:
    """Return the cross products of vectors (..., 3): `np.cross`, at a quarter of its overhead."""
    return a[..., _NEXT] * b[..., _PREVIOUS] - a[..., _PREVIOUS] * b[..., _NEXT]


def total(arms: Array, forces: Array) -> tuple[Array, Array]:
    """Return the sum (3,) of forces (n, 3), and of their torques (3,), given their arms (n, 3)."""
    products = arms.T @ forces
    torque = products[_NEXT, _PREVIOUS] - products[_PREVIOUS, _NEXT]
    return forces.sum(axis=0), torque


def exact_pose(matrix: Array) -> RigidTransform:
    """Return the pose of a 3x4 matrix, to the last bit."""
    return RigidTransform(RotationMatrix(matrix[:, :3]), matrix[:, 3])


def rotation_with_up(up: str) -> RotationMatrix:
    """Return R_JA that turns the product so that its axis ``up`` points along +z of the jig.

    The product's x axis stays along that of the jig; if ``up`` is along x, its y axis points along
    the jig's x. Compose with a rotation about z for another yaw.

    Args:
        up: "+x" ... "-z".
    """
    if up == "-z":
        return RotationMatrix.MakeXRotation(np.pi)
    axis = (1.0 if up[0] == "+" else -1.0) * np.eye(3)["xyz".index(up[1])]
    x = np.eye(3)[1] if up[1] == "x" else np.eye(3)[0]
    return RotationMatrix(np.stack([x, np.cross(axis, x), axis]))  # Rows: axes of J in A.
