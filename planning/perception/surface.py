"""The surface of a part as points with normals: what a depth image is compared with."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import product

import numpy as np
import trimesh
from numpy.typing import NDArray
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial import KDTree

from cell.paths import model_url, new_parser
from cell.shapes import shape_mesh

Array = NDArray[np.float64]

SPACING = 7e-4  # Between points [m] [A]: below what a depth image resolves at 0.3 m, 0.75 mm.
FACING = 0.15  # Least cosine between a surface and the view: 81 degrees [A].
SAME_SIDE = 0.9986  # Cosine of 3 degrees: nearer directions see the same.
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

    @staticmethod
    def of_model(model: str, others: Iterable[trimesh.Trimesh] = ()) -> Surface:
        """Return the surface of what is visible of an SDF model with one body, in its frame.

        Args:
            model: Name or URL, as `cell.paths.model_url` takes it.
            others: Meshes in the same frame that stand in or on it [m].
        """
        builder = DiagramBuilder()
        plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        (instance,) = new_parser(plant, model).AddModelsFromUrl(model_url(model))
        body = plant.get_body(plant.GetBodyIndices(instance)[0])
        inspector, meshes = scene_graph.model_inspector(), list(others)
        for geometry in plant.GetVisualGeometriesForBody(body):
            mesh = shape_mesh(inspector.GetShape(geometry))
            mesh.apply_transform(inspector.GetPoseInFrame(geometry).GetAsMatrix4())
            meshes.append(mesh)
        whole = trimesh.util.concatenate(meshes)
        assert isinstance(whole, trimesh.Trimesh)
        return Surface.of(whole)

    @property
    def size(self) -> float:
        """Diagonal of the bounding box [m]."""
        return float(np.linalg.norm(self.upper - self.lower))

    @property
    def corners(self) -> Array:
        """(8, 3) of the bounding box: the number of one, in binary, says where it is upper [m]."""
        return np.array(list(product(*zip(self.lower, self.upper, strict=True))))

    @property
    def centre(self) -> Array:
        """(3,) middle of the bounding box [m]."""
        return (self.lower + self.upper) / 2.0


@dataclass(frozen=True, eq=False)
class Side:
    """The part of a surface that faces a camera, for queries of nearest points.

    Attributes:
        p_PC: (3,) position of the camera [m].
        points: (n, 3) [m].
        normals: (n, 3) outward.
        tree: Of the points.
    """

    p_PC: Array
    points: Array
    normals: Array
    tree: KDTree


@dataclass
class Sides:
    """Sides of a surface, each built once for cameras in about the same direction."""

    surface: Surface
    _built: list[Side] = field(default_factory=list)

    def facing(self, p_PC: Array) -> Side | None:
        """Return the side that faces a camera at p_PC (3,) [m]; None if nothing does."""
        middle = self.surface.centre
        sight = (p_PC - middle) / np.linalg.norm(p_PC - middle)
        for side in self._built:
            known = side.p_PC - middle
            if sight @ known > SAME_SIDE * np.linalg.norm(known):
                return side
        rays = p_PC - self.surface.points
        cosine = np.einsum("ij,ij->i", rays, self.surface.normals) / np.linalg.norm(rays, axis=1)
        faces = cosine > FACING
        if not faces.any():
            return None
        points, normals = self.surface.points[faces], self.surface.normals[faces]
        self._built.append(Side(p_PC, points, normals, KDTree(points)))
        return self._built[-1]
