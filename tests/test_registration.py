"""Registration: known offsets are found from points alone; too few points are no estimate."""

import numpy as np
import pytest
import trimesh
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from scipy.spatial.transform import Rotation

from cell.machines.cameras.pinhole import looking_at
from planning.perception.registration import View, register
from planning.perception.surface import Surface
from planning.perception.viewpoints import DISTANCE, viewpoints


@pytest.fixture(scope="module")
def bracket() -> trimesh.Trimesh:
    """An L of 60 x 40 x 50 mm with a block on it, which nothing turns into itself."""
    boxes = [((60, 40, 8), (0, 0, 4)), ((8, 40, 42), (-26, 0, 29)), ((12, 8, 6), (15, 11, 11))]
    mesh = trimesh.util.concatenate(
        [
            trimesh.creation.box(1e-3 * np.array(size)).apply_translation(1e-3 * np.array(at))
            for size, at in boxes
        ]
    )
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def seen(mesh: trimesh.Trimesh, X_WP: RigidTransform, cameras, noise: float = 0.0) -> list[View]:
    """Return what cameras see of a part: points of the faces that look at them, with noise."""
    rng = np.random.default_rng(5)
    views = []
    for X_WC in cameras:
        points, faces = trimesh.sample.sample_surface(mesh, 6000, seed=9)[:2]
        points, normals = np.array(points), mesh.face_normals[faces]
        p_PC = X_WP.inverse() @ X_WC.translation()
        ahead = ((p_PC - points) * normals).sum(axis=1) > 0.2 * np.linalg.norm(
            p_PC - points, axis=1
        )
        p_WQ = (X_WP @ points[ahead].T).T
        rays = p_WQ - X_WC.translation()
        depth = np.linalg.norm(rays, axis=1, keepdims=True)
        p_WQ += rays / depth * rng.normal(scale=noise, size=depth.shape) if noise else 0.0
        views.append(View(p_WQ, X_WC.translation()))
    return views


@pytest.fixture
def pose() -> RigidTransform:
    return RigidTransform(RollPitchYaw(0.02, -0.03, 0.7), [0.1, -0.05, 0.2])


def off(X_WP: RigidTransform, mm: float, deg: float, seed: int) -> RigidTransform:
    rng = np.random.default_rng(seed)
    way, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    turn = RotationMatrix(Rotation.from_rotvec(np.deg2rad(deg) * axis).as_matrix())
    return X_WP @ RigidTransform(turn, 1e-3 * mm * way)


@pytest.mark.parametrize("seed", range(6))
def test_exact_points_give_the_pose(bracket, pose, seed: int) -> None:
    cameras = viewpoints(pose.translation(), 3, np.random.default_rng(seed))
    found = register(Surface.of(bracket), seen(bracket, pose, cameras), off(pose, 5.0, 15.0, seed))
    assert found is not None
    error = pose.inverse() @ found.X_WP
    assert np.linalg.norm(error.translation()) < 5e-5
    assert error.rotation().ToAngleAxis().angle() < np.deg2rad(0.1)
    assert found.share > 0.95


def test_covariance_covers_the_errors_that_noise_makes(bracket, pose) -> None:
    """Over many looks the squared errors by their covariance are of the order of the dimension."""
    surface, squares = Surface.of(bracket), []
    for seed in range(8):
        cameras = viewpoints(pose.translation(), 3, np.random.default_rng(seed))
        views = seen(bracket, pose, cameras, noise=4e-4)
        found = register(surface, views, off(pose, 3.0, 5.0, seed))
        assert found is not None
        error = pose.inverse() @ found.X_WP
        turn = Rotation.from_matrix(error.rotation().matrix()).as_rotvec()
        six = np.r_[turn, found.X_WP.translation() - pose.translation()]
        squares.append(six @ np.linalg.solve(found.covariance, six) / 6.0)
    assert 0.02 < np.median(squares) < 3.0


CLOSE = np.diag(np.repeat([np.deg2rad(0.5), 5e-4], 3) ** 2)


@pytest.mark.parametrize("seed", range(3))
def test_what_is_not_in_sight_stays_as_it_is_known(pose, seed: int) -> None:
    """Of a plate sunk to its face into level ground nothing tells the yaw, nor the place in it."""
    plate = trimesh.creation.box([0.07, 0.06, 0.005])
    ground = trimesh.creation.box([0.3, 0.3, 0.005])  # Flush with the face of the plate.
    cameras = viewpoints(pose.translation(), 3, np.random.default_rng(seed))
    views = seen(ground, pose, cameras, noise=4e-4)
    views = [View(v.points[np.linalg.norm(v.points - pose.translation(), axis=1) < 0.05], v.p_WC)
             for v in views]  # fmt: skip
    start = off(pose, 0.3, 0.3, seed)
    found = register(Surface.of(plate), views, start, covariance=CLOSE)
    assert found is not None
    turn = Rotation.from_matrix((start.inverse() @ found.X_WP).rotation().matrix()).as_rotvec()
    assert abs(turn[2]) < np.deg2rad(0.3)
    error = (pose.inverse() @ found.X_WP).rotation().matrix()
    assert np.arccos(error[2, 2]) < np.deg2rad(0.1)
    assert np.sqrt(found.covariance[2, 2]) == pytest.approx(np.deg2rad(0.5), rel=0.2)


def test_part_that_has_moved_is_seen_although_it_was_known_elsewhere(bracket, pose) -> None:
    cameras = viewpoints(pose.translation(), 3, np.random.default_rng(2))
    views = seen(bracket, pose, cameras, noise=4e-4)
    found = register(Surface.of(bracket), views, off(pose, 5.0, 10.0, 1), covariance=CLOSE)
    assert found is not None
    error = pose.inverse() @ found.X_WP
    assert np.linalg.norm(error.translation()) < 2e-4
    assert error.rotation().ToAngleAxis().angle() < np.deg2rad(0.3)


def test_too_few_points_are_no_estimate(bracket, pose) -> None:
    surface = Surface.of(bracket)
    camera = looking_at(pose.translation() + [0.0, -DISTANCE, 0.1], pose.translation())
    (view,) = seen(bracket, pose, [camera])
    assert register(surface, [View(view.points[:20], view.p_WC)], pose) is None
    assert register(surface, [View(view.points + [0.5, 0.0, 0.0], view.p_WC)], pose) is None


def test_viewpoints_look_at_the_part_from_all_sides() -> None:
    target = np.array([0.1, 0.2, 0.3])
    poses = viewpoints(target, 4, np.random.default_rng(1))
    for X_WC in poses:
        ahead = target - X_WC.translation()
        assert np.linalg.norm(ahead) == pytest.approx(DISTANCE)
        np.testing.assert_allclose(X_WC.rotation().matrix()[:, 2], ahead / DISTANCE, atol=1e-12)
    azimuths = np.unwrap([np.arctan2(*(X.translation() - target)[[1, 0]]) for X in poses])
    np.testing.assert_allclose(np.diff(azimuths), np.pi / 2, atol=1e-9)


def test_a_surface_is_the_same_every_time(bracket) -> None:
    first, again = Surface.of(bracket), Surface.of(bracket)
    assert np.array_equal(first.points, again.points)
    np.testing.assert_allclose(np.linalg.norm(first.normals, axis=1), 1.0)
