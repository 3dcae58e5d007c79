"""The palm of the hand that pushes, as low over its fingertips as that of the real hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    Cylinder,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Context

from cell.machines.grippers import GripperModel

DARK = np.array([0.13, 0.13, 0.14, 1.0])


@dataclass(frozen=True)
class LowPalm:
    """An extension of the palm, for a hand whose model has longer fingers than the real one.

    The long fingers place the part, which a short hand would have to take otherwise; the extension
    is part of the contact from `come_down` on.

    Attributes:
        plant, scene_graph: Drake's.
        geometry: The extension.
        properties: Of its contact, those of the palm.
        hand: Model instance of the hand.
    """

    plant: MultibodyPlant
    scene_graph: SceneGraph
    hand: ModelInstanceIndex
    geometry: GeometryId
    properties: ProximityProperties

    @staticmethod
    def add(
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        hand: ModelInstanceIndex,
        model: GripperModel,
        height: float,
    ) -> LowPalm | None:
        """Extend the palm of a hand before the plant is finalized.

        Args:
            plant: Drake's.
            scene_graph: Drake's.
            hand: Model instance of the hand.
            model: Its type.
            height: Of the extended palm above the fingertips [m].

        Returns:
            None if the palm of the model is as low already.
        """
        tips = model.tip_z + model.tips.nose_start + model.tips.nose[2]
        length = tips - height - model.palm_length
        if length <= 0:
            return None
        inspector = scene_graph.model_inspector()
        body = plant.GetBodyByName("palm", hand)
        (palm,) = plant.GetCollisionGeometriesForBody(body)
        properties = ProximityProperties(inspector.GetProximityProperties(palm))
        shape = Cylinder(inspector.GetShape(palm).radius(), length)
        X_BG = RigidTransform([0.0, 0.0, model.palm_length + length / 2])
        plant.RegisterVisualGeometry(body, X_BG, shape, "low_palm", DARK)
        geometry = plant.RegisterCollisionGeometry(body, X_BG, shape, "low_palm", properties)
        return LowPalm(plant, scene_graph, hand, geometry, properties)

    def stay_up(self, root: Context) -> None:
        """Take the extension out of the contact, before the part is placed."""
        context = self.scene_graph.GetMyMutableContextFromRoot(root)
        source = self.plant.get_source_id()
        self.scene_graph.RemoveRole(context, source, self.geometry, Role.kProximity)

    def come_down(self, root: Context) -> None:
        """Make the extension part of the contact, before the push."""
        context = self.scene_graph.GetMyMutableContextFromRoot(root)
        source = self.plant.get_source_id()
        self.scene_graph.AssignRole(context, source, self.geometry, self.properties)
        # Removing the role has dropped the collision filters against palm and fingers.
        bodies = map(self.plant.get_body, self.plant.GetBodyIndices(self.hand))
        own = [i for body in bodies for i in self.plant.GetCollisionGeometriesForBody(body)]
        declaration = CollisionFilterDeclaration().ExcludeWithin(GeometrySet(own))
        self.scene_graph.collision_filter_manager(context).Apply(declaration)
