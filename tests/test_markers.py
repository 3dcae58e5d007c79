"""The board of markers: what it looks like, finding it in images, and what follows from that."""

from collections.abc import Iterable
from itertools import product

import numpy as np
import pytest
from drawn_board import INK, PAPER, PINHOLE, drawn, plane_depth, viewed_from
from pydrake.geometry import Role
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from cell.configuration.config import CellConfig
from cell.errors import InputError
from cell.machines.cameras import marker_board as board
from cell.machines.cameras.camera import ABOVE, cameras_of
from cell.machines.cameras.color_image import photographed
from cell.machines.cameras.pinhole import HALF_PIXEL, Pinhole
from cell.machines.cameras.rendering import rendering, rendering_problem  # noqa: F401
from cell.machines.workcell import add_workcell
from experiments.vision.pose_error import apart, random_error
from planning.perception.hand_eye_calibration import BoardView, calibrate_hand_eye
from planning.perception.marker_detection import detect_markers
from planning.perception.marker_erasing import without_markers
from planning.perception.marker_pose import BoardOutOfSight, board_pose, moved

needs_rendering = pytest.mark.skipif("rendering_problem() is not None", reason="no rendering here")
VIEWS = [(20.0, 85.0, 0.40), (100.0, 60.0, 0.42, 30.0), (230.0, 45.0, 0.45, -80.0)]


def corners_at(
    X_CD: RigidTransform, markers: Iterable[int] = range(12), noise: float = 0.0, rng=None
) -> dict[int, np.ndarray]:
    """Return exact corners of markers, with noise [pixels]."""
    rng = rng or np.random.default_rng(0)
    exact = {k: PINHOLE.project((X_CD @ board.marker_corners()[k].T).T) for k in markers}
    return {k: pixels + rng.normal(scale=noise, size=(4, 2)) for k, pixels in exact.items()}


def test_no_marker_looks_like_another_however_it_is_turned() -> None:
    cells = [board.marker_cells(code) for code in board.CODES]
    for i, j, turn in product(range(12), range(12), range(4)):
        if (i, turn) != (j, 0):
            assert (cells[i] != np.rot90(cells[j], turn)).sum() >= 5


def test_markers_are_on_the_sheet_and_clear_of_the_jig() -> None:
    reach = np.abs(board.marker_corners()[..., :2]).max(axis=2)
    cell = board.MARKER / board.CELLS
    assert reach.max() <= board.SIDE / 2 - cell
    assert reach.min() >= board.HOLE / 2 + cell
    x, y = (board.marker_corners()[0, :, k] for k in range(2))
    assert (x[1] - x[0], y[0] - y[3]) == (pytest.approx(0.04), pytest.approx(0.04))


@pytest.mark.parametrize("there", [False, True])
def test_the_board_is_only_seen_and_only_if_it_is_asked_for(there: bool) -> None:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    workcell = add_workcell(plant, CellConfig.load(overrides={"camera.markers": there}), None)
    inspector, plate = scene_graph.model_inspector(), workcell.plate.index()
    names = [
        inspector.GetName(geometry)
        for role in (Role.kPerception, Role.kProximity)
        for geometry in inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(plate), role)
    ]
    assert sum("marker_board" in name for name in names) == (2 if there else 0)
    assert len(plant.GetCollisionGeometriesForBody(workcell.plate)) == 1


@pytest.mark.parametrize("view", VIEWS)
def test_all_markers_are_found_in_a_drawn_image(view: tuple[float, ...]) -> None:
    X_CD = viewed_from(*view)
    found = detect_markers(drawn(X_CD, np.random.default_rng(0)))
    exact = {
        k: pixels
        for k, pixels in corners_at(X_CD).items()
        if ((pixels > 3.0) & (pixels < [844.0, 476.0])).all()
    }
    assert set(found) >= set(exact) and len(exact) >= 8
    errors = np.array([found[k] - exact[k] for k in exact])
    assert np.sqrt((errors**2).mean()) < 0.1
    # The pixel convention: half a pixel would show.
    assert np.abs(errors.mean(axis=(0, 1))).max() < 0.03
    offset, turn = apart(board_pose(found, PINHOLE).X_CD.inverse(), X_CD.inverse())
    assert offset < 0.3 and turn < 0.05


def test_a_marker_that_runs_together_with_a_shadow_is_found() -> None:
    X_CD = viewed_from(*VIEWS[0])
    image = drawn(X_CD, np.random.default_rng(0))
    corner = corners_at(X_CD)[5][1].round().astype(int)
    image[corner[1] - 2 : corner[1] + 3, corner[0] :] = INK  # A dark stripe from there to the edge.
    assert 5 in detect_markers(image)


def test_what_is_no_marker_is_not_found() -> None:
    rng = np.random.default_rng(0)
    image = np.full((480, 848, 3), PAPER)
    for _ in range(30):
        row, column = rng.integers(0, 420), rng.integers(0, 790)
        block = np.kron(rng.random((6, 6)) < 0.7, np.ones((8, 8)))
        image[row : row + 48, column : column + 48] = np.where(block, INK, PAPER)[..., None]
    assert not detect_markers(image.astype(np.uint8))


def test_too_few_markers_are_said_to_be_too_few() -> None:
    corners = corners_at(viewed_from(*VIEWS[0]), markers=(3, 8))
    with pytest.raises(
        BoardOutOfSight, match=r"2 of its 12 markers were seen, at least 3"
    ) as error:
        board_pose(corners, PINHOLE)
    assert error.value.seen == 2


def test_a_corner_that_is_astray_is_left_out() -> None:
    X_CD = viewed_from(*VIEWS[1])
    corners = corners_at(X_CD, noise=0.05)
    corners[4][2] += [3.0, -2.0]
    offset, turn = apart(board_pose(corners, PINHOLE).X_CD.inverse(), X_CD.inverse())
    assert offset < 0.2 and turn < 0.03


def test_the_covariance_says_how_wrong_a_pose_is() -> None:
    """Errors weighed by it have the spread of six standard normal numbers."""
    rng, X_CD, weighed = np.random.default_rng(1), viewed_from(*VIEWS[1]), []
    for _ in range(40):
        found = board_pose(corners_at(X_CD, range(6), noise=0.1, rng=rng), PINHOLE)
        turn = (X_CD.rotation().inverse() @ found.X_CD.rotation()).ToAngleAxis()
        error = np.r_[turn.angle() * turn.axis(), (found.X_CD.translation() - X_CD.translation())]
        weighed.append(error @ np.linalg.solve(found.covariance, error))
    assert 4.0 < np.mean(weighed) < 9.0


@needs_rendering
def test_a_rendered_board_tells_where_the_camera_is() -> None:
    """To 0.6 mm and 0.08 degrees; Drake's principal point instead of OpenCV's loses as much."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    config = CellConfig.load(overrides={"camera.markers": True})
    add_workcell(plant, config, None)
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    X_WJ, rng = config.workcell.X_WJ, np.random.default_rng(0)
    camera = cameras_of(plant, scene_graph, X_WJ, config.camera)[ABOVE]
    pinhole = camera.pinhole
    shifted = Pinhole(
        pinhole.width,
        pinhole.height,
        pinhole.focal_length,
        pinhole.cx + HALF_PIXEL,
        pinhole.cy + HALF_PIXEL,
    )
    with rendering(scene_graph, root, shadows=False) as query:
        for view in VIEWS:
            X_CD = viewed_from(*view)
            X_WC = X_WJ @ board.X_JD @ X_CD.inverse()
            color = photographed(camera.render_color(query, X_WC, samples=2), rng)
            corners = detect_markers(color)
            offset, turn = apart(board_pose(corners, pinhole).X_CD.inverse(), X_CD.inverse())
            assert offset < 0.6 and turn < 0.08
            wrong, _ = apart(board_pose(corners, shifted).X_CD, X_CD)
            assert wrong > 0.4


X_MC = CellConfig().camera.X_MC
X_WD = CellConfig().workcell.X_WJ @ board.X_JD


def views_of_board(count: int, rng: np.random.Generator) -> list[BoardView]:
    """Return views from random sides whose kinematics are a little off."""
    views = []
    for k in range(count):
        azimuth, elevation = rng.uniform(-180.0, 180.0), rng.uniform(45.0, 80.0)
        X_CD = viewed_from(azimuth, elevation, rng.uniform(0.3, 0.4), 90.0 * k)
        step = rng.normal(size=6) * np.repeat([np.deg2rad(0.05), 1e-4], 3)
        X_WM = moved(X_WD @ X_CD.inverse() @ X_MC.inverse(), step)
        views.append(
            BoardView(X_WM, board_pose(corners_at(X_CD, noise=0.1, rng=rng), PINHOLE).X_CD)
        )
    return views


def test_the_mount_of_the_camera_is_recovered() -> None:
    """From 3 mm and 2 degrees off to 0.5 mm and 0.2 degrees, with the kinematics off, too."""
    rng, weighed = np.random.default_rng(0), []
    for _ in range(2):
        start = X_MC @ random_error(3e-3, 2.0, rng)
        found = calibrate_hand_eye(views_of_board(15, rng), start)
        offset, turn = apart(found.X_MC, X_MC)
        assert offset < 0.5 and turn < 0.2
        assert apart(found.X_WD, X_WD)[0] < 0.5
        sigma = 1e3 * np.sqrt(np.trace(found.covariance[3:6, 3:6]))
        weighed.append(offset / sigma)
    assert 0.1 < np.sqrt(np.mean(np.square(weighed))) < 2.0


def test_views_that_do_not_fix_the_mount_are_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="2 views"):
        calibrate_hand_eye(views_of_board(2, rng), X_MC)
    X_CD = viewed_from(0.0, 60.0, 0.35)
    about_one = [
        BoardView(X_WD @ RigidTransform(RotationMatrix.MakeZRotation(a), np.zeros(3)), X_CD)
        for a in (0.0, 0.5, 1.0, 1.5)
    ]
    with pytest.raises(InputError, match="one axis"):
        calibrate_hand_eye(about_one, X_MC)


def test_erasing_leaves_paper_and_what_is_in_front() -> None:
    X_CD, rng = viewed_from(*VIEWS[0]), np.random.default_rng(0)
    image, depth = drawn(X_CD, rng), plane_depth(X_CD)
    front = np.zeros(depth.shape, bool)
    front[200:330, 250:350] = True  # Over markers, and the paper beside them.
    depth[front] -= 0.03
    image[front] = (60, 90, 160)
    known = np.zeros(depth.shape, bool)
    known[:120, 500:560] = True
    depth[known] = 0.0
    depth[rng.random(depth.shape) < 0.02] = 0.0
    blank = without_markers(image, depth, PINHOLE, X_CD, known, rng)
    assert len(detect_markers(image)) >= 8 and not detect_markers(blank)
    changed = (blank != image).any(axis=2)
    assert not changed[front & (depth > 0.0)].any() and not changed[known].any()
    # Of a marker that nothing hides nothing is left: level and noise are those of the paper.
    corners = corners_at(X_CD)[11]
    (left, top), (right, bottom) = corners.min(axis=0).astype(int), corners.max(axis=0).astype(int)
    patch = blank[top:bottom, left:right].astype(float)
    assert patch.mean() == pytest.approx(PAPER, abs=3.0)
    assert patch.std() == pytest.approx(3.0, abs=1.0)
