"""Off-screen rendering of a scene, on demand.

Rendering needs two system libraries: without libEGL Drake raises, without a DRI driver the process
crashes. So it is probed once in a child process; if that fails, callers get the reason and carry on
without pictures.
"""

from __future__ import annotations

import functools
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    QueryObject,
    RenderCameraCore,
    RenderEngineVtkParams,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context
from pydrake.systems.sensors import CameraInfo

from cell.errors import RunFailure

PACKAGES = "libegl1 libgl1-mesa-dri"
PROBE_TIMEOUT = 120.0  # [s] A first start from a cold disk takes about ten.
RENDERER = "pictures"
CLIPPING = ClippingRange(0.01, 20.0)  # [m]


class NoRendering(RunFailure):
    """This machine cannot render, with the reason."""


@dataclass(frozen=True)
class Lamp:
    """Parallel light.

    Attributes:
        frame: Which it is fixed to: "world" or "camera".
        direction: (3,) in which it shines, in that frame.
        intensity: 1 shows a surface across it in its own colour.
    """

    frame: str
    direction: tuple[float, float, float]
    intensity: float


@dataclass(frozen=True)
class Lighting:
    """How a scene is lit.

    Attributes:
        lamps: At least one.
        background: Red, green and blue of what is behind everything, 0 to 1.
    """

    lamps: tuple[Lamp, ...]
    background: tuple[float, float, float]


# A key light from above, a weaker fill light, and a light at the camera.
USUAL = Lighting(
    (
        Lamp("world", (-0.4, -0.5, -1.0), 0.8),
        Lamp("world", (0.6, -0.3, -0.8), 0.4),
        Lamp("camera", (0.0, 0.0, 1.0), 0.4),
    ),
    (0.93, 0.94, 0.96),
)


def camera_core(info: CameraInfo, renderer: str = RENDERER) -> RenderCameraCore:
    """Return Drake's description of a camera that renders with `rendering`, under that name."""
    return RenderCameraCore(renderer, info, CLIPPING, RigidTransform())


@contextmanager
def rendering(
    scene_graph: SceneGraph,
    root: Context,
    *,
    shadows: bool = True,
    lighting: Lighting = USUAL,
    renderer: str = RENDERER,
) -> Iterator[QueryObject]:
    """Give a query object that renders the scene in its present state; the state is not changed.

    Args:
        scene_graph: Its geometries with the perception role are rendered.
        root: Context of the diagram that the scene graph is in.
        shadows: Whether to render shadows, which have jagged edges in close-ups.
        lighting: Of colour images.
        renderer: Its name: several may be there at the same time.

    Raises:
        NoRendering: `rendering_problem` returns a reason.
    """
    if reason := rendering_problem():
        raise NoRendering(reason)
    context = scene_graph.GetMyMutableContextFromRoot(root)
    engine = MakeRenderEngineVtk(_engine_parameters(shadows, lighting))
    scene_graph.AddRenderer(context, renderer, engine)
    # Otherwise the new renderer gets no poses that were computed before it was added.
    context.SetAllCacheEntriesOutOfDate()
    try:
        yield scene_graph.get_query_output_port().Eval(context)
    finally:
        scene_graph.RemoveRenderer(context, renderer)


def _engine_parameters(shadows: bool, lighting: Lighting) -> RenderEngineVtkParams:
    lamps = [
        LightParameter(
            type="directional",
            frame=lamp.frame,
            direction=list(lamp.direction),
            intensity=lamp.intensity,
        )
        for lamp in lighting.lamps
    ]
    return RenderEngineVtkParams(
        default_clear_color=list(lighting.background),
        lights=lamps,
        cast_shadows=shadows,
        shadow_map_size=1024,
    )


@functools.cache
def rendering_problem() -> str | None:
    """Return why this machine cannot render, or None if it can; tried once per process."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "cell.machines.cameras.rendering"],
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
    scene_graph = SceneGraph()
    scene_graph.AddRenderer(RENDERER, MakeRenderEngineVtk(RenderEngineVtkParams()))
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())
    camera = ColorRenderCamera(camera_core(CameraInfo(8, 8, 0.6)), show_window=False)
    query.RenderColorImage(camera, scene_graph.world_frame_id(), RigidTransform())


if __name__ == "__main__":
    probe()
