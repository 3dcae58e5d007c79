"""Broad phase of the interference: no pair that matters is lost, and few others are kept."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold, OpType
from tiny_products import box, product_of, rod

from planning.feasibility import blocking, coarse
from planning.feasibility.cells import crossing_pairs, touching
from planning.feasibility.envelope import Envelope, Faces, envelope
from planning.feasibility.face_pairs import blocked_regions, overlapping_faces, paired
from planning.feasibility.interference import interference
from planning.feasibility.solids import solids_of

HEIGHT = 5e-5  # [m]


def views_of(**shapes: Manifold) -> list[Envelope]:
    return [envelope(solid, 2) for solid in solids_of(product_of(shapes)).values()]


def kept(down: Faces, up: Faces) -> set[tuple[int, int]]:
    every = (np.arange(len(down.low)), np.arange(len(up.low)))
    d, u = crossing_pairs(down, up, *every, HEIGHT)
    assert len(d) == len(set(zip(d.tolist(), u.tolist(), strict=True)))  # Each pair once.
    return set(zip(d.tolist(), u.tolist(), strict=True))


@pytest.mark.parametrize("seed", range(3))
def test_every_pair_that_crosses_is_kept(seed):
    """Compared with clipping all pairs, on balls and a ring that lie through each other."""
    rng = np.random.default_rng(seed)
    ring = rod(30.0, 0.0, 6.0, 90) - rod(20.0, 0.0, 6.0, 80)
    ball = Manifold.sphere(12.0, 40).rotate(rng.uniform(0, 90, 3).tolist())
    a, b = views_of(ring=ring, ball=ball.translate(rng.uniform(-5, 5, 3).tolist()))
    for moving, staying in ((a, b), (b, a)):
        down, up = moving.down, staying.up
        d, u = (grid.ravel() for grid in np.indices((len(down.low), len(up.low))))
        areas = blocked_regions([paired(down, up, d, u)], HEIGHT).areas()
        crossing = areas > 1e-12
        assert crossing.any()
        needed = set(zip(d[crossing].tolist(), u[crossing].tolist(), strict=True))
        assert needed <= kept(down, up)


def test_long_thin_faces_do_not_pair_with_what_only_their_boxes_cover():
    """Slats along a diagonal, and a ball beside them."""
    slats = [box((80.0, 0.2, 1.0), (-40.0, 0.4 * k, 0.0)) for k in range(40)]
    frame = Manifold.batch_boolean(slats, OpType.Add).rotate([0, 0, 45])
    below, ball = views_of(slats=frame, ball=Manifold.sphere(4.5, 100).translate([15, -5, 4]))
    assert len(overlapping_faces(below.down, ball.up)) > 100_000
    assert not kept(below.down, ball.up)


def test_a_face_touches_the_rectangles_that_its_points_lie_in():
    (view,) = views_of(slab=box((10.0, 1.0, 1.0), (0.0, 0.0, 0.0)).rotate([0, 0, 40]))
    faces, rng = view.up, np.random.default_rng(0)
    low = rng.uniform(-2e-3, 10e-3, (400, 2))
    high = low + rng.uniform(1e-4, 1e-3, (400, 2))
    weights = rng.dirichlet(np.ones(3), 20_000)
    for face in range(len(faces.low)):
        points = weights @ faces.corners[face]
        holds = [
            bool(((points >= a) & (points <= b)).all(axis=1).any())
            for a, b in zip(low, high, strict=True)
        ]
        found = touching(faces, np.full(400, face), low, high)
        assert found[holds].all() and found.sum() <= 1.3 * sum(holds)


def test_fine_parts_that_block_each_other_are_settled_over_a_probe(monkeypatch):
    """A thread of facets too small to block on their own: their faces are not all compared."""
    outline = Manifold.cylinder(6.0, 4.0, 4.0, 160)
    grooves = [rod(9.0, 0.3 + 0.8 * k, 0.7 + 0.8 * k, 150) - rod(7.0, 0, 6, 140) for k in range(7)]
    screw = outline
    for groove in grooves:
        screw -= groove
    screw = screw.refine(3)
    plate = box((12.0, 12.0, 6.0), (-6.0, -6.0, 0.0)).refine(30) - screw
    monkeypatch.setattr(coarse, "MANY", 10**9)  # Nothing is simplified.
    monkeypatch.setattr(blocking, "crossing_faces", lambda *_: pytest.fail("all were compared"))
    leaving = interference(list(solids_of(product_of({"screw": screw, "plate": plate})).values()))
    assert all(matrix.sum() == 0 for matrix in leaving.free.values())
