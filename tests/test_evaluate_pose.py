"""Accuracy of estimated poses: the script, run short, and the measures of an error."""

import json
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from trimesh.creation import box, cylinder

from cell.machines.cameras.pinhole import Pinhole, looking_at
from cell.machines.cameras.rendering import rendering_problem  # noqa: F401
from experiments.evaluate_pose import main
from experiments.vision.pose_error import ADD_SHARE, pose_error
from experiments.vision.pose_scores import pose_scores
from planning.perception.surface import Surface

needs_rendering = pytest.mark.skipif("rendering_problem() is not None", reason="no rendering here")


def test_errors_of_a_known_offset() -> None:
    surface = Surface.of(box((0.06, 0.04, 0.02)))
    X_WTrue = RigidTransform(RollPitchYaw(0.0, 0.0, 0.3), [0.1, 0.2, 0.3])
    X_WP = RigidTransform(RollPitchYaw(0.0, 0.0, 0.32), [0.1, 0.2, 0.302])
    X_WC = looking_at([0.1, -0.1, 0.6], [0.1, 0.2, 0.3])
    pinhole = Pinhole.centred(848, 480, 424.0)
    error = pose_error(surface, X_WP, X_WTrue, np.eye(6) * 1e-6, pinhole, X_WC)
    assert error.translation == pytest.approx(2e-3)
    assert error.yaw_deg == pytest.approx(np.rad2deg(0.02))
    assert error.tilt_deg == pytest.approx(0.0, abs=1e-9)
    assert not error.small
    # Points are off by the lift and by the turn about the middle: 2 mm, and 0.02 rad of some 20 mm.
    assert 2e-3 < error.add_share * np.linalg.norm([0.06, 0.04, 0.02]) < 2.2e-3
    assert error.normalised == pytest.approx((0.02**2 + 2e-3**2) / 1e-6)


@needs_rendering
def test_a_placed_part_is_found(tmp_path: Path) -> None:
    options = ["--case", "motor/P2", "--trials", "1", "--looks", "2", "--out", str(tmp_path)]
    assert main([*options, "--quiet"]) == 0
    row = json.loads((tmp_path / "poses.json").read_text())["cases"]["motor/P2"]["depth"]
    assert row["found"] == row["looks"] == 2
    assert row["within_1_mm_1_deg"] == 1.0
    assert (tmp_path / "motor_P2_depth.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("options", "culprit"),
    [
        (["--views", "0"], "--views"),
        (["--estimator", "depth", "colour"], "No estimator 'colour'"),
        (["--lighting", "dark"], "No lighting 'dark'"),
        (
            ["--case", "motor", "--estimator", "both", "--nets", "nowhere"],
            "No net for part 'motor'",
        ),
    ],
)
def test_bad_options_are_refused(
    options: list[str], culprit: str, capsys: pytest.CaptureFixture
) -> None:
    assert main(options) == 2
    assert culprit in capsys.readouterr().err


def test_scores_count_what_was_not_found() -> None:
    surface, pinhole = Surface.of(box((0.06, 0.04, 0.02))), Pinhole.centred(848, 480, 424.0)
    X_WC = looking_at([0.0, -0.2, 0.3], [0.0, 0.0, 0.0])
    here, true = RigidTransform([1e-3, 0.0, 0.0]), RigidTransform()
    near = pose_error(surface, here, true, np.eye(6) * 1e-6, pinhole, X_WC)
    scores = pose_scores([near, None])
    assert (scores["looks"], scores["found"], scores["add"]) == (2, 1, 0.5)
    assert scores["translation_50"] == pytest.approx(1.0)
    assert scores["normalised_error"] == pytest.approx(1.0 / 5.348, rel=1e-3)
    assert pose_scores([None])["translation_50"] is None


def test_a_turn_that_a_round_part_does_not_show_counts_in_one_measure_only() -> None:
    surface, pinhole = Surface.of(cylinder(0.018, 0.08)), Pinhole.centred(848, 480, 424.0)
    turned = RigidTransform(RollPitchYaw(0.0, 0.0, 1.0), np.zeros(3))
    X_WC = looking_at([0.0, -0.2, 0.3], [0.0, 0.0, 0.0])
    error = pose_error(surface, turned, RigidTransform(), np.eye(6), pinhole, X_WC)
    assert error.add_share > ADD_SHARE > 10.0 * error.adds_share
