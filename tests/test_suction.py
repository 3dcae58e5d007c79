"""Suction: which cells seal, and how the seal pulls, opens and fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cell.fixtures.soft_jig.frozen.suction import Seal, sealed_squares
from cell.fixtures.soft_jig.parameters import JigParameters, SuctionParameters
from cell.fixtures.soft_jig.soft.bed import Bed
from cell.fixtures.soft_jig.soft.samples import SurfaceSamples
from experiments.jig.specimens import Prism

CELL, LIP = 1.5e-3, 3e-3
N = 41
AXIS = (np.arange(N) - N // 2).astype(float) * CELL
X, Y = np.meshgrid(AXIS, AXIS, indexing="ij")
LEVEL = np.zeros((N, N, 2))
DISC = np.hypot(X, Y) < 0.0175
PARAMS = SuctionParameters()


def test_flat_disc_seals_except_for_its_lip() -> None:
    """Sealed area pi (r - lip)^2 over pi r^2."""
    sealed, (patch,) = sealed_squares(np.zeros((N, N)), LEVEL, DISC, CELL, LIP)
    assert patch.seal == pytest.approx((1 - LIP / 0.0175) ** 2, rel=0.1)
    assert patch.area == pytest.approx(np.pi * 0.0175**2, rel=0.05)
    assert not sealed[~DISC].any()


def test_tilted_face_seals_like_a_level_one() -> None:
    level, _ = sealed_squares(np.zeros((N, N)), LEVEL, DISC, CELL, LIP)
    tilted, _ = sealed_squares(0.3 * X, LEVEL + [0.3, 0], DISC, CELL, LIP)
    assert tilted == pytest.approx(level)


def test_hole_vents_one_lip_width_around_it() -> None:
    """A hole of radius 6 mm vents itself and the lip."""
    hole = np.hypot(X, Y) < 0.006
    sealed, _ = sealed_squares(np.zeros((N, N)), LEVEL, DISC & ~hole, CELL, LIP)
    assert not sealed[np.hypot(X, Y) < 0.006 + LIP - 1.5 * CELL].any()
    assert sealed.any()


def test_terminals_of_the_motor_vent_its_end_face() -> None:
    """Two 6.3 mm terminals and a 3 mm boss leave less than a fifth of the face sealed."""
    heights = np.zeros((N, N))
    heights[np.hypot(X, Y) < 0.0039] = -0.003
    for side in (-1, 1):
        heights[np.hypot(X - side * 0.0092, Y + 0.00645) < 0.0016] = -0.0063
    _, patches = sealed_squares(heights, LEVEL, DISC, CELL, LIP)
    assert sum(patch.seal * patch.area for patch in patches) < 0.2 * np.pi * 0.0175**2


def seal() -> Seal:
    points = np.column_stack([X[DISC], Y[DISC], np.zeros(DISC.sum())])
    n = len(points)
    normals = np.tile([0.0, 0.0, 1.0], (n, 1))
    return Seal(points.copy(), points.copy(), normals, np.full(n, CELL**2), np.ones(n), [])


def at(x: float, z: float) -> tuple[np.ndarray, np.ndarray]:
    return np.eye(3), np.array([x, 0.0, z])


def test_closed_seal_pulls_with_strength_times_area() -> None:
    force, torque = seal().pull(at(0, 0), 4e3, PARAMS)
    assert force == pytest.approx([0, 0, -4e3 * DISC.sum() * CELL**2])
    assert torque == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize("where", [(0.0, PARAMS.reach), (1.01 * PARAMS.slip, 0.0)])
def test_seal_fails_at_its_reach_and_does_not_heal(where: tuple[float, float]) -> None:
    """Opened or slid this far it no longer pulls, not even after it has closed again."""
    opened = seal()
    assert not opened.pull(at(*where), 4e3, PARAMS)[0].any()
    assert not opened.pull(at(0, 0), 4e3, PARAMS)[0].any()


def test_half_opened_seal_pulls_half_as_much() -> None:
    whole = seal().pull(at(0, 0), 4e3, PARAMS)[0][2]
    assert seal().pull(at(0, PARAMS.reach / 2), 4e3, PARAMS)[0][2] == pytest.approx(whole / 2)


def test_restored_seal_pulls_bit_for_bit_the_same() -> None:
    first = seal()
    first.pull(at(0, 3e-4), 4e3, PARAMS)
    again = Seal.from_arrays(first.arrays())
    assert np.array_equal(
        first.pull(at(0, 1e-4), 4e3, PARAMS), again.pull(at(0, 1e-4), 4e3, PARAMS)
    )


def test_suction_is_proportional_to_the_vacuum_and_can_be_switched_off() -> None:
    assert PARAMS.pressure(45e3) == pytest.approx(PARAMS.strength / 2)
    assert SuctionParameters(enabled=False).pressure(90e3) == 0.0


def sucked_on(facets: int, cell: float, lying: bool) -> float:
    """Return the sealed area of a cylinder pressed 10 mm into a soft bed [m2]."""
    params, part = JigParameters(), Prism(facets=facets, lying=lying)
    bed = Bed(replace(params.bag, cell=cell), params.soil)
    R_JP = part.X_CP.rotation().matrix()
    samples = SurfaceSamples.of("part", part.mesh())
    for depth in np.linspace(0.0, 0.010, 251)[1:]:
        p_JP = part.X_CP.translation() + [0.0, 0.0, params.bag.cap_height - depth]
        motion = (np.zeros(3), np.array([0.0, 0.0, -0.04]))
        bed.press((R_JP, p_JP), motion, samples, 1e-3)
        bed.settle(1e-3)
    return float(Seal.under(bed, samples, (R_JP, p_JP), params.suction.lip).areas.sum())


@pytest.mark.parametrize("lying", [False, True])
def test_sealed_area_depends_neither_on_facets_nor_on_cells(lying: bool) -> None:
    """24, 36 and 72 facets, cells of 2, 1.5 and 1 mm: within 10 %."""
    areas = [sucked_on(facets, 1.5e-3, lying) for facets in (24, 36, 72)]
    areas += [sucked_on(36, cell, lying) for cell in (2e-3, 1e-3)]
    assert max(areas) < 1.1 * min(areas)
    if not lying:
        assert areas[0] == pytest.approx(np.pi * (0.0175 - LIP) ** 2, rel=0.1)
