"""The searches and clippings behind the matrices, against plain ways to the same answer."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from manifold3d import CrossSection
from test_matrices import random_solids

from planning.feasibility.clipping import Polygons, triangle_overlaps
from planning.feasibility.contact import near_gap, surface_gap
from planning.feasibility.envelope import cross
from planning.feasibility.face_pairs import DENSE, box_pairs

REACH = 3e-3  # [m] Of the same size as the gaps between the random shapes.


def rectangles(
    rng: np.random.Generator, count: int, low: float, high: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rectangles of very different sizes, some on a common grid so that edges coincide."""
    corner = rng.uniform(low, high, (count, 2))
    corner[::3] = np.round(corner[::3], 1)
    size = 10.0 ** rng.uniform(-3, -0.5, (count, 2))
    size[::3] = 0.1
    return corner, corner + size


@pytest.mark.parametrize("shift", [0.0, 0.9, 2.0])
def test_the_grid_finds_the_same_rectangles_as_comparing_all(shift):
    """Overlapping, meeting at an end, and apart."""
    rng = np.random.default_rng(0)
    (low_a, high_a), (low_b, high_b) = rectangles(rng, 800, 0, 1), rectangles(rng, 700, 0, 1)
    low_b, high_b = low_b + shift, high_b + shift
    assert len(low_a) * len(low_b) > DENSE
    meet = (low_a[:, None] < high_b) & (high_a[:, None] > low_b)
    expected = np.argwhere(meet.all(axis=2))
    found = np.column_stack(box_pairs(low_a, high_a, low_b, high_b))
    assert len(expected) > 0 or shift > 1.0
    np.testing.assert_array_equal(found[np.lexsort(found.T[::-1])], expected)


def random_triangles(rng: np.random.Generator, count: int) -> np.ndarray:
    """Counter-clockwise; corners on a coarse grid, so that many share corners and edges."""
    corners = rng.integers(0, 5, (3 * count, 3, 2)).astype(float)
    turns = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corners[turns < 0] = corners[turns < 0][:, ::-1]
    return corners[turns != 0][:count]


def test_overlaps_of_triangles_have_the_area_that_clipper_gives():
    rng = np.random.default_rng(1)
    a, b = random_triangles(rng, 300), random_triangles(rng, 300)
    expected = [(CrossSection([s]) ^ CrossSection([t])).area() for s, t in zip(a, b, strict=True)]
    assert sum(area == 0.0 for area in expected) > 20
    np.testing.assert_allclose(triangle_overlaps(a, b).areas(), expected, atol=1e-6)


def test_discs_lie_in_their_polygons():
    rng = np.random.default_rng(2)
    polygons = triangle_overlaps(random_triangles(rng, 300), random_triangles(rng, 300))
    centres, radii = polygons.discs()
    assert np.array_equal(radii > 0.0, polygons.areas() > 1e-12)
    filled = polygons.chosen(radii > 0.0).outlines(1.0)
    discs = zip(filled, centres[radii > 0.0], radii[radii > 0.0], strict=True)
    for outline, centre, radius in discs:
        edges = np.roll(outline, -1, axis=0) - outline
        lengths = np.hypot(*edges.T)
        away = cross(edges, centre - outline)[lengths > 0] / lengths[lengths > 0]
        assert away.min() >= radius - 1e-12


def test_a_disc_in_a_strip_is_half_as_wide():
    strip = Polygons(np.array([[[0.0, 0], [10, 0], [10, 1], [0, 1]]]), np.array([4]))
    centres, radii = strip.discs()
    np.testing.assert_allclose(centres, [[5.0, 0.5]])
    np.testing.assert_allclose(radii, [0.5])


def test_distances_within_reach_are_those_of_whole_surfaces():
    near, far = 0, 0
    for seed in range(6):
        solids = random_solids(seed, 8)
        for a, b in combinations(solids, 2):
            exact, found = surface_gap(a, b), near_gap(a, b, REACH)
            assert found == pytest.approx(exact if exact <= REACH else np.inf, abs=1e-9)
            near, far = near + (0.0 < exact <= REACH), far + (exact > REACH)
    assert near > 10 and far > 10
