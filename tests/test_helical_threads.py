"""Threads with real flanks: which pairs turn apart, along which axis, and what still blocks."""

from __future__ import annotations

import numpy as np
import pytest
from cad_screws import hexagon, m8_bolt, m8_nut, plate_with, solid, thread
from manifold3d import CrossSection, Manifold
from tiny_products import box, product_of, rod

from planning import plan
from planning.feasibility.cache import load_matrices, save_matrices
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.evidence_format import evidence_from_dict, evidence_text, evidence_to_dict
from planning.feasibility.helical_threads import find_helical_thread
from planning.feasibility.matrices import matrices_of

TOLERANCE = 5e-5
SLANTED = (23.0, 41.0, 77.0)  # [deg] About x, y and z.


def found(a: Manifold, b: Manifold, tolerance: float = TOLERANCE, turn=SLANTED):
    """Look for a thread between two shapes, turned together."""
    shapes = [shape.rotate(list(turn)) for shape in (a, b)]
    return find_helical_thread(solid(shapes[0], "a"), solid(shapes[1], "b"), tolerance)


def turned_up() -> np.ndarray:
    """Return where +z points after the turn (3,)."""
    turned = Manifold.cube([1e-6, 1e-6, 1.0]).rotate(list(SLANTED)).bounding_box()
    return np.array([end if abs(end) > abs(start) else start for start, end in
                     zip(turned[:3], turned[3:], strict=True)])  # fmt: skip


def bottle() -> Manifold:
    """Neck with one and a half turns of a thread on it."""
    return thread(30, 28, 4, 0, 6, crest=0.2, root=0.4) + rod(28, -10, 10) - rod(24, -20, 20)


def lid() -> Manifold:
    ring = rod(33, 0.2, 6) - thread(30.6, 28.6, 4, -1, 7, crest=0.35, root=0.25)
    return rod(34, -1, 12) - rod(31.2, -2, 10.4) + ring


@pytest.mark.parametrize(
    ("bolt", "nut", "pitch", "starts", "diameter"),
    [
        (m8_bolt(), m8_nut(), 1.25, 1, 8),
        (m8_bolt(), m8_nut(clearance=0.0), 1.25, 1, 8),
        (m8_bolt(), m8_nut(clearance=-0.05), 1.25, 1, 8),
        (m8_bolt(facets=24), m8_nut(facets=24), 1.25, 1, 8),
        (m8_bolt(left=True), m8_nut(left=True), -1.25, 1, 8),
        (thread(8, 6.5, 2, -9, 24, starts=4),
         hexagon(14, 0, 15) - thread(8.3, 6.8, 2, -1, 16, starts=4), 2, 4, 8),
        (thread(8, 6.5, 2, -30, 40, crest=0.35, root=0.35),
         rod(16, 0, 15) - thread(8.3, 6.8, 2, -1, 16, crest=0.39, root=0.31), 2, 1, 8),
        (thread(20, 16.9, 2.5, -1, 20) + rod(30, 20, 25),
         hexagon(30, 0, 12) - thread(21.2, 18.1, 2.5, -1, 13), 2.5, 1, 20),
        (bottle(), lid(), 4, 1, 30),
    ],
    ids=["M8", "touching", "overlapping", "24 facets", "left", "4 starts", "lead screw", "printed",
         "bottle"],
)  # fmt: skip
def test_a_helix_is_recognised_by_its_motion(bolt, nut, pitch, starts, diameter):
    """In a slanted pose, whichever part comes first."""
    for swapped in (False, True):
        thread_found = found(nut, bolt) if swapped else found(bolt, nut)
        assert thread_found is not None
        assert (thread_found.bolt, thread_found.nut) == (("b", "a") if swapped else ("a", "b"))
        assert thread_found.pitch == pytest.approx(1e-3 * pitch, rel=5e-3)
        assert thread_found.starts == starts
        assert thread_found.diameter == pytest.approx(1e-3 * diameter, rel=0.01)
        up = abs(float(np.array(thread_found.axis) @ turned_up()))
        assert up == pytest.approx(1.0, abs=2e-6)  # Within 0.1 degrees.


def test_the_axis_points_to_the_side_on_which_the_bolt_leaves():
    thread_found = found(m8_bolt(), m8_nut(), turn=(0, 0, 0))
    assert thread_found is not None
    np.testing.assert_allclose(thread_found.axis, [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(thread_found.p_AoT, [0, 0, 3.25e-3], atol=2e-5)
    assert thread_found.length == pytest.approx(6.5e-3, rel=0.01)


def grooved(diameter: float, groove: float, width: float) -> Manifold:
    """Rod with rings of a pitch of 1.25 on it: grooves, no helix."""
    shape = rod(groove, -3, 20)
    for k in range(18):
        low = 1.25 * k - 3
        shape += rod(diameter, low, low + width, 48)
    return shape


def spring(radius: float, wire: float, low: float, high: float, pitch: float) -> Manifold:
    outline = CrossSection.circle(wire / 2, 12).translate([radius, 0])
    turns = (high - low) / pitch
    coil = Manifold.extrude(outline, high - low, round(32 * turns), 360 * turns)
    return coil.translate([0, 0, low])


def knurled() -> Manifold:
    shape = rod(8, -5, 20)
    for k in range(24):
        shape -= rod(0.8, -6, 21, 8).translate([4, 0, 0]).rotate([0, 0, 15 * k])
    return shape + rod(12, -8, -5) + rod(12, 20, 22)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (m8_bolt(), m8_nut(left=True)),
        (m8_bolt(), m8_nut(pitch=1.5)),
        (grooved(8, 6.6, 0.6),
         hexagon(13, 0, 6.5) - grooved(8.2, 6.9, 0.8).translate([0, 0, -0.1])),
        (knurled(), plate_with(rod(8.1, -1, 12))),
        (m8_bolt() + rod(13, -5, -3), plate_with(rod(8.4, -1, 12))),
        (rod(8, -3, 20) + rod(14, 20, 22) + rod(14, -5, -3), spring(5.6, 2.4, 0, 15, 3.0)),
        (m8_bolt() + rod(11, -5, -3), m8_nut()),
        (thread(8, 6.62, 1.25, -3, 19.8) + hexagon(13, 19.8, 25),
         rod(24, 0, 25, 32) - thread(8.2, 6.82, 1.25, -1, 19.5) - hexagon(13.2, 19.6, 30)),
        (thread(8, 6.62, 1.25, -3, 6.2) + rod(6.4, 6, 20) + hexagon(13, 20, 25),
         m8_nut() + (rod(12, 6.5, 8.5) - rod(6.7, 5, 9))),
    ],
    ids=["other hand", "other pitch", "rings", "knurled shaft", "clearance hole", "spring on a rod",
         "two heads", "hexagon in its pocket", "lip on the way out"],
)  # fmt: skip
def test_what_does_not_turn_out_is_no_thread(a, b):
    assert found(a, b) is None
    assert found(b, a, turn=(0, 0, 0)) is None


def worm_wheel() -> Manifold:
    """A rim with the worm's thread cut into one side of it."""
    wheel = rod(60, -3, 3, 64).rotate([90, 0, 0]).translate([33.5, 0, 0])
    return wheel - thread(8.2, 6.0, 1.25, -20, 20)


def test_a_worm_in_its_wheel_is_no_thread():
    """It could be turned out, but nothing holds it all around: it lifts off sideways."""
    assert found(thread(8, 5.8, 1.25, -12, 12), worm_wheel()) is None


def leaving(bolt: Manifold, nut: Manifold) -> list[str]:
    """Return the directions in which a bolt leaves its nut, by the matrices."""
    matrices = matrices_of(product_of({"nut": nut, "bolt": bolt}), TOLERANCE)
    assert [(t.bolt, t.nut) for t in matrices.threads] == [("bolt", "nut")]
    free = matrices.interference.free
    blocked = {(b.moving, b.staying, b.direction) for b in matrices.interference.blockers}
    for j in DIRECTIONS:
        assert (("bolt", "nut", j) in blocked) == (not free[j][1, 0])
    assert matrices.contact[0, 1] == 1
    return [j for j in DIRECTIONS if free[j][1, 0]]


def test_a_headed_bolt_leaves_its_nut_on_the_side_of_its_head():
    assert leaving(m8_bolt(), m8_nut()) == ["+z"]


def test_a_threaded_rod_leaves_its_nut_both_ways():
    assert leaving(thread(8, 6.62, 1.25, -5, 12), m8_nut()) == ["+z", "-z"]


def test_a_cap_on_the_far_side_holds_a_threaded_rod():
    nut = m8_nut() + hexagon(13, -4, -2) + (hexagon(13, -2, 0) - rod(9, -3, 1))
    assert leaving(thread(8, 6.62, 1.25, -1.5, 12), nut) == ["+z"]


def test_the_shank_of_a_stud_does_not_pass_its_nut():
    """As thick as the thread: the nut leaves over the thread only."""
    stud = thread(8, 6.62, 1.25, -5, 8) + rod(8, 8, 20) + thread(8, 6.62, 1.25, 20, 28)
    assert leaving(stud, m8_nut()) == ["+z"]


def test_a_blind_hole_holds_a_bolt_as_its_bottom_does():
    block = box((20, 20, 15), (-10, -10, -15)) - thread(6.2, 5.2, 1, -10.3, 3)
    assert leaving(thread(6, 5, 1, -8, 10) + rod(10, 10, 14, 6), block) == ["+z"]


def test_a_bolt_through_a_plate_is_planned_and_reported():
    shapes = {"bolt": m8_bolt(), "plate": plate_with(rod(8.6, -1, 20)).translate([0, 0, 10])}
    product = product_of(shapes | {"nut": m8_nut()})
    result = plan(product, ("bolt", "plate", "nut"), tolerance=TOLERANCE)
    assert result.feasible and result.evidence is not None
    (fastener,) = result.evidence.threads
    text = "Fastener: bolt in nut, diameter 7.97 mm, pitch 1.25 mm right-hand, 6.5 mm engaged"
    assert "free along its axis by turning" in evidence_text(result.evidence)
    assert text.split(",")[0] in evidence_text(result.evidence)
    assert "pitch 1.25 mm right-hand, 6.5 mm engaged" in evidence_text(result.evidence)
    again = evidence_from_dict(evidence_to_dict(result.evidence))
    assert again.threads == (fastener,)


def test_the_thread_is_read_back_from_the_cache(tmp_path):
    matrices = matrices_of(product_of({"bolt": m8_bolt(), "nut": m8_nut()}), TOLERANCE)
    save_matrices(matrices, tmp_path / "matrices.npz")
    again = load_matrices(tmp_path / "matrices.npz", matrices.solids)
    assert again is not None and again.threads == matrices.threads
