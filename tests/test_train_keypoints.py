"""Training of nets for keypoints, as far as it goes without PyTorch: data, close-ups, refusals."""

import importlib.util
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from cell import load_product
from cell.errors import InputError
from cell.machines.cameras.pinhole import Pinhole, looking_at
from experiments import train_keypoints
from experiments.vision.bop import LabelledImage, box_centre, write_head, write_scene
from experiments.vision.labelled_views import LabelledViews, part_of, read_views
from experiments.vision.lighting import random_lighting, unseen_lighting
from experiments.vision.symmetry import same_after
from experiments.vision.training_images import batch
from planning.perception.keypoint_card import KeypointCard
from planning.perception.keypoint_net import centres
from planning.perception.surface import Surface
from planning.perception.voting import vote

PINHOLE = Pinhole.centred(212, 120, 106.0)
SCENES, PER_SCENE = 5, 2


@pytest.fixture(scope="module")
def mesh() -> trimesh.Trimesh:
    return load_product("motor_unit").parts["motor"].mesh


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory, mesh: trimesh.Trimesh) -> Path:
    """A dataset whose pictures show the motor's hull, white on black, and which says so."""
    root, rng = tmp_path_factory.mktemp("views"), np.random.default_rng(0)
    write_head(root, PINHOLE, {1: mesh})
    for scene in range(SCENES):
        images = []
        for _ in range(PER_SCENE):
            X_DC = looking_at([*rng.normal(scale=0.1, size=2), 0.25], [0.0, 0.0, 0.0])
            turn = RotationMatrix(Rotation.random(rng=rng).as_matrix())
            X_CP = X_DC.inverse() @ RigidTransform(turn, [0.0, 0.0, 0.0])
            mask = _hull(PINHOLE.project((X_CP @ mesh.vertices.T).T))
            color = np.where(mask, 255, 0).astype(np.uint8)[..., None].repeat(3, axis=2)
            depth = np.where(mask, 0.25, 0.0)
            images.append(LabelledImage(color, depth, X_DC.inverse(), X_CP, mask, mask))
        write_scene(root, scene, images, PINHOLE, 1, box_centre(mesh))
    scenes = {str(k): {"case": f"motor/P{1 + k % 2}"} for k in range(SCENES)}
    record = {"status": "complete", "made_from": {"part": "motor"}, "scenes": scenes}
    (root / "collection.json").write_text(json.dumps(record))
    return root


def _hull(pixels: np.ndarray) -> np.ndarray:
    """Return which pixels are within the convex hull of points."""
    import cv2

    image = np.zeros((PINHOLE.height, PINHOLE.width), np.uint8)
    cv2.fillConvexPoly(image, cv2.convexHull(pixels.round().astype(np.int32)), 1)
    return image > 0


@pytest.fixture(scope="module")
def read(dataset: Path, mesh: trimesh.Trimesh) -> LabelledViews:
    return read_views(dataset, mesh)


def test_views_are_read_as_they_were_written(read: LabelledViews, mesh: trimesh.Trimesh) -> None:
    assert [view.scene for view in read.views] == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert read.pinhole == PINHOLE
    assert read.about["pictures"] == SCENES * PER_SCENE
    assert read.about["placements"] == {"motor/P1": 3, "motor/P2": 2}
    for view in read.views:
        assert (_hull(PINHOLE.project((view.X_CP @ mesh.vertices.T).T)) == (view.visible > 0)).all()
        np.testing.assert_allclose((view.X_CD.inverse() @ view.X_CP).translation(), 0.0, atol=1e-6)


def test_part_and_placements_to_judge_by(dataset: Path, read: LabelledViews) -> None:
    assert part_of(dataset) == "motor"
    learned, kept = train_keypoints.split(read.views)
    assert [view.scene for view in learned] == [0, 0, 1, 1, 2, 2]
    assert [view.scene for view in kept] == [3, 3, 4, 4]  # One of each posture.
    with pytest.raises(InputError, match="motor/P2 has one placement only"):
        train_keypoints.split(read.views[:6])


def test_close_ups_say_where_keypoints_are(read: LabelledViews, mesh: trimesh.Trimesh) -> None:
    """What is learned, directions, leads back to the keypoints, however the close-up was taken."""
    card = KeypointCard.of_part("motor", mesh, 128, 4)
    again = [batch(read.views, PINHOLE, card, np.random.default_rng(4)) for _ in range(2)]
    drawn = again[0]
    assert all(np.array_equal(getattr(drawn, n), getattr(again[1], n)) for n in vars(drawn))
    assert drawn.images.shape == (10, 128, 128, 3) and drawn.directions.shape == (10, 18, 32, 32)
    other = batch(read.views, PINHOLE, card, np.random.default_rng(5))
    assert (other.images != drawn.images).mean() > 0.5
    p_PK = np.array(card.p_PK)
    for image, mask, directions, view in zip(
        drawn.images, drawn.masks, drawn.directions, read.views, strict=True
    ):
        row, column = np.nonzero(mask)
        assert 0.02 < mask.mean() < 0.5
        pixels = centres(np.column_stack([column, row]), card.stride)
        rays = directions[:, row, column].T.reshape(len(row), -1, 2).astype(float)
        np.testing.assert_allclose(np.linalg.norm(rays, axis=2), 1.0, atol=1e-5)
        found = vote(pixels, rays, np.random.default_rng(0))
        assert found is not None
        # Seen from where the camera stood, whichever way it looks: angles between keypoints.
        p_CK = (view.X_CP @ p_PK.T).T
        true = p_CK / np.linalg.norm(p_CK, axis=1, keepdims=True)
        spread = np.linalg.norm(found.pixels[1:] - found.pixels[0], axis=1)
        angles = np.arccos(np.clip(true[1:] @ true[0], -1.0, 1.0))
        long = angles > 0.5 * angles.max()
        focal_lengths = spread[long] / angles[long]
        assert np.ptp(focal_lengths) < 0.12 * np.median(focal_lengths)
        # The part is bright where the mask says so, whatever the light, but for what is before it.
        inside = image[::4, ::4].mean(axis=2)[mask > 0]
        assert np.median(inside) > np.median(image)


def test_turns_that_nothing_shows() -> None:
    parts = load_product("motor_unit").parts
    assert same_after(Surface.of(parts["motor"].mesh)) is None  # Its shaft is off the axis.
    assert same_after(Surface.of(parts["plate"].mesh)) is None
    wheel = trimesh.creation.annulus(0.01, 0.03, 0.01)
    assert same_after(Surface.of(wheel)) == (180.0, "x")
    for k in range(6):  # A tooth every 60 degrees, on one side.
        tooth = trimesh.creation.box([8e-3, 6e-3, 1e-2]).apply_translation([0.033, 0.0, 6e-3])
        turn = trimesh.transformations.rotation_matrix(np.deg2rad(60 * k), [0, 0, 1])
        wheel = trimesh.util.concatenate([wheel, tooth.apply_transform(turn)])
    assert isinstance(wheel, trimesh.Trimesh)
    assert same_after(Surface.of(wheel)) == (180.0, "z")


def test_light_that_is_unseen_is_not_among_what_is_collected() -> None:
    def heights(draw) -> np.ndarray:
        lightings = [draw(np.random.default_rng(k)) for k in range(50)]
        lamps = [lamp for one in lightings for lamp in one.lamps if lamp.frame == "world"]
        return np.array([-lamp.direction[2] for lamp in lamps])

    assert heights(unseen_lighting).max() < heights(random_lighting).min()


def _json(path: Path, **changes: object) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


@pytest.mark.parametrize(
    ("damage", "culprit"),
    [
        (lambda r: (r / "collection.json").unlink(), "collection.json' cannot be read"),
        (lambda r: _json(r / "collection.json", status="running"), "is not complete"),
        (lambda r: _json(r / "collection.json", made_from=[]), "is not what collect_views writes"),
        (lambda r: shutil.rmtree(r / "train"), "has no scenes"),
        (lambda r: (r / "train/000001/rgb/000001.png").unlink(), "000001.png' cannot be read"),
        (lambda r: (r / "train/000001/scene_gt.json").write_text("{"), "scene_gt.json' cannot"),
        (lambda r: _json(r / "models/models_info.json", **{"1": dict.fromkeys(
            ("size_x", "size_y", "size_z"), 30.0)}), "not the size of the mesh now"),
    ],
)  # fmt: skip
def test_datasets_that_cannot_be_used_are_refused(
    damage, culprit: str, dataset: Path, mesh: trimesh.Trimesh, tmp_path: Path
) -> None:
    root = tmp_path / "views"
    shutil.copytree(dataset, root)
    damage(root)
    with pytest.raises(InputError, match=culprit):
        part_of(root)
        read_views(root, mesh)


@pytest.mark.parametrize(
    ("option", "value"),
    [("--size", "100"), ("--minutes", "0"), ("--steps", "0"), ("--seed", "-1")],
)
def test_bad_options_are_refused(
    option: str, value: str, dataset: Path, capsys: pytest.CaptureFixture
) -> None:
    assert train_keypoints.main([str(dataset), option, value]) == 2
    assert option in capsys.readouterr().err


def test_missing_pytorch_is_named(
    dataset: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, tmp_path: Path
) -> None:
    there = importlib.util.find_spec
    monkeypatch.setattr(
        train_keypoints.importlib.util,
        "find_spec",
        lambda name: None if name in ("torch", "onnx") else there(name),
    )
    assert train_keypoints.main([str(dataset), "--out", str(tmp_path / "nets")]) == 2
    assert "torch and onnx" in capsys.readouterr().err
    assert not (tmp_path / "nets").exists()
