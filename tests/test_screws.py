"""The displacement of the jig from four screws in two pictures."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from cell.configuration.machines import CameraConfig
from cell.fixtures.jig_dimensions import SCREW_CIRCLE_RADIUS
from cell.machines.cameras.camera import FixedView
from experiments.paper.screws import metres_per_pixel, seen_displacement

X_WJ = RigidTransform([0.0, 0.15, 0.2])
# The error of a click is half a pixel, that of the mean of four is less; there are two pictures.
VIEW = FixedView.above(X_WJ, CameraConfig())
PIXEL = metres_per_pixel(VIEW, X_WJ)


def test_size_of_a_pixel_follows_from_the_focal_length() -> None:
    assert pytest.approx(0.5 / 424, rel=0.01) == PIXEL


@pytest.mark.parametrize("way", [0.01, 0.063, 0.0782])
def test_printed_formula_is_blind_to_translations(way: float) -> None:
    after = RigidTransform(X_WJ.translation() + [way, 0.0, 0.0])
    seen, printed = seen_displacement(VIEW, X_WJ, after)
    assert seen == pytest.approx(way, abs=PIXEL)
    assert printed < 2 * PIXEL


def test_printed_formula_responds_to_rotations() -> None:
    """Each of its two arms of length r turns by a chord of 2 r sin(angle / 2)."""
    angle = 0.8
    after = RigidTransform(RotationMatrix.MakeZRotation(angle), X_WJ.translation())
    seen, printed = seen_displacement(VIEW, X_WJ, after)
    assert seen < PIXEL
    chord = 2 * SCREW_CIRCLE_RADIUS * np.sin(angle / 2)
    assert printed == pytest.approx(np.sqrt(2) * chord, abs=2 * PIXEL)
