"""The polygons through which two bodies touch, read from Drake's contact surfaces."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import ContactSurface

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Polygons:
    """The polygons of a contact of a body A with a body B.

    Attributes:
        points: (n, 3) centroids in W [m].
        normals: (n, 3) out of B into A, in W: the direction in which pressure pushes A.
        areas: (n,) [m2].
        pressures: (n,) elastic contact pressure at the centroids [Pa].
        gradients: (n,) by which the pressure grows as A moves against the normal [Pa/m].
        friction: (n,) coefficient of friction.
    """

    points: Array
    normals: Array
    areas: Array
    pressures: Array
    gradients: Array
    friction: Array

    @staticmethod
    def of(surface: ContactSurface, *, A_is_M: bool, friction: float = 0.0) -> Polygons:
        """Read a contact surface.

        Args:
            surface: Between two geometries M and N.
            A_is_M: Whether geometry M, not N, is one of body A.
            friction: Coefficient of friction of the two.
        """
        points, normals, areas, pressures = read_faces(surface)
        return Polygons(
            points=points,
            normals=normals if A_is_M else -normals,
            areas=areas,
            pressures=pressures,
            gradients=_gradients(surface, normals),
            friction=np.full(len(points), friction),
        )

    @staticmethod
    def together(parts: Iterable[Polygons]) -> Polygons:
        """Return the polygons of several surfaces between the same two bodies."""
        parts = list(parts)
        return Polygons(*(np.concatenate([vars(part)[name] for part in parts]) for name in FIELDS))

    def __len__(self) -> int:
        return len(self.areas)


FIELDS = tuple(Polygons.__dataclass_fields__)


def read_faces(surface: ContactSurface) -> tuple[Array, Array, Array, Array]:
    """Return centroids (n, 3), normals (n, 3), areas (n,) and pressures (n,) of a surface.

    In W, SI units; Drake's normals point out of N into M.
    """
    mesh, field = surface.poly_mesh_W(), surface.poly_e_MN()
    faces = range(mesh.num_faces())
    points = np.array([mesh.element_centroid(face) for face in faces])
    normals = np.array([mesh.face_normal(face) for face in faces])
    areas = np.array([mesh.area(face) for face in faces])
    pressures = np.array([field.EvaluateCartesian(face, points[face]) for face in faces])
    return points, normals, areas, pressures


def _gradients(surface: ContactSurface, normals: Array) -> Array:
    """Return dp/dx (n,) for an approach of the two bodies along the normals (out of N into M).

    Two compliant bodies are springs in series, 1/g = 1/g_M + 1/g_N; a rigid one has no field.
    """
    faces = range(len(normals))
    series = np.zeros(len(normals))
    for has, of, sign in (
        (surface.HasGradE_M(), surface.EvaluateGradE_M_W, 1.0),
        (surface.HasGradE_N(), surface.EvaluateGradE_N_W, -1.0),
    ):
        if has:
            gradient = np.array([of(face) for face in faces])
            along = sign * np.einsum("ij,ij->i", gradient, normals)
            series += 1.0 / np.maximum(along, 1e-9)
    return 1.0 / series
