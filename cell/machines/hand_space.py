"""The room that a hand needs around what it grips, from the contact geometry of its model."""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh
from pydrake.geometry import Box, Convex, Cylinder, Mesh, Shape
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from cell.machines.gripper import FINGER_JOINTS
from cell.machines.grippers import GripperModel
from cell.paths import model_url, new_parser


@cache
def hand_pieces(model: GripperModel, jaw: str, opening: float) -> tuple[np.ndarray, ...]:
    """Return the corners (n, 3) of each piece of a hand, in the frame of a jaw [m].

    Args:
        model: Type of the gripper.
        jaw: "tip", "wide" or "nose".
        opening: Of the tip pads [m].
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    (hand,) = new_parser(plant).AddModelsFromUrl(model_url(model.sdf))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(model.mount_frame, hand))
    plant.Finalize()
    diagram = builder.Build()  # Owns the plant.
    context = plant.GetMyMutableContextFromRoot(diagram.CreateDefaultContext())
    for joint in FINGER_JOINTS:
        plant.GetJointByName(joint, hand).set_translation(context, opening / 2)
    X_JawW = plant.GetFrameByName(jaw, hand).CalcPoseInWorld(context).inverse()
    inspector, pieces = scene_graph.model_inspector(), []
    for index in plant.GetBodyIndices(hand):
        body = plant.get_body(index)
        X_JawB = X_JawW @ plant.EvalBodyPoseInWorld(context, body)
        for geometry in plant.GetCollisionGeometriesForBody(body):
            X_JawG = X_JawB @ inspector.GetPoseInFrame(geometry)
            pieces.append((X_JawG @ _corners(inspector.GetShape(geometry)).T).T)
    return tuple(pieces)


def _corners(shape: Shape) -> np.ndarray:
    """Return the corners (n, 3) of the convex hull of a shape."""
    if isinstance(shape, Box):
        return np.asarray(trimesh.creation.box(shape.size()).vertices)
    if isinstance(shape, Cylinder):
        cylinder = trimesh.creation.cylinder(shape.radius(), shape.length(), sections=32)
        return np.asarray(cylinder.vertices)
    if isinstance(shape, Convex | Mesh):
        hull = shape.GetConvexHull()
        return np.array([hull.vertex(k) for k in range(hull.num_vertices())])
    raise TypeError(f"A hand has a contact piece of an unknown kind: {shape}.")
