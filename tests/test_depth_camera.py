"""Depth cameras: the pixel convention, the errors of stereo depth, and the device on the hand."""

import numpy as np
import pytest
from pydrake.geometry import Box, ColorRenderCamera, DepthRange, DepthRenderCamera, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from cell import CellConfig, build_cell, load_product
from cell.configuration.machines import CameraConfig
from cell.machines.cameras.camera import ABOVE, HAND_EYE, Camera, cameras_of
from cell.machines.cameras.pinhole import HALF_PIXEL, Pinhole
from cell.machines.cameras.rendering import (  # noqa: F401
    Lamp,
    Lighting,
    camera_core,
    rendering,
    rendering_problem,
)
from cell.machines.cameras.stereo_depth import StereoDepth

needs_rendering = pytest.mark.skipif("rendering_problem() is not None", reason="no rendering here")
D435 = StereoDepth(424.0, 0.05, 0.08, 1 / 32, 126.0, 0.0, 0.5, 0.01)
IDEAL = StereoDepth(424.0, 0.05, 0.0, 1e-9, 126.0, 0.0, 0.0, 0.0)


def test_projection_and_points_are_inverse() -> None:
    pinhole = Pinhole(64, 48, 50.0, 30.2, 25.7)
    rng = np.random.default_rng(0)
    depth = np.where(rng.random((48, 64)) < 0.5, rng.uniform(0.3, 1.0, (48, 64)), 0.0)
    row, column = np.nonzero(depth)
    pixels = pinhole.project(pinhole.points(depth))
    np.testing.assert_allclose(pixels, np.column_stack([column, row]), atol=1e-9)


def test_finer_pixels_are_parts_of_the_coarse_ones() -> None:
    """The middle of a pixel is that of the pixels that it is divided into."""
    pinhole, p_CQ = Pinhole(64, 48, 50.0, 30.2, 25.7), np.array([[0.1, -0.2, 0.7]])
    fine = pinhole.finer(3)
    assert (fine.width, fine.height) == (192, 144)
    coarse = pinhole.project(p_CQ)
    # Three fine pixels, 3 u - 1 to 3 u + 1 of those counted here, make the coarse pixel u.
    np.testing.assert_allclose(fine.project(p_CQ), 3.0 * coarse + 1.0)


@needs_rendering
def test_colour_depends_on_lighting_and_is_smooth_at_edges_when_sampled() -> None:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    tilted = RigidTransform(RotationMatrix.MakeZRotation(0.1), np.zeros(3))
    plant.RegisterVisualGeometry(
        plant.world_body(), tilted, Box(0.2, 0.2, 0.02), "plate", [1, 1, 1, 1]
    )
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    camera = cameras_of(plant, scene_graph, RigidTransform(), CameraConfig())[ABOVE]
    X_WC, lamp, black = camera.X_WC(root), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)
    levels = {}
    for intensity in (0.4, 0.8):
        lighting = Lighting((Lamp("world", lamp, intensity),), black)
        with rendering(scene_graph, root, shadows=False, lighting=lighting) as query:
            levels[intensity] = camera.render_color(query, X_WC)
            fine = camera.render_color(query, X_WC, samples=2)
    middle = slice(230, 250), slice(414, 434)
    assert levels[0.8][middle].mean() == pytest.approx(2.0 * levels[0.4][middle].mean(), rel=0.05)
    np.testing.assert_allclose(fine[middle], levels[0.8][middle], atol=1)
    between = (fine > 0.1 * fine.max()) & (fine < 0.9 * fine.max())
    assert between.sum() > 100 and fine.shape == levels[0.8].shape


@needs_rendering
def test_pixel_convention_is_that_of_the_renderer() -> None:
    """A small ball is seen where it projects to; Drake's principal point is half a pixel more."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    p_CQ = np.array([0.031, -0.022, 0.35])
    X_WQ = RigidTransform(p_CQ)
    plant.RegisterVisualGeometry(plant.world_body(), X_WQ, Sphere(0.02), "ball", [1.0, 0, 0, 1])
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    pinhole = Pinhole.centred(848, 480, 424.0)
    core = camera_core(pinhole.drake)
    with rendering(scene_graph, root) as query:
        camera = DepthRenderCamera(core, DepthRange(0.05, 2.0))
        world = scene_graph.world_frame_id()
        depth = query.RenderDepthImage(camera, world, RigidTransform()).data[:, :, 0]
        color = query.RenderColorImage(ColorRenderCamera(core, False), world, RigidTransform())
    row, column = np.nonzero(np.isfinite(depth))
    seen = np.array([column.mean(), row.mean()])
    # The outline of a ball is centred a little further out than its centre: by (r / z)^2.
    centre = [pinhole.cx, pinhole.cy]
    meant = centre + (pinhole.project(p_CQ[None])[0] - centre) * (1 + (0.02 / 0.35) ** 2)
    np.testing.assert_allclose(seen, meant, atol=0.1)
    assert np.abs(seen - meant - HALF_PIXEL).min() > 0.3
    assert color.data.shape == (480, 848, 4)


def test_noise_grows_with_the_square_of_the_distance() -> None:
    rng = np.random.default_rng(0)
    for z in (0.3, 0.6, 1.2):
        measured = D435.measured(np.full((200, 300), z), rng)
        spread = measured[measured > 0.0].std()
        assert spread == pytest.approx(D435.sigma(z), rel=0.1)
    assert D435.sigma(0.6) == pytest.approx(4.0 * D435.sigma(0.3))
    assert 3e-4 < D435.sigma(0.32) < 5e-4


def test_bias_moves_a_surface_and_neighbours_are_alike() -> None:
    biased = StereoDepth(424.0, 0.05, 0.0, 1e-9, 126.0, 0.1, 0.0, 0.0)
    rng = np.random.default_rng(0)
    moved = biased.measured(np.full((9, 9), 0.3), rng)
    np.testing.assert_allclose(moved, 21.2 / (21.2 / 0.3 + 0.1), rtol=1e-6)
    noise = D435.measured(np.full((200, 300), 0.5), rng)
    both = (noise[:, 1:] > 0.0) & (noise[:, :-1] > 0.0)
    near = np.corrcoef(noise[:, 1:][both], noise[:, :-1][both])[0, 1]
    assert near > 0.5


def test_nothing_is_measured_too_near_or_where_there_is_nothing() -> None:
    rng = np.random.default_rng(0)
    assert D435.nearest == pytest.approx(0.168, abs=1e-3)
    assert not D435.measured(np.full((20, 20), 0.15), rng).any()
    assert not D435.measured(np.full((20, 20), np.inf), rng).any()
    assert not D435.measured(np.zeros((20, 20)), rng).any()


def test_shadow_is_on_the_left_and_as_wide_as_the_disparities_differ() -> None:
    """The right imager looks past the left edge of what is in front, and sees no further left."""
    depth = np.full((20, 200), 0.6)
    depth[:, 100:150] = 0.3
    measured = IDEAL.measured(depth, np.random.default_rng(0))
    lost = np.flatnonzero(measured[10] == 0.0)
    width = 21.2 / 0.3 - 21.2 / 0.6
    assert lost.max() == 99
    assert len(lost) == pytest.approx(width, abs=1.5)
    np.testing.assert_allclose(measured[10, 100:150], 0.3, rtol=1e-6)


def test_edges_and_dropouts_lose_their_share() -> None:
    rng = np.random.default_rng(0)
    flat = D435.measured(np.full((300, 300), 0.5), rng)
    assert np.mean(flat == 0.0) == pytest.approx(0.01, abs=0.003)
    ridge = np.full((400, 60), 0.5)
    ridge[:, 30:] = 0.52
    lossy = StereoDepth(424.0, 0.05, 0.0, 1e-9, 126.0, 0.0, 0.5, 0.0)
    edge = lossy.measured(ridge, rng)[:, 30]
    assert np.mean(edge == 0.0) == pytest.approx(0.5, abs=0.1)


def test_the_same_seed_gives_the_same_image() -> None:
    depth = np.linspace(0.3, 0.6, 4000).reshape(50, 80)
    first, again = (D435.measured(depth, np.random.default_rng(3)) for _ in range(2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, D435.measured(depth, np.random.default_rng(4)))


@needs_rendering
def test_fixed_camera_sees_the_height_of_a_box() -> None:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    top = RigidTransform([0.0, 0.0, 0.1])
    plant.RegisterVisualGeometry(plant.world_body(), top, Box(0.4, 0.4, 0.2), "box", [1.0, 0, 0, 1])
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    camera = cameras_of(plant, scene_graph, RigidTransform(), CameraConfig())[ABOVE]
    points = camera.take(root, np.random.default_rng(0)).points()
    above = points[np.abs(points[:, :2]).max(axis=1) < 0.1]
    assert len(above) > 5_000
    assert above[:, 2].mean() == pytest.approx(0.2, abs=1e-4)
    assert above[:, 2].std() == pytest.approx(D435.sigma(0.3), rel=0.15)
    labels = camera.labels(root)
    assert labels[240, 424] == int(plant.world_body().index())


@pytest.fixture(scope="module")
def sees():
    config = CellConfig.load(overrides={"camera.mounted": True})
    return build_cell(config, load_product("motor_unit"))


def test_the_hand_carries_its_camera_where_the_planner_knows_of_it(sees) -> None:
    """It moves with the hand, and collides like any other body of the arm."""
    root = sees.diagram.CreateDefaultContext()
    eye: Camera = sees.cameras[HAND_EYE]
    arm, context = sees.holder, sees.plant.GetMyMutableContextFromRoot(root)
    X_MC = arm.frame("mount").CalcPoseInWorld(context).InvertAndCompose(eye.X_WC(root))
    q = arm.positions(context) + 0.1
    sees.plant.SetPositions(context, arm.instance, q)
    moved = arm.frame("mount").CalcPoseInWorld(context).InvertAndCompose(eye.X_WC(root))
    assert moved.IsNearlyEqualTo(X_MC, 1e-12)
    assert X_MC.IsNearlyEqualTo(sees.config.camera.X_MC, 1e-12)
    # The optical axis leans towards the fingers: it meets the line through them further out.
    lean, side = (X_MC.rotation().matrix() @ [0.0, 0.0, 1.0])[1], X_MC.translation()[1]
    assert abs(lean) > 0.2 and lean * side < 0.0
    # They are at the bottom of the image.
    assert (X_MC.inverse() @ np.array([0.0, 0.0, 0.15]))[1] > 0.0
    assert len(sees.plant.GetCollisionGeometriesForBody(eye.body)) == 1


def test_without_a_mount_there_is_only_the_fixed_camera() -> None:
    cell = build_cell(CellConfig.load(), load_product("motor_unit"))
    assert list(cell.cameras) == [ABOVE]
