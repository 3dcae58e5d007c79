"""The surface of a part as points with normals: what a depth image is compared with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPACING = 7e-4  # Between points [m] [A]: below what a depth image resolves at 0.3 m, 0.75 mm.
FEWEST, MOST = 2_000, 40_000  # Points, whatever the size of the part.


@dataclass(frozen=True, eq=False)
class Surface:
    """Points spread evenly over the surface of a part, in its frame P.

    Attributes:
        points: (n, 3) [m].
        normals: (n, 3) outward.
        lower, upper: (3,) corners of its bounding box [m].
    """

    points: Array
    normals: Array
    lower: Array
    upper: Array

    @staticmethod
    def of(mesh: trimesh.Trimesh) -> Surface:
        """Return the surface of a mesh in P [m]; the same for the same mesh."""
        count = int(np.clip(mesh.area / SPACING**2, FEWEST, MOST))
        points, faces = trimesh.sample.sample_surface(mesh, count, seed=0)[:2]
        lower, upper = mesh.bounds
        return Surface(np.array(points), np.array(mesh.face_normals[faces]), lower, upper)

    @property
    def centre(self) -> Array:
        """(3,) middle of the bounding box [m]."""
        return (self.lower + self.upper) / 2.0

    def facing(self, p_PC: Array, least: float) -> NDArray[np.bool_]:
        """Return which points (n,) face a camera at p_PC (3,), by a least cosine."""
        sight = p_PC - self.points
        cosine = np.einsum("ij,ij->i", sight, self.normals) / np.linalg.norm(sight, axis=1)
        return cosine > least
