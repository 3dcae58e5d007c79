"""How deep a part goes into what guides it: laws on shapes whose depth is drawn."""

import numpy as np
import pytest
from drawn_products import covered_block
from manifold3d import Manifold

from cell.cad.shapes import box, cylinder
from experiments.product.drawings import box_with_lid
from planning.product_draft.engagement import PLAY, PRECISE, engagement

UP = np.array([0.0, 0.0, 1.0])


def test_a_flat_cover_is_not_guided() -> None:
    parts = covered_block()
    assert engagement(parts["cover"], parts["block"], UP) == 0.0


def test_a_lip_is_guided_over_its_height() -> None:
    parts = box_with_lid()
    found = engagement(parts["lid"], parts["box"], UP)
    assert found == pytest.approx(3.0, abs=PRECISE + 0.05)


@pytest.mark.parametrize("deep", [2.0, 7.0, 18.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_key_in_its_slot_whatever_the_direction(deep: float, axis: int) -> None:
    block = box((-20, -20, -30), (20, 20, 0)) - box((-21, -3.1, -deep), (21, 3.1, 1))
    key = box((-15, -3, -deep), (15, 3, 5))
    turn = [(0, 90, 0), (-90, 0, 0), (0, 0, 0)][axis]
    found = engagement(key.rotate(turn), block.rotate(turn), np.eye(3)[axis])
    assert found == pytest.approx(deep, abs=PRECISE + 0.05)


def test_a_wall_on_one_side_guides_nothing() -> None:
    block = box((-20, -20, -30), (20, 20, 0)) + box((-20, 10.1, -1), (20, 20, 15))
    assert engagement(box((-10, -10, 0), (10, 10, 5)), block, UP) == 0.0


def test_a_hole_that_is_wide_guides_nothing() -> None:
    block = box((-20, -20, -30), (20, 20, 0))
    for clearance, guided in ((0.5 * PLAY, True), (2.0 * PLAY, False)):
        hole = cylinder(8.0 + clearance, -10.0, 1.0)
        found = engagement(cylinder(8.0, -10.0, 5.0), block - hole, UP)
        assert (found > 9.0) is guided


def test_nothing_is_there() -> None:
    assert engagement(box((0, 0, 0), (1, 1, 1)), Manifold(), UP) == 0.0
