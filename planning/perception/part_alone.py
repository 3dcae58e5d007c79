"""What a camera would see of a part if nothing else were there: its silhouette and its depth."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    DepthRange,
    DepthRenderCamera,
    GeometryInstance,
    InMemoryMesh,
    Mesh,
    PerceptionProperties,
    RenderLabel,
    SceneGraph,
)
from pydrake.math import RigidTransform
from trimesh.exchange.obj import export_obj

from cell.machines.cameras.pinhole import Pinhole
from cell.machines.cameras.rendering import camera_core, rendering

Array = NDArray[np.float64]

FARTHEST = 5.0  # Depth that is rendered [m].


class PartAlone:
    """A scene of one part, whose frame P is the world's.

    Args:
        mesh: Of the part, in P [m].
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self._scene = SceneGraph()
        source = self._scene.RegisterSource("part")
        text = export_obj(mesh, include_normals=True)
        shape = Mesh(InMemoryMesh(mesh_file=MemoryFile(text, ".obj", "part")))
        instance = GeometryInstance(RigidTransform(), shape, "part")
        properties = PerceptionProperties()
        properties.AddProperty("label", "id", RenderLabel(1))
        instance.set_perception_properties(properties)
        self._scene.RegisterAnchoredGeometry(source, instance)
        self._context = self._scene.CreateDefaultContext()

    def depths(self, pinhole: Pinhole, X_CP: list[RigidTransform]) -> list[Array]:
        """Return the depth (h, w) of each view [m], 0 where the part is not.

        Args:
            pinhole: Of the camera.
            X_CP: The part in the camera, for each view.

        Raises:
            NoRendering: This machine cannot render.
        """
        core = camera_core(pinhole.drake)
        camera = DepthRenderCamera(core, DepthRange(core.clipping().near(), FARTHEST))
        with rendering(self._scene, self._context, shadows=False) as query:
            images = [
                query.RenderDepthImage(camera, self._scene.world_frame_id(), X.inverse())
                for X in X_CP
            ]
        found = [np.array(image.data[:, :, 0], float) for image in images]
        return [np.where(np.isfinite(depth), depth, 0.0) for depth in found]
