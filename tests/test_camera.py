"""What four screws in two pictures tell about a jig that moved."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from cell.fixtures.jig_dimensions import SCREW_CIRCLE_RADIUS
from experiments.paper.camera import Camera, metres_per_pixel, seen_displacement

X_WJ = RigidTransform([0.0, 0.15, 0.2])
# A click is off by half a pixel; the mean of four by less, and there are two pictures.
PIXEL = metres_per_pixel(Camera.above(X_WJ), X_WJ)


def test_one_pixel_is_what_the_focal_length_says() -> None:
    assert pytest.approx(0.5 / 615, rel=0.01) == PIXEL


@pytest.mark.parametrize("way", [0.01, 0.063, 0.0782])
def test_translation_is_seen_but_not_by_the_printed_formula(way: float) -> None:
    after = RigidTransform(X_WJ.translation() + [way, 0.0, 0.0])
    seen, printed = seen_displacement(X_WJ, after)
    assert seen == pytest.approx(way, abs=PIXEL)
    assert printed < 2 * PIXEL


def test_printed_formula_sees_the_rotation() -> None:
    """Each of its two arms of length r turns by a chord of 2 r sin(angle / 2)."""
    angle = 0.8
    after = RigidTransform(RotationMatrix.MakeZRotation(angle), X_WJ.translation())
    seen, printed = seen_displacement(X_WJ, after)
    assert seen < PIXEL
    chord = 2 * SCREW_CIRCLE_RADIUS * np.sin(angle / 2)
    assert printed == pytest.approx(np.sqrt(2) * chord, abs=2 * PIXEL)
