"""Nets for keypoints: what OpenCV makes of one, and which are refused."""

import base64
import hashlib
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from cell.errors import InputError
from cell.machines.cameras.camera import Picture
from cell.machines.cameras.pinhole import Pinhole, looking_at
from planning.perception import opencv
from planning.perception.estimators import ByKeypoints
from planning.perception.keypoint_card import NETS, KeypointCard, fingerprint, net_file
from planning.perception.keypoint_net import KeypointNet, as_input

SIZE, STRIDE, COUNT = 32, 4, 5
# A net of one convolution: a cell is of the part where its first pixel is more red than green by
# half of the levels; all directions are (1, 0.5). Exported from PyTorch, compressed.
RED = """
eJzj4BBiL6gsyS9KzpBiM9IzNNEztFrGzNXMyMWamVdQWsLFVp6amZ5RwsWSlJlYLMRoLMWq75yfV6bEAiK1hLg4UzJzEksy
8/OKHRgdGBcwsmvxcLGmF+WXFkgAeUxaolw82alFeak58cUZiQWpMEWCXCwFiSnFDgwQCBIS4GIvLinKTEktdmBxYAGKCHHl
JmbmxacXJRZkaM1k5ODmYOZg5GAUYHSCOsqrhZGBocEeiPczDCDQsuDgBjoKHEJeOkCB/RBXMdgToqPkocEsJMYlwsEoJMDF
xMEIxMxArADCSdJcjMZoktxAzAHCTkwCggDQ1kBm
"""


@pytest.fixture
def mesh() -> trimesh.Trimesh:
    return trimesh.creation.box([0.06, 0.04, 0.02])


@pytest.fixture
def file(tmp_path: Path, mesh: trimesh.Trimesh) -> Path:
    """A net with its card."""
    net = tmp_path / "block.onnx"
    net.write_bytes(zlib.decompress(base64.b64decode(RED)))
    card = KeypointCard.of_part("block", mesh, SIZE, STRIDE)
    card = replace(card, p_PK=card.p_PK[:COUNT], net=hashlib.sha256(net.read_bytes()).hexdigest())
    net.with_suffix(".json").write_text(card.text())
    return net


def test_mask_and_directions_are_those_of_the_cells(file: Path, mesh: trimesh.Trimesh) -> None:
    net, image = KeypointNet.read(file, "block", mesh), np.zeros((SIZE, SIZE, 3), np.uint8)
    image[8:20, 12:16, 0] = 255
    image[0:4, 28:32, 0] = 255  # A smaller piece, elsewhere.
    image[8:12, 12:16, 1] = 200
    seen = net.see(image)
    np.testing.assert_array_equal(seen.pixels, [[13.5, 13.5], [13.5, 17.5]])
    np.testing.assert_allclose(seen.directions, np.broadcast_to([1.0, 0.5], (2, COUNT, 2)))
    assert len(net.see(np.zeros_like(image)).pixels) == 0


def test_levels_become_those_that_nets_are_trained_with() -> None:
    levels = as_input(np.array([0, 255], np.uint8).reshape(1, 1, 2, 1))
    assert levels.dtype == np.float32
    np.testing.assert_allclose(levels.ravel(), [-0.5, 0.5])


def test_a_card_is_read_back_as_it_was(file: Path, mesh: trimesh.Trimesh) -> None:
    card = KeypointCard.read(file.with_suffix(".json"))
    again = KeypointCard.of_part("block", mesh, SIZE, STRIDE)
    assert card == replace(again, p_PK=again.p_PK[:COUNT], net=card.net)
    np.testing.assert_allclose(card.p_PK[0], 0.0, atol=1e-9)
    corner = np.abs(card.p_PK[1])
    assert (corner > [0.025, 0.015, 0.005]).all()  # The first of the surface is near a corner.


def test_a_mesh_is_told_from_others(mesh: trimesh.Trimesh) -> None:
    other = mesh.copy()
    assert fingerprint(other) == fingerprint(mesh)
    other.vertices[0, 2] += 5e-6
    assert fingerprint(other) != fingerprint(mesh)


def test_a_net_for_another_part_is_refused(file: Path, mesh: trimesh.Trimesh) -> None:
    longer = mesh.copy().apply_scale([1.1, 1.0, 1.0])
    with pytest.raises(InputError, match="is for part 'block', not for 'rod'"):
        KeypointNet.read(file, "rod", longer)
    with pytest.raises(InputError, match="another mesh of 'block': train it anew"):
        KeypointNet.read(file, "block", longer)


def test_what_is_missing_or_damaged_is_named(file: Path, mesh: trimesh.Trimesh) -> None:
    with pytest.raises(InputError, match="There is no net '.*rod.onnx'"):
        KeypointNet.read(file.with_name("rod.onnx"), "rod", mesh)
    with pytest.raises(InputError, match=r"No net for part 'rod' .*\(there: block\)"):
        net_file("rod", file.parent)
    assert net_file("block", file.parent) == file
    content = file.read_bytes()
    file.write_bytes(content[:-40])
    with pytest.raises(InputError, match="is not that of its card 'block.json'"):
        KeypointNet.read(file, "block", mesh)
    card = KeypointCard.read(file.with_suffix(".json"))
    damaged = replace(card, net=hashlib.sha256(content[:-40]).hexdigest())
    file.with_suffix(".json").write_text(damaged.text())
    with pytest.raises(InputError, match="is no net that OpenCV reads"):
        KeypointNet.read(file, "block", mesh)
    file.with_suffix(".json").write_text('{"part": "block"}')
    with pytest.raises(InputError, match="is no card"):
        KeypointNet.read(file, "block", mesh)
    file.with_suffix(".json").unlink()
    with pytest.raises(InputError, match="block.json' does not exist"):
        KeypointNet.read(file, "block", mesh)


def test_missing_opencv_is_named(
    file: Path, mesh: trimesh.Trimesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opencv.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="pip install opencv-python-headless"):
        KeypointNet.read(file, "block", mesh)


def test_an_image_without_the_part_is_no_estimate(file: Path, mesh: trimesh.Trimesh) -> None:
    pinhole, X_WC = Pinhole.centred(64, 48, 60.0), looking_at([0.0, -0.2, 0.2], [0.0, 0.0, 0.0])
    net = KeypointNet.read(file, "block", mesh)
    for level in (0, 255):  # All black, all white: nothing is red.
        color = np.full((48, 64, 3), level, np.uint8)
        picture = Picture(0.0, X_WC, pinhole, np.zeros((48, 64)), color)
        assert ByKeypoints(net, np.zeros(3), np.random.default_rng(0)).find([picture], None) is None


@pytest.mark.parametrize("card", sorted(NETS.glob("*.json")), ids=lambda path: path.stem)
def test_nets_that_come_along_are_small_and_for_the_parts_as_they_are(card: Path) -> None:
    from cell import load_product

    mesh = load_product("motor_unit").parts[card.stem].mesh
    net = card.with_suffix(".onnx")
    assert net.stat().st_size < 5e6
    KeypointNet.read(net, card.stem, mesh)
    known = KeypointCard.read(card)
    assert known.training["steps_done"] == known.training["steps"]
    assert known.scores["looks"] == known.training["pictures_kept"]
