"""Pictures: the camera looks where it should, the state stays, and a missing library is told."""

import io
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from cell.machines.cameras import rendering
from cell.machines.cameras.rendering import NoRendering, rendering_problem
from experiments.reporting.render import View, take_picture, take_pictures

# From +y, so that +x is on the left of the picture.
VIEW = View(p_WC=(0.0, 2.0, 0.5), p_WTarget=(0.0, 0.0, 0.5), width=120, height=80)
needs_rendering = pytest.mark.skipif("rendering_problem() is not None", reason="no rendering here")


@pytest.fixture
def red_box():
    """A free red cube; return scene graph, root context and a function that places it."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    cube = plant.AddRigidBody("cube", SpatialInertia.SolidBoxWithMass(1.0, 0.2, 0.2, 0.2))
    shape = Box(0.2, 0.2, 0.2)
    plant.RegisterVisualGeometry(cube, RigidTransform(), shape, "cube", [1.0, 0.0, 0.0, 1.0])
    plant.Finalize()
    diagram = builder.Build()  # Must outlive the test, hence the yield below.
    root = diagram.CreateDefaultContext()

    def place(p_WCube: tuple[float, float, float]) -> None:
        context = plant.GetMyMutableContextFromRoot(root)
        plant.SetFreeBodyPose(context, cube, RigidTransform(np.array(p_WCube)))

    yield scene_graph, root, place


def red_pixels(png: bytes) -> np.ndarray:
    """Return row and column of every reddish pixel, (n, 2)."""
    rgb = imread(io.BytesIO(png), format="png")
    return np.argwhere((rgb[..., 0] > 0.3) & (rgb[..., 1] < 0.2))


def test_camera_axes() -> None:
    """The camera is at p_WC, its z points at the target, its y points down, right-handed."""
    X_WC = VIEW.X_WC
    np.testing.assert_allclose(X_WC.translation(), [0.0, 2.0, 0.5])
    np.testing.assert_allclose(X_WC.rotation().matrix()[:, 2], [0.0, -1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(X_WC.rotation().matrix()[:, 1], [0.0, 0.0, -1.0], atol=1e-12)


@needs_rendering
def test_picture_shows_the_scene_where_it_is_now(red_box) -> None:
    """The cube is seen on the side it is on, also after it moved between two pictures."""
    scene_graph, root, place = red_box
    for x, on_left in ((0.3, True), (-0.3, False)):
        place((x, 0.0, 0.5))
        columns = red_pixels(take_picture(scene_graph, root, VIEW))[:, 1]
        assert len(columns) > 50
        assert (columns.mean() < VIEW.width / 2) == on_left


@needs_rendering
def test_picture_shows_poses_that_were_evaluated_before(red_box) -> None:
    """A renderer that comes late must not draw everything at the origin."""
    scene_graph, root, place = red_box
    place((0.0, 0.0, 0.5))
    scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))
    rows = red_pixels(take_picture(scene_graph, root, VIEW))[:, 0]
    assert rows.mean() == pytest.approx(VIEW.height / 2, abs=3)


@needs_rendering
def test_picture_leaves_the_state_alone(red_box) -> None:
    scene_graph, root, place = red_box
    place((0.1, 0.0, 0.5))
    before = root.get_discrete_state_vector().CopyToVector()
    first = take_picture(scene_graph, root, VIEW)
    np.testing.assert_array_equal(root.get_discrete_state_vector().CopyToVector(), before)
    assert take_picture(scene_graph, root, VIEW) == first
    assert scene_graph.RendererCount() == 0


@needs_rendering
def test_several_views_are_the_pictures_of_each(red_box) -> None:
    scene_graph, root, place = red_box
    place((0.1, 0.0, 0.5))
    views = [VIEW, replace(VIEW, p_WC=(2.0, 0.0, 0.5), width=90)]
    alone = [take_picture(scene_graph, root, view) for view in views]
    assert alone[0] != alone[1]
    assert take_pictures(scene_graph, root, views) == alone


@pytest.fixture
def no_cached_probe():
    """Probe anew in this test, and again after it."""
    rendering_problem.cache_clear()
    yield
    rendering_problem.cache_clear()


@pytest.mark.parametrize(
    ("code", "stderr", "reason"),
    [
        (-11, "", "crashed with signal 11"),
        (1, "Traceback\nRuntimeError: no libEGL", "RuntimeError: no libEGL"),
        (1, "", "failed"),
    ],
)
def test_missing_library_is_a_reason_not_a_crash(
    red_box, no_cached_probe, monkeypatch, code: int, stderr: str, reason: str
) -> None:
    scene_graph, root, _ = red_box
    done = subprocess.CompletedProcess([], code, "", stderr)
    monkeypatch.setattr(rendering.subprocess, "run", lambda *_, **__: done)
    problem = rendering_problem()
    assert problem is not None
    assert reason in problem
    assert "libegl1 libgl1-mesa-dri" in problem
    with pytest.raises(NoRendering, match=reason):
        take_picture(scene_graph, root, VIEW)


def test_probe_that_hangs_is_given_up(no_cached_probe, monkeypatch) -> None:
    def hang(command, *, timeout, **_):
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(rendering.subprocess, "run", hang)
    assert "no picture after 120 s" in (rendering_problem() or "")
