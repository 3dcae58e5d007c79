"""A part's surface as points, for pressing it into the bed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A face that looks down by less than this (cosine of 84 deg) is a wall: it shows the bed no area,
# and one that comes and goes as the part rocks would keep it rocking.
WALL = -0.1
# Slope to which a bin's surface is limited when it is carried to the middle of a cell.
STEEPEST = 2.0


@dataclass(frozen=True, eq=False)
class Underside:
    """What a part shows to the bed in one orientation: one point per square bin along J's x and y.

    Attributes:
        points: (m, 3) in P [m], the centroid of what the bin shows.
        slopes: (m, 2) of the surface there, dz/dx and dz/dy in J.
        areas: (m,) projected along J's z [m2].
        bins: (m, 2) whole numbers of the bin, counted from the part's origin.
    """

    points: Array
    slopes: Array
    areas: Array
    bins: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Points spread over a part's real surface, in the part frame P.

    Attributes:
        name: Of the part; the bed keeps what it knows about a part under this name.
        points: (n, 3) [m].
        normals: (n, 3) outward unit normals.
        areas: (n,) [m2].
    """

    name: str
    points: Array
    normals: Array
    areas: Array

    @staticmethod
    def of(name: str, mesh: trimesh.Trimesh, spacing: float = 0.001) -> SurfaceSamples:
        """Sample a closed surface: centroids of its triangles, split down to `spacing`."""
        split = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, spacing)
        triangles = np.asarray(split[0])[np.asarray(split[1])]
        cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        doubled = np.linalg.norm(cross, axis=1)
        kept = doubled > 1e-14
        normals = cross[kept] / doubled[kept, None]
        return SurfaceSamples(name, triangles[kept].mean(axis=1), normals, doubled[kept] / 2)

    def underside(self, R_JP: Array, bin_size: float) -> Underside:
        """Return one point per square bin of the surface seen from below, with its area.

        Args:
            R_JP: (3, 3) orientation of the part in the jig frame J (+z up).
            bin_size: Edge of a bin [m], along J's x and y.

        A surface more than `bin_size` above the lowest one of its bin counts as hidden.
        """
        facing = self.normals @ R_JP[2]
        down = facing < WALL
        p_J, normals_J = self.points[down] @ R_JP.T, self.normals[down] @ R_JP.T
        bins = np.rint(p_J[:, :2] / bin_size).astype(np.int64)
        order = np.lexsort((p_J[:, 2], bins[:, 1], bins[:, 0]))
        p_J, normals_J, bins = p_J[order], normals_J[order], bins[order]
        starts = np.flatnonzero(np.append(True, np.any(bins[1:] != bins[:-1], axis=1)))
        lowest = np.repeat(p_J[starts, 2], np.diff(np.append(starts, len(order))))
        visible = np.where(p_J[:, 2] < lowest + bin_size, self.areas[down][order], 0.0)
        area_J = np.add.reduceat(-visible[:, None] * normals_J, starts)
        weight = -visible * normals_J[:, 2]
        centroid = np.add.reduceat(weight[:, None] * p_J, starts) / area_J[:, 2:]
        slopes = np.clip(-area_J[:, :2] / area_J[:, 2:], -STEEPEST, STEEPEST)
        return Underside(centroid @ R_JP, slopes, area_J[:, 2], bins[starts])
