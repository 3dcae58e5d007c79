"""Keypoints: votes that err give the pose and how uncertain it is; pictures, in the same way."""

import numpy as np
import pytest
import trimesh
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from scipy.spatial.transform import Rotation

from cell.errors import InputError
from cell.machines.cameras.camera import Picture
from cell.machines.cameras.pinhole import Pinhole, looking_at
from cell.machines.cameras.rendering import rendering_problem  # noqa: F401
from planning.perception.belief import Estimate
from planning.perception.close_up import CloseUp
from planning.perception.estimators import ASTRAY, ByBoth, ByDepth, ByKeypoints
from planning.perception.keypoint_card import KEYPOINTS, KeypointCard, farthest_points
from planning.perception.keypoint_net import KeypointNet, Seen, centres
from planning.perception.keypoint_pose import pose_of_keypoints
from planning.perception.part_alone import PartAlone
from planning.perception.surface import Surface
from planning.perception.voting import Keypoints, vote

needs_rendering = pytest.mark.skipif("rendering_problem() is not None", reason="no rendering here")
CLOSE = Pinhole.centred(128, 128, 330.0)
WIDE = Pinhole.centred(848, 480, 424.0)
RNG = np.random.default_rng


@pytest.fixture(scope="module")
def bracket() -> trimesh.Trimesh:
    """An L that nothing turns into itself."""
    boxes = [((60, 40, 8), (0, 0, 4)), ((8, 40, 42), (-26, 0, 29)), ((12, 8, 6), (15, 11, 11))]
    meshes = [
        trimesh.creation.box(1e-3 * np.array(size)).apply_translation(1e-3 * np.array(at))
        for size, at in boxes
    ]
    mesh = trimesh.util.concatenate(meshes)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


@pytest.fixture(scope="module")
def p_PK(bracket) -> np.ndarray:
    return farthest_points(Surface.of(bracket), KEYPOINTS)


def random_pose(rng: np.random.Generator, distance: float = 0.3) -> RigidTransform:
    turn = RotationMatrix(Rotation.random(rng=rng).as_matrix())
    return RigidTransform(turn, [*rng.normal(scale=5e-3, size=2), distance])


def votes(
    keypoints: np.ndarray, noise_deg: float, wrong: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels of a disc, and directions to keypoints, off by angles; some are anything."""
    cells = np.stack(np.meshgrid(np.arange(32), np.arange(32)), axis=-1).reshape(-1, 2)
    pixels = centres(cells, 4)
    pixels = pixels[np.linalg.norm(pixels - 63.5, axis=1) < 45.0]
    ray = keypoints - pixels[:, None]
    angle = np.arctan2(ray[..., 1], ray[..., 0])
    angle += rng.normal(scale=np.deg2rad(noise_deg), size=angle.shape)
    anything = rng.random(len(pixels)) < wrong
    angle[anything] = rng.uniform(-np.pi, np.pi, (anything.sum(), angle.shape[1]))
    return pixels, np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def six(X_CP: RigidTransform, X_CTrue: RigidTransform) -> np.ndarray:
    turn = Rotation.from_matrix((X_CTrue.inverse() @ X_CP).rotation().matrix()).as_rotvec()
    return np.r_[turn, X_CP.translation() - X_CTrue.translation()]


def test_exact_votes_meet_where_they_point() -> None:
    keypoints = np.array([[40.0, 80.0], [63.25, 63.5], [150.0, -20.0]])  # The last is outside.
    found = vote(*votes(keypoints, 0.0, 0.3, RNG(0)), RNG(1))
    assert found is not None
    np.testing.assert_allclose(found.pixels, keypoints, atol=0.15)


def test_votes_do_not_draw_keypoints_to_the_part() -> None:
    """Distances from lines, instead of angles, would: by several pixels at this noise."""
    keypoint = np.array([[120.0, 63.5]])
    found = [vote(*votes(keypoint, 6.0, 0.0, RNG(k)), RNG(k)) for k in range(40)]
    x = [one.pixels[0, 0] for one in found if one is not None]
    assert len(x) == 40
    assert abs(np.mean(x) - 120.0) < 3.0 * np.std(x) / np.sqrt(len(x))


def test_too_few_or_contradicting_votes_are_none() -> None:
    pixels, directions = votes(np.array([[40.0, 80.0]]), 0.0, 0.0, RNG(0))
    assert vote(pixels[:10], directions[:10], RNG(0)) is None
    parallel = np.broadcast_to([1.0, 0.0], directions.shape)
    assert vote(pixels, parallel, RNG(0)) is None


def test_pose_and_its_covariance_from_votes_that_err(p_PK) -> None:
    """Squared errors by the covariance are six on average, the number of degrees of freedom."""
    rng, squares, errors = RNG(3), [], []
    for _ in range(60):
        X_CP = random_pose(rng)
        keypoints = vote(*votes(CLOSE.project((X_CP @ p_PK.T).T), 3.0, 0.1, rng), rng)
        assert keypoints is not None
        pose = pose_of_keypoints(p_PK, keypoints, CLOSE)
        assert pose is not None
        error = six(pose.X_CP, X_CP)
        squares.append(error @ np.linalg.solve(pose.covariance, error))
        errors.append((np.linalg.norm(error[3:]), np.linalg.norm(error[:3])))
    # The standard deviation of such a mean is sqrt(12 / 60) = 0.45.
    assert 4.0 < np.mean(squares) < 7.5
    assert np.median(errors, axis=0) == pytest.approx([6e-4, 3e-3], rel=0.6)


def test_a_keypoint_that_is_unsure_or_astray_counts_less(p_PK) -> None:
    X_CP = random_pose(RNG(5))
    pixels = CLOSE.project((X_CP @ p_PK.T).T)
    covariance = np.tile(0.01 * np.eye(2), (len(p_PK), 1, 1))
    off = pixels.copy()
    off[4] += 5.0
    loose = covariance.copy()
    loose[4] *= 1e6
    sure = pose_of_keypoints(p_PK, Keypoints(off, loose), CLOSE)
    mixed = pose_of_keypoints(p_PK, Keypoints(off, covariance), CLOSE)
    assert sure is not None and mixed is not None
    assert np.linalg.norm(six(sure.X_CP, X_CP)) < 2e-5
    # A keypoint that nobody doubts, but which does not fit: the pose is said to be uncertain.
    assert mixed.misfit > 10.0
    error = six(mixed.X_CP, X_CP)
    assert error @ np.linalg.solve(mixed.covariance, error) < 40.0


def test_close_ups_see_points_where_the_picture_does() -> None:
    """A dot is drawn in a picture, and found in its close-up where that projects the point to."""
    X_WC = looking_at([0.1, -0.2, 0.25], [0.0, 0.0, 0.0])
    X_CW = X_WC.inverse()
    for p_W in ([0.0, 0.0, 0.0], [0.02, 0.01, 0.0], [-0.03, 0.015, 0.01]):
        p_C = X_CW @ np.array(p_W)
        row, column = np.indices((WIDE.height, WIDE.width))
        x, y = WIDE.project(p_C[None])[0]
        dot = np.exp(-((column - x) ** 2 + (row - y) ** 2) / (2.0 * 2.0**2))
        p_CAim = X_CW @ np.array([5e-3, 0.0, 0.0])
        up_C = X_CW.rotation().matrix()[:, 2]
        close_up = CloseUp.of(p_CAim, up_C, 128, 1000.0, roll=0.2)
        image = close_up.taken(dot, WIDE)
        v, u = np.indices(image.shape)
        seen = np.array([(u * image).sum(), (v * image).sum()]) / image.sum()
        expected = close_up.pinhole.project((close_up.X_CV.inverse() @ p_C)[None])[0]
        np.testing.assert_allclose(seen, expected, atol=0.05)  # Half a pixel would be seen.
    middle = close_up.pinhole.project((close_up.X_CV.inverse() @ p_CAim)[None])[0]
    np.testing.assert_allclose(middle, 63.5, atol=1e-9)


@needs_rendering
def test_close_ups_show_what_a_camera_that_is_turned_there_renders(bracket) -> None:
    """Drake counts pixels from a corner, which shows where they are of different sizes."""
    X_CP = looking_at([0.1, -0.2, 0.25], [0.02, 0.0, 0.0]).inverse()
    close_up = CloseUp.of(X_CP @ np.zeros(3), X_CP.rotation().matrix()[:, 2], 256, 3000.0)
    alone = PartAlone(bracket)
    (whole,) = alone.depths(WIDE, [X_CP])
    (turned,) = alone.depths(close_up.pinhole, [close_up.X_CV.inverse() @ X_CP])
    taken = close_up.taken((whole > 0.0).astype(np.float64), WIDE)
    middles = [np.array([(k * m).sum() for k in np.indices(m.shape)]) / m.sum()
               for m in (taken, (turned > 0.0).astype(float))]  # fmt: skip
    np.testing.assert_allclose(*middles, atol=0.1)


def test_close_ups_are_upright_however_the_camera_is_turned() -> None:
    X_WC = looking_at([0.1, -0.2, 0.25], [0.0, 0.0, 0.0])
    for roll in (0.0, 1.0, np.pi):
        X_CW = (X_WC @ RigidTransform(RotationMatrix.MakeZRotation(roll), np.zeros(3))).inverse()
        close_up = CloseUp.of(X_CW @ np.zeros(3), X_CW.rotation().matrix()[:, 2], 128, 1000.0)
        X_VW = close_up.X_CV.inverse() @ X_CW
        low, high = close_up.pinhole.project((X_VW @ np.array([[0, 0, 0], [0, 0, 0.02]]).T).T)
        assert high[0] == pytest.approx(low[0], abs=1e-9)
        assert high[1] < low[1] - 5.0


class Dots:
    """Stands for a trained net: it sees keypoints by the dots that are drawn where they are.

    Each has a hue of its own; what it knows is the close-up alone.
    """

    def __init__(self, card: KeypointCard) -> None:
        self.card = card

    def see(self, image: np.ndarray) -> Seen:
        found = []
        for hue in hues(len(self.card.p_PK)):
            weight = np.exp(-np.sum((image.astype(float) - hue) ** 2, axis=2) / (2 * 40.0**2))
            weight[weight < 0.5] = 0.0
            row, column = np.indices(weight.shape)
            total = max(weight.sum(), 1e-12)  # Of a dot that is out of the close-up.
            found.append([(column * weight).sum() / total, (row * weight).sum() / total])
        if not image.any():
            return Seen(np.zeros((0, 2)), np.zeros((0, len(self.card.p_PK), 2)))
        middle = np.argwhere(image.any(axis=2)).mean(axis=0)[::-1]
        side = self.card.size // self.card.stride
        cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
        pixels = centres(cells, self.card.stride)
        pixels = pixels[np.linalg.norm(pixels - middle, axis=1) < 30.0]
        return Seen(pixels, np.array(found) - pixels[:, None])


def hues(count: int) -> np.ndarray:
    """Return colours (count, 3) that are far apart."""
    levels = np.stack(np.meshgrid(*[[20, 130, 240]] * 3), axis=-1).reshape(-1, 3)
    return levels[1 : 3 * count : 3].astype(float)


def drawn(p_PK: np.ndarray, X_CP: RigidTransform) -> np.ndarray:
    """Return a picture with a dot of each hue where a keypoint is, on black."""
    fine = WIDE.finer(3)
    image = np.zeros((fine.height, fine.width, 3))
    row, column = np.indices(image.shape[:2])
    for (x, y), hue in zip(fine.project((X_CP @ p_PK.T).T), hues(len(p_PK)), strict=True):
        image[(column - x) ** 2 + (row - y) ** 2 < 7.0**2] = hue
    size = WIDE.height, 3, WIDE.width, 3, 3
    return image.reshape(size).mean(axis=(1, 3)).round().astype(np.uint8)


@pytest.fixture(scope="module")
def scene(bracket) -> tuple[KeypointNet, Picture, RigidTransform]:
    """A picture of a part's keypoints, off the place that is looked at, and the part's pose."""
    card = KeypointCard.of_part("bracket", bracket, 128, 4)
    X_WP = RigidTransform(RollPitchYaw(0.1, -0.05, 0.2), [0.015, -0.01, 0.02])
    X_WC = looking_at([0.05, -0.2, 0.22], [0.0, 0.0, 0.01])
    X_WC = X_WC @ RigidTransform(RotationMatrix.MakeZRotation(2.0), np.zeros(3))
    color = drawn(np.array(card.p_PK), X_WC.inverse() @ X_WP)
    picture = Picture(1.5, X_WC, WIDE, np.zeros((WIDE.height, WIDE.width)), color)
    return Dots(card), picture, X_WP  # type: ignore[return-value]


def test_a_picture_gives_the_pose_in_the_world(scene) -> None:
    net, picture, X_WP = scene
    found = ByKeypoints(net, np.zeros(3), RNG(0)).find([picture], None)
    assert found is not None and found.time == 1.5
    error = six(found.X_WP, X_WP)
    # Half a pixel is 0.3 mm across the line of sight here.
    across = picture.X_WC.rotation().matrix()[:, :2].T @ error[3:]
    assert np.linalg.norm(across) < 1e-4
    assert np.linalg.norm(error[3:]) < 1e-3
    assert np.linalg.norm(error[:3]) < np.deg2rad(0.5)
    # What one image knows worst is how far away the part is.
    values, vectors = np.linalg.eigh(found.covariance[3:, 3:])
    assert abs(vectors[:, 2] @ picture.X_WC.rotation().matrix()[:, 2]) > 0.9


def test_what_shows_nothing_or_something_elsewhere_is_no_estimate(scene) -> None:
    net, picture, _ = scene
    empty = Picture(0.0, picture.X_WC, WIDE, picture.depth, np.zeros_like(picture.color))
    assert ByKeypoints(net, np.zeros(3), RNG(0)).find([empty], None) is None
    # Along the line of sight it looks the same, but its place is not there.
    behind = picture.X_WC @ np.array([0.0, 0.0, 0.31 + 2.0 * ASTRAY])
    assert ByKeypoints(net, behind, RNG(0)).find([picture], None) is None


def test_what_an_estimator_needs_is_named(scene, bracket) -> None:
    net, picture, _ = scene
    blind = Picture(0.0, picture.X_WC, WIDE, picture.depth)
    with pytest.raises(InputError, match="none has colour"):
        ByKeypoints(net, np.zeros(3), RNG(0)).find([blind], None)
    with pytest.raises(InputError, match="prior"):
        ByDepth(Surface.of(bracket), RNG(0)).find([picture], None)


def test_depth_finishes_what_keypoints_have_begun(scene, bracket) -> None:
    net, picture, X_WP = scene
    surface = Surface.of(bracket)
    depth = _splatted(surface, picture.X_WC.inverse() @ X_WP)
    seen = Picture(1.5, picture.X_WC, WIDE, depth, picture.color)
    keypoints = ByKeypoints(net, np.zeros(3), RNG(0))
    found = ByBoth(keypoints, ByDepth(surface, RNG(1))).find([seen], None)
    assert isinstance(found, Estimate)
    error = six(found.X_WP, X_WP)
    assert np.linalg.norm(error[3:]) < 3e-4
    assert np.linalg.norm(error[:3]) < np.deg2rad(0.3)


def _splatted(surface: Surface, X_CP: RigidTransform) -> np.ndarray:
    """Return the depth of the nearest of the surface's points in each pixel."""
    p_C = (X_CP @ surface.points.T).T
    facing = (p_C * (surface.normals @ X_CP.rotation().matrix().T)).sum(axis=1) < 0.0
    p_C = p_C[facing]
    column, row = WIDE.project(p_C).round().astype(int).T
    depth = np.full((WIDE.height, WIDE.width), np.inf)
    np.minimum.at(depth, (row, column), p_C[:, 2])
    return np.where(np.isfinite(depth), depth, 0.0)
