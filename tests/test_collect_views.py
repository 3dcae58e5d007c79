"""Collected pictures: the dataset is read back, labels are right, bad input and resuming."""

import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bop_reader import image, load, nearest_depth, read_ply, surface_points
from pydrake.math import RigidTransform
from scipy.ndimage import binary_dilation

from cell import CellConfig, load_product
from cell.machines.cameras.pinhole import Pinhole
from cell.machines.cameras.rendering import rendering_problem  # noqa: F401
from experiments import collect_views
from experiments.paper.postures import POSTURES
from experiments.paper.trial import planned_pose
from experiments.vision.bop import LabelledImage, box_centre, write_head, write_scene
from experiments.vision.collecting import LabelError, Scene, collect_scene
from experiments.vision.placing import Placed
from experiments.vision.studio import Studio

needs_rendering = pytest.mark.skipif("rendering_problem() is not None", reason="no rendering here")
SUNK = 0.018  # Of the part below the top of the bag [m].
COUNT = 3
NUMBER = 7  # Of the object.


@pytest.fixture(scope="module")
def collected(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Scene]:
    """A dataset of one scene: a motor that stands in the bag, not pressed in but put there."""
    root = tmp_path_factory.mktemp("bop")
    studio = Studio(CellConfig.load(), load_product("motor_unit"))
    part = studio.cell.product.parts["motor"]
    height = studio.cell.fixture.entry_height - SUNK
    X_JP = planned_pose(part, POSTURES["motor/P2"], RigidTransform(), height, yaw=0.02)
    X_JPlanned = planned_pose(part, POSTURES["motor/P2"], RigidTransform([1e-3, 0, 0]), height)
    placed = Placed(X_JP, X_JPlanned, studio.cell.fixture.save(studio.root), 20.0)
    scene = collect_scene(studio, "motor", placed, COUNT, np.random.default_rng(0))
    write_head(root, studio.camera.pinhole, {NUMBER: part.mesh})
    X_PO = box_centre(part.mesh)
    write_scene(root, 0, scene.images, studio.camera.pinhole, NUMBER, X_PO)
    return root, scene


def labels_of(root: Path):
    """Yield the number, the camera, the label and its info of each picture, as arrays."""
    folder = root / "train" / "000000"
    cameras, labels = load(folder / "scene_camera.json"), load(folder / "scene_gt.json")
    infos = load(folder / "scene_gt_info.json")
    assert set(cameras) == set(labels) == set(infos) == {str(k) for k in range(COUNT)}
    for k in range(COUNT):
        camera, (label,), (info,) = cameras[str(k)], labels[str(k)], infos[str(k)]
        K = np.array(camera["cam_K"]).reshape(3, 3)
        R, t = np.array(label["cam_R_m2c"]).reshape(3, 3), np.array(label["cam_t_m2c"])
        yield k, K, camera, R, t, label, info


def wider(mask: np.ndarray) -> np.ndarray:
    return np.asarray(binary_dilation(mask), bool)


@needs_rendering
def test_models_are_in_millimetres_about_their_box(collected) -> None:
    root, _ = collected
    vertices, _ = read_ply(root / "models" / f"obj_{NUMBER:06d}.ply")
    info = load(root / "models" / "models_info.json")[str(NUMBER)]
    lower, size = vertices.min(axis=0), np.ptp(vertices, axis=0)
    np.testing.assert_allclose([info[f"min_{a}"] for a in "xyz"], lower, atol=1e-3)
    np.testing.assert_allclose([info[f"size_{a}"] for a in "xyz"], size, atol=1e-3)
    np.testing.assert_allclose(lower, -size / 2, atol=1e-3)
    apart = np.linalg.norm(vertices[:, None] - vertices[None, ::3], axis=2).max()
    assert info["diameter"] == pytest.approx(apart, rel=2e-3)
    assert 70.0 < info["diameter"] < 100.0
    camera = load(root / "camera.json")
    assert (camera["width"], camera["height"], camera["fx"]) == (848, 480, 424.0)


@needs_rendering
def test_projected_models_cover_their_masks(collected) -> None:
    root, _ = collected
    folder = root / "train" / "000000"
    vertices, faces = read_ply(root / "models" / f"obj_{NUMBER:06d}.ply")
    points = surface_points(vertices, faces, 0.4)
    for k, K, _, R, t, label, info in labels_of(root):
        assert label["obj_id"] == NUMBER
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(R) == pytest.approx(1.0)
        assert 150.0 < t[2] < 500.0
        mask = image(folder / "mask" / f"{k:06d}_000000.png") > 0
        seen = image(folder / "mask_visib" / f"{k:06d}_000000.png") > 0
        covered = np.isfinite(nearest_depth(points, K, R, t, mask.shape))
        assert not (covered & ~wider(mask)).any()
        assert not (mask & ~wider(covered)).any()
        assert not (seen & ~mask).any() and seen.sum() > 0.3 * mask.sum()
        counts = [info[f"px_count_{n}"] for n in ("all", "visib")]
        assert counts == [mask.sum(), seen.sum()]
        assert info["visib_fract"] == pytest.approx(seen.sum() / mask.sum())
        for name, pixels in (("bbox_obj", mask), ("bbox_visib", seen)):
            rows, columns = np.nonzero(pixels)
            left, top, width, height = info[name]
            assert (left, top) == (columns.min(), rows.min())
            assert (left + width, top + height) == (columns.max(), rows.max())


@needs_rendering
def test_depth_is_that_of_the_model_at_its_pose(collected) -> None:
    root, _ = collected
    folder = root / "train" / "000000"
    points = surface_points(*read_ply(root / "models" / f"obj_{NUMBER:06d}.ply"), 0.4)
    for k, K, camera, R, t, _, info in labels_of(root):
        steps = image(folder / "depth" / f"{k:06d}.png")
        assert steps.dtype == np.uint16
        seen = image(folder / "mask_visib" / f"{k:06d}_000000.png") > 0
        mask = image(folder / "mask" / f"{k:06d}_000000.png") > 0
        assert info["px_count_valid"] == (mask & (steps > 0)).sum()
        measured, model = camera["depth_scale"] * steps, nearest_depth(points, K, R, t, steps.shape)
        both = seen & (steps > 0) & np.isfinite(model)
        difference = (measured - model)[both]
        assert both.sum() > 500
        # The noise of the depth is 0.3 to 0.6 mm here, its step 0.1 mm.
        assert abs(np.median(difference)) < 0.3
        assert 1.4826 * np.median(np.abs(difference)) < 0.8


@needs_rendering
def test_the_world_stands_still_and_markers_are_gone(collected) -> None:
    """The part has one pose on the board in all pictures of a scene."""
    root, scene = collected
    poses = []
    for k, _, camera, R, t, _, _ in labels_of(root):
        R_w2c = np.array(camera["cam_R_w2c"]).reshape(3, 3)
        poses.append(np.column_stack([R_w2c.T @ R, R_w2c.T @ (t - camera["cam_t_w2c"])]))
        rgb = image(root / "train" / "000000" / "rgb" / f"{k:06d}.png")
        assert rgb.shape == (480, 848, 3) and rgb.std() > 20.0
    np.testing.assert_allclose(poses, np.broadcast_to(poses[0], (COUNT, 3, 4)), atol=1e-6)
    assert all(error.left == 0 and error.painted_on_part == 0 for error in scene.errors)


@needs_rendering
def test_labels_are_near_the_truth(collected) -> None:
    _, scene = collected
    assert np.median([error.camera_mm for error in scene.errors]) < 0.6
    assert np.median([error.camera_deg for error in scene.errors]) < 0.08
    assert np.median([error.label_mm for error in scene.errors]) < 0.3
    assert min(error.mask_overlap for error in scene.errors) > 0.9


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["nut"], "No posture to place 'nut'.* motor/P1"),
        (["motor", "--views", "0"], "--views must be from 1 to 100000, not 0"),
        (["motor", "--views-per-scene", "0"], "--views-per-scene must be from 1 to"),
        (
            ["motor", "--set", "workcell.fixture=rigid_jig"],
            "'rigid_jig' is made for one posture",
        ),
    ],
)
def test_bad_options_are_refused(
    arguments: list[str], reason: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert collect_views.main([*arguments, "--out", str(tmp_path / "new")]) == 2
    assert re.search(reason, capsys.readouterr().err)
    assert not (tmp_path / "new").exists()


class Canned:
    """A collector that has its pictures ready, and may be interrupted."""

    fails_at: int | None = None
    made: list[int] = []

    def __init__(self, options, config, product, cases) -> None:
        self.options, self.product, self.cases = options, product, cases
        self.studio = SimpleNamespace(camera=SimpleNamespace(pinhole=Pinhole.centred(8, 6, 5.0)))

    def scene(self, number: int, count: int):
        if number == self.fails_at:
            raise KeyboardInterrupt
        self.made.append(number)
        rng = np.random.default_rng(number)
        X = RigidTransform([0.0, 0.0, 0.3])
        images = [
            LabelledImage(
                rng.integers(0, 255, (6, 8, 3)).astype(np.uint8),
                rng.uniform(0.2, 0.4, (6, 8)),
                X,
                X,
                np.ones((6, 8), bool),
                np.ones((6, 8), bool),
            )
            for _ in range(count)
        ]
        errors = [LabelError(0.1, 0.01, 0.1, 0.01, 1.0, 12, 0, 0) for _ in range(count)]
        case = self.cases[number % len(self.cases)]
        return case, SimpleNamespace(press_force=20.0), Scene(images, errors, 0, b"")


@pytest.fixture
def canned(monkeypatch: pytest.MonkeyPatch) -> type[Canned]:
    monkeypatch.setattr(collect_views, "_Collector", Canned)
    monkeypatch.setattr(collect_views, "rendering_problem", lambda: None)
    monkeypatch.setattr(Canned, "made", [])
    monkeypatch.setattr(Canned, "fails_at", None)
    return Canned


def collect(out: Path, views: int, *more: str) -> int:
    options = ["--views", str(views), "--views-per-scene", "2", "--out", str(out), "--quiet"]
    return collect_views.main(["motor", *options, *more])


def content(folder: Path) -> dict[str, bytes]:
    files = [file for file in folder.rglob("*") if file.is_file()]
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(files)}


def test_an_interrupted_collection_goes_on(canned, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(canned, "fails_at", 2)
    with pytest.raises(KeyboardInterrupt):
        collect(tmp_path / "stopped", 7)
    assert json.loads((tmp_path / "stopped" / "collection.json").read_text())["status"] == "running"
    # What a killed process leaves behind: a scene that is not recorded, and half of one.
    whole = tmp_path / "stopped" / "train"
    shutil.copytree(whole / "000001", whole / "000002")
    shutil.copytree(whole / "000001" / "rgb", whole / ".000003.part" / "rgb")
    monkeypatch.setattr(canned, "fails_at", None)
    assert collect(tmp_path / "stopped", 7) == 0
    assert canned.made == [0, 1, 2, 3]
    assert collect(tmp_path / "once", 7) == 0
    assert content(tmp_path / "stopped") == content(tmp_path / "once")
    record = json.loads((tmp_path / "once" / "collection.json").read_text())
    assert record["status"] == "complete" and record["summary"]["images"] == 7


def test_a_collection_grows(canned, tmp_path: Path) -> None:
    assert collect(tmp_path / "grown", 3) == 0 and collect(tmp_path / "grown", 6) == 0
    assert canned.made == [0, 1, 1, 2]  # The second scene had one picture only.
    assert collect(tmp_path / "once", 6) == 0
    assert content(tmp_path / "grown") == content(tmp_path / "once")


def test_other_datasets_are_left_alone(canned, tmp_path: Path, capsys) -> None:
    assert collect(tmp_path / "mine", 4) == 0
    before = content(tmp_path / "mine")
    assert collect(tmp_path / "mine", 4, "--seed", "1") == 2
    assert "another collection (seed 0, not 1)" in capsys.readouterr().err
    assert collect(tmp_path / "mine", 4, "--set", "camera.dropouts=0.1") == 2
    assert "another collection (config)" in capsys.readouterr().err
    assert collect(tmp_path / "mine", 2) == 2
    assert "holds 2 scenes, --views asks for 1" in capsys.readouterr().err
    assert content(tmp_path / "mine") == before
    (tmp_path / "foreign" / "train").mkdir(parents=True)
    assert collect(tmp_path / "foreign", 4) == 2
    assert "without collection.json" in capsys.readouterr().err


def test_without_rendering_one_line_says_so(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr(collect_views, "rendering_problem", lambda: "no libEGL")
    assert collect(tmp_path / "new", 4) == 1
    assert "pictures cannot be taken: no libEGL" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
@needs_rendering
def test_the_whole_command(tmp_path: Path) -> None:
    """Parts are pressed in by the rig, in one posture after the other."""
    options = ["--views", "6", "--views-per-scene", "3", "--out", str(tmp_path), "--quiet"]
    assert collect_views.main(["motor", *options]) == 0
    record = json.loads((tmp_path / "collection.json").read_text())
    assert [scene["case"] for scene in record["scenes"].values()] == ["motor/P1", "motor/P2"]
    assert record["summary"]["images"] == 6
    assert record["summary"]["label_mm_50"] < 0.5
    assert record["summary"]["painted_on_part"] == 0
    assert len(list((tmp_path / "train").glob("*/rgb/*.png"))) == 6
