"""Contact matrix: touching faces, gaps, containment; and centres of gravity."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold
from tiny_products import box, peg_in_hole, product_of, rod, stack_of_three

from cell.errors import BadPart
from cell.products.product import Product
from planning.feasibility.contact import contact_matrix, gap_matrix, surface_gap
from planning.feasibility.solids import Solid, cog_height, combined_cog, solids_of

TOLERANCE = 5e-5


def contact(product: Product) -> np.ndarray:
    return contact_matrix(gap_matrix(list(solids_of(product).values()), 1e-4), TOLERANCE)


def two_blocks(gap: float) -> Product:
    """Two 20 mm cubes, the second above the first by a gap [mm]."""
    return product_of(
        {"low": box((20, 20, 20), (0, 0, 0)), "high": box((20, 20, 20), (3, 4, 20 + gap))}
    )


def test_matrix_is_strictly_upper_triangular():
    """So that C + C^T, which the paper multiplies with M_j, holds only 0 and 1."""
    matrix = contact(stack_of_three())
    np.testing.assert_array_equal(matrix, [[0, 1, 0], [0, 0, 1], [0, 0, 0]])


@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-4, 0.049])
def test_faces_within_the_tolerance_touch(gap):
    assert contact(two_blocks(gap))[0, 1] == 1


@pytest.mark.parametrize("gap", [0.051, 0.1, 5.0])
def test_faces_beyond_the_tolerance_do_not(gap):
    assert contact(two_blocks(gap))[0, 1] == 0


def test_gap_is_the_distance_of_the_surfaces():
    low, high = solids_of(two_blocks(5.0)).values()
    assert surface_gap(low, high) == pytest.approx(5e-3, abs=1e-12)  # Axis-aligned: rounding only.


def test_line_to_line_peg_touches_and_clearance_does_not():
    """In a hole wider than the peg only the bottom face touches; 5 mm higher nothing does."""
    assert contact(peg_in_hole())[0, 1] == 1
    assert contact(peg_in_hole(hole=12))[0, 1] == 1
    hanging = product_of({"ring": rod(30, 0, 10) - rod(12, -5, 15), "peg": rod(10, -5, 15)})
    assert contact(hanging)[0, 1] == 0


def test_a_part_inside_the_material_of_another_is_in_contact():
    """Their surfaces are 5 mm apart, so distance alone would miss it."""
    product = product_of(
        {"block": box((20, 20, 20), (0, 0, 0)), "seed": box((10, 10, 10), (5, 5, 5))}
    )
    assert contact(product)[0, 1] == 1


def test_a_part_loose_in_a_cavity_is_not():
    shell = box((20, 20, 20), (0, 0, 0)) - box((14, 14, 14), (3, 3, 3))
    assert contact(product_of({"shell": shell, "seed": box((4, 4, 4), (8, 8, 8))}))[0, 1] == 0


def test_combined_cog_weighs_by_mass():
    solids = solids_of(stack_of_three())
    np.testing.assert_allclose(
        combined_cog(solids, ["plate_0", "plate_1"]), [0, 0, 0.01], atol=1e-12
    )
    assert cog_height(solids, solids, "+z") == pytest.approx(0.015)
    assert cog_height(solids, ["plate_2"], "-z") == pytest.approx(0.005)


def test_a_surface_that_bounds_nothing_is_refused():
    sheet = Solid("sheet", np.eye(3), np.array([[0, 1, 2]]), 1.0, np.zeros(3))
    with pytest.raises(BadPart, match="'sheet'"):
        _ = sheet.manifold


def test_solid_survives_a_round_trip_through_the_boolean_library():
    solid = solids_of(peg_in_hole())["block"]
    far = Solid("far", solid.vertices + 1.0, solid.faces, 1.0, solid.p_AoG)
    volume = solid.without(far).manifold.volume()
    assert volume == pytest.approx(Manifold(solid.manifold.to_mesh64()).volume(), rel=1e-12)
