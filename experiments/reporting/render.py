"""Off-screen rendering of a scene.

Rendering needs two system libraries: without libEGL Drake raises, without a DRI driver the process
crashes. So it is probed once in a child process; if that fails, callers get the reason and carry on
without pictures.
"""

from __future__ import annotations

import functools
import io
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
from matplotlib.image import imsave
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context
from pydrake.systems.sensors import CameraInfo

from cell.errors import RunFailure

PACKAGES = "libegl1 libgl1-mesa-dri"
PROBE_TIMEOUT = 120.0  # [s] A first start from a cold disk takes about ten.
RENDERER = "pictures"


class NoRendering(RunFailure):
    """This machine cannot render, with the reason."""


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
        forward = np.subtract(self.p_WTarget, self.p_WC)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        columns = [right, np.cross(forward, right), forward]
        R_WC = np.stack([column / np.linalg.norm(column) for column in columns], axis=1)
        return RigidTransform(RotationMatrix(R_WC), np.array(self.p_WC))

    def camera(self) -> ColorRenderCamera:
        """Return Drake's description of the camera."""
        info = CameraInfo(self.width, self.height, np.deg2rad(self.fov_deg))
        core = RenderCameraCore(RENDERER, info, ClippingRange(0.01, 20.0), RigidTransform())
        return ColorRenderCamera(core, show_window=False)


# From over the front edge of the table: both arms, jig and tray; and a close-up of the jig.
CELL_VIEW = View(p_WC=(0.8, 1.9, 1.25), p_WTarget=(0.0, 0.05, 0.25))
JIG_VIEW = View(p_WC=(0.25, 0.6, 0.42), p_WTarget=(0.0, 0.15, 0.25))


def take_picture(
    scene_graph: SceneGraph, root: Context, view: View, *, shadows: bool = True
) -> bytes:
    """Return a PNG of the scene in its present state; the state is not changed.

    Args:
        scene_graph: Its geometries with the perception role are rendered.
        root: Context of the diagram that the scene graph is in.
        view: The camera.
        shadows: Whether to render shadows, which have jagged edges in close-ups.

    Raises:
        NoRendering: `rendering_problem` returns a reason.
    """
    if reason := rendering_problem():
        raise NoRendering(reason)
    context = scene_graph.GetMyMutableContextFromRoot(root)
    scene_graph.AddRenderer(context, RENDERER, MakeRenderEngineVtk(_engine_parameters(shadows)))
    # Otherwise the new renderer gets no poses that were computed before it was added.
    context.SetAllCacheEntriesOutOfDate()
    try:
        query = scene_graph.get_query_output_port().Eval(context)
        image = query.RenderColorImage(view.camera(), scene_graph.world_frame_id(), view.X_WC)
    finally:
        scene_graph.RemoveRenderer(context, RENDERER)
    return png(image.data[:, :, :3])


def png(pixels: np.ndarray) -> bytes:
    """Return an (h, w, 3) array of bytes as a PNG."""
    buffer = io.BytesIO()
    imsave(buffer, pixels, format="png")
    return buffer.getvalue()


def _engine_parameters(shadows: bool) -> RenderEngineVtkParams:
    """Return a key light from above, a weaker fill light, and a light at the camera."""
    lamps = [
        LightParameter(type="directional", frame=frame, direction=direction, intensity=intensity)
        for frame, direction, intensity in (
            ("world", [-0.4, -0.5, -1.0], 0.8),
            ("world", [0.6, -0.3, -0.8], 0.4),
            ("camera", [0.0, 0.0, 1.0], 0.4),
        )
    ]
    return RenderEngineVtkParams(
        default_clear_color=[0.93, 0.94, 0.96],
        lights=lamps,
        cast_shadows=shadows,
        shadow_map_size=1024,
    )


@functools.cache
def rendering_problem() -> str | None:
    """Return why this machine cannot render, or None if it can; tried once per process."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "experiments.reporting.render"],
            capture_output=True, text=True, timeout=PROBE_TIMEOUT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"no picture after {PROBE_TIMEOUT:g} s; the packages {PACKAGES} may be missing"
    if done.returncode == 0:
        return None
    if done.returncode < 0:
        reason = f"the renderer crashed with signal {-done.returncode}"
    else:
        reason = (done.stderr.strip().splitlines() or ["the renderer failed"])[-1]
    return f"{reason}; the packages {PACKAGES} may be missing"


def probe() -> None:
    """Render an empty scene, to check that the system libraries are present."""
    camera = View((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), width=8, height=8).camera()
    scene_graph = SceneGraph()
    scene_graph.AddRenderer(RENDERER, MakeRenderEngineVtk(RenderEngineVtkParams()))
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())
    query.RenderColorImage(camera, scene_graph.world_frame_id(), RigidTransform())


if __name__ == "__main__":
    probe()
