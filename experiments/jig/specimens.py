"""Specimens of the element tests: regular prisms, and parts of a product."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import trimesh
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Convex,
    InMemoryMesh,
    ProximityProperties,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia
from trimesh.exchange.obj import export_obj

from cell.paths import model_url, new_parser
from cell.products.product import Part

Array = NDArray[np.float64]

# Part friction in the discrete-element reference runs.
FRICTION = 0.5


class Specimen(Protocol):
    """A body that the rig presses into the bed."""

    def mesh(self) -> trimesh.Trimesh:
        """Return its closed surface in the part frame P [m]."""
        ...

    def add_to(self, plant: MultibodyPlant) -> RigidBody:
        """Add it as a free body with collision geometries named "bed_*"."""
        ...

    @property
    def X_CP(self) -> RigidTransform:
        """Pose in the carriage C, whose origin is centred below the lowest point of the part."""
        ...


@dataclass(frozen=True)
class Prism:
    """A regular prism in place of a round part: axis along z, its lower end at z = 0.

    Attributes:
        radius: Mean radius [m].
        length: [m].
        mass: [kg].
        facets: Number of side faces.
        lying: Held with its axis horizontal, along x.
        friction: Of its surface.
    """

    radius: float = 0.0175
    length: float = 0.054
    mass: float = 0.2
    facets: int = 24
    lying: bool = False
    friction: float = FRICTION

    def mesh(self) -> trimesh.Trimesh:
        """Return the surface, its corners outside the round part: the mean radius agrees."""
        angle = np.arange(self.facets) * 2 * np.pi / self.facets
        corner = self.radius * 2 / (1 + np.cos(np.pi / self.facets))
        ring = corner * np.column_stack([np.cos(angle), np.sin(angle)])
        ends = [np.column_stack([ring, np.full(self.facets, z)]) for z in (0.0, self.length)]
        return trimesh.convex.convex_hull(np.concatenate(ends))

    def add_to(self, plant: MultibodyPlant) -> RigidBody:
        """Add a solid cylinder with the prism as its contact geometry."""
        solid = SpatialInertia.SolidCylinderWithMass(
            self.mass, self.radius, self.length, [0.0, 0.0, 1.0]
        )
        body = plant.AddRigidBody("part", solid.Shift([0.0, 0.0, -self.length / 2]))
        text = export_obj(self.mesh(), digits=12)
        shape = Convex(InMemoryMesh(mesh_file=MemoryFile(text, ".obj", "part")))
        properties = ProximityProperties()
        AddRigidHydroelasticProperties(0.01, properties)
        friction = CoulombFriction(self.friction, self.friction)
        AddContactMaterial(friction=friction, properties=properties)
        plant.RegisterCollisionGeometry(body, RigidTransform(), shape, "bed_part", properties)
        return body

    @property
    def X_CP(self) -> RigidTransform:
        """Pose in the carriage."""
        if not self.lying:
            return RigidTransform()
        turn = RotationMatrix.MakeYRotation(np.pi / 2)
        return _standing(turn, self.mesh())


@dataclass(frozen=True, eq=False)
class ProductPart:
    """A part of a product, from its model.

    Attributes:
        part: With a model.
        up: (3,) unit axis of P that points up.
    """

    part: Part
    up: tuple[float, float, float]

    def mesh(self) -> trimesh.Trimesh:
        """Return the part's surface."""
        return self.part.mesh

    def add_to(self, plant: MultibodyPlant) -> RigidBody:
        """Add the part's model."""
        assert self.part.model is not None
        (instance,) = new_parser(plant).AddModelsFromUrl(model_url(self.part.model))
        return plant.get_body(plant.GetBodyIndices(instance)[0])

    @property
    def X_CP(self) -> RigidTransform:
        """Pose in the carriage."""
        z = np.array(self.up, dtype=float)
        x = np.roll(np.abs(z), 1)
        return _standing(RotationMatrix(np.array([x, np.cross(z, x), z])), self.mesh())


def _standing(R_CP: RotationMatrix, mesh: trimesh.Trimesh) -> RigidTransform:
    """Return the pose with the lowest point at z = 0 of the carriage, centred in x and y."""
    corners = mesh.vertices @ R_CP.matrix().T
    low, high = corners.min(axis=0), corners.max(axis=0)
    return RigidTransform(R_CP, [-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2]])
