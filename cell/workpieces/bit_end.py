"""The end of the bit as a shape that touches: heads beside their drives, and what is beside them.

The bit's model is bare there, for in a drive bit and bolt are tied and nothing else holds them: the
shape is switched off as long as the bit is over the drive of a bolt that is awake, or in it. Beside
it the bit stands on the head, with what the bit holder's spring pushes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    CollisionFilterDeclaration,
    Cylinder,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import Context

# The inscribed circle of hex 2.5 and the bare end, as the bit is drawn (cell/cad/screwdriver.py).
RADIUS, LENGTH = 1.25e-3, 10e-3
# Steel on steel, as the rest of the bit; so far it goes in without a shock (as a bolt's head) [A].
FRICTION, DISSIPATION = 0.3, 500.0


@dataclass(frozen=True)
class BitEnd:
    """The shape, and the scene graph in whose Contexts it is switched on and off."""

    scene_graph: SceneGraph
    geometry: GeometryId

    @staticmethod
    def add(plant: MultibodyPlant, scene_graph: SceneGraph, bit_frame: Frame) -> BitEnd:
        """Add the shape to the body of the bit, before the plant is finalized.

        Args:
            plant: Not finalized yet.
            scene_graph: Of the plant.
            bit_frame: Frame E at the bit's end face, +z out of the tool.
        """
        properties = ProximityProperties()
        AddRigidHydroelasticProperties(resolution_hint=RADIUS, properties=properties)
        friction = CoulombFriction(FRICTION, FRICTION)
        AddContactMaterial(dissipation=DISSIPATION, friction=friction, properties=properties)
        X_BE = bit_frame.GetFixedPoseInBodyFrame()
        geometry = plant.RegisterCollisionGeometry(
            bit_frame.body(),
            X_BE @ RigidTransform(np.array([0.0, 0.0, -LENGTH / 2])),
            Cylinder(RADIUS, LENGTH),
            "end",
            properties,
        )
        # It meets what the rest of the bit meets: not the tool that it is part of.
        inspector = scene_graph.model_inspector()
        rest = plant.GetCollisionGeometriesForBody(bit_frame.body())[:1]  # Itself, of a bare bit.
        others = inspector.GetAllGeometryIds(Role.kProximity)
        unmet = [o for o in others for one in rest if inspector.CollisionFiltered(one, o)]
        filters = CollisionFilterDeclaration()
        filters.ExcludeBetween(GeometrySet(geometry), GeometrySet(unmet))
        scene_graph.collision_filter_manager().Apply(filters)
        return BitEnd(scene_graph, geometry)

    def set(self, root: Context, *, touches: bool) -> None:
        """Let the end touch whatever it meets, or nothing (Context of the diagram)."""
        context = self.scene_graph.GetMyMutableContextFromRoot(root)
        filters = self.scene_graph.collision_filter_manager(context)
        (filters.Activate if touches else filters.Deactivate)(GeometrySet(self.geometry))
