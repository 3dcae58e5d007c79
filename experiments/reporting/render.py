"""Pictures of a scene for reports: a view of it as a PNG."""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from matplotlib.image import imsave
from pydrake.geometry import ColorRenderCamera, SceneGraph
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context
from pydrake.systems.sensors import CameraInfo

from cell.machines.cameras.pinhole import looking_at
from cell.machines.cameras.rendering import camera_core, rendering


@dataclass(frozen=True)
class View:
    """A camera C that looks at a point.

    Attributes:
        p_WC: Position [m].
        p_WTarget: Point that it looks at [m]; not vertically above or below it.
        fov_deg: Vertical field of view [deg].
        width, height: Of the picture, in pixels.
    """

    p_WC: tuple[float, float, float]
    p_WTarget: tuple[float, float, float]
    fov_deg: float = 35.0
    width: int = 960
    height: int = 640

    @property
    def X_WC(self) -> RigidTransform:
        """Pose of the camera: x to the right, y down, z into the image."""
        return looking_at(self.p_WC, self.p_WTarget)

    def camera(self) -> ColorRenderCamera:
        """Return Drake's description of the camera."""
        info = CameraInfo(self.width, self.height, np.deg2rad(self.fov_deg))
        return ColorRenderCamera(camera_core(info), show_window=False)


# From over the front edge of the table: both arms, jig and tray; and a close-up of the jig.
CELL_VIEW = View(p_WC=(0.8, 1.9, 1.25), p_WTarget=(0.0, 0.05, 0.25))
JIG_VIEW = View(p_WC=(0.25, 0.6, 0.42), p_WTarget=(0.0, 0.15, 0.25))


def take_pictures(
    scene_graph: SceneGraph, root: Context, views: Iterable[View], *, shadows: bool = True
) -> list[bytes]:
    """Return a PNG of each view of the scene in its present state; arguments as of `rendering`.

    Raises:
        NoRendering: This machine cannot render.
    """
    world = scene_graph.world_frame_id()
    with rendering(scene_graph, root, shadows=shadows) as query:
        images = [query.RenderColorImage(view.camera(), world, view.X_WC) for view in views]
    return [png(image.data[:, :, :3]) for image in images]


def take_picture(
    scene_graph: SceneGraph, root: Context, view: View, *, shadows: bool = True
) -> bytes:
    """Return a PNG of one view, as `take_pictures`."""
    (picture,) = take_pictures(scene_graph, root, [view], shadows=shadows)
    return picture


def png(pixels: np.ndarray) -> bytes:
    """Return an (h, w, 3) array of bytes as a PNG."""
    buffer = io.BytesIO()
    imsave(buffer, pixels, format="png")
    return buffer.getvalue()
