"""Freezing and thawing again and again, and loading a held part at random: nothing is gained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_jam_postures import POSTURES

from cell import load_product
from cell.fixtures.soft_jig import JigParameters
from experiments.jig.element_rig import ElementRig
from experiments.jig.specimens import Prism, ProductPart, Specimen

FAST_PUMP = replace(JigParameters().vacuum, time_constant=0.03)
PARAMS = replace(JigParameters(), vacuum=FAST_PUMP)


def held(part: Specimen) -> ElementRig:
    """Return a rig with a part that was pressed in with 20 N, frozen and let go."""
    rig = ElementRig(PARAMS, part, press_force=20.0)
    rig.lower_to(0.030, speed=0.08)
    rig.jam()
    rig.let_go(0.2)
    return rig


def cycle(rig: ElementRig) -> float:
    """Let air in, wait, and freeze again; return the largest speed of the part [m/s]."""
    rig.jig.soften(rig.root)
    fastest = 0.0
    for _ in range(300):
        rig.step()
        fastest = max(fastest, rig.speed)
    rig.jig.evacuate(rig.root)
    while not rig.jig.fixed(rig.root):
        rig.step()
    rig.step(100)
    return fastest


def test_ten_cycles_leave_a_part_where_it_was() -> None:
    """Less than 0.01 mm and 0.005 cm3 of bed in all."""
    rig = held(Prism())
    height, volume = rig.X_JP.translation()[2], rig.jig.memory(rig.root).bed.volume
    for _ in range(10):
        cycle(rig)
    assert rig.X_JP.translation()[2] == pytest.approx(height, abs=0.01e-3)
    assert rig.jig.memory(rig.root).bed.volume == pytest.approx(volume, abs=0.005e-6)


@pytest.mark.parametrize("posture", ["motor P1", "plate P2"])
def test_two_cycles_move_real_parts_by_microns(posture: str) -> None:
    """Lying, and standing with the weight beside the middle of the foot.

    They do not sink; each cycle slides them by up to 6 um, by the membrane's lateral springs.
    """
    name, up = POSTURES[posture]
    rig = held(ProductPart(load_product("motor_unit").parts[name], up))
    place = rig.X_JP.translation()
    for _ in range(2):
        cycle(rig)
    assert rig.X_JP.translation()[2] == pytest.approx(place[2], abs=5e-6)
    assert rig.X_JP.translation()[:2] == pytest.approx(place[:2], abs=20e-6)


def test_light_part_is_not_thrown_off() -> None:
    """5 g, let out of the vacuum that sucked it down."""
    rig = held(Prism(mass=0.005))
    height = rig.X_JP.translation()[2]
    assert cycle(rig) < 0.03
    assert rig.X_JP.translation()[2] == pytest.approx(height, abs=0.05e-3)


def test_energy_never_rises_beyond_the_work_put_in() -> None:
    """20 random loads of up to 6 N in any direction, at any height, each put on and taken off.

    What the part has, kinetic and by height, is no more than the work of the loads and the elastic
    energy of the contact at the start, well below 0.1 mJ.
    """
    rig, rng = held(Prism()), np.random.default_rng(1)
    mass = rig.body.default_mass()
    work, start = 0.0, rig.X_JP.translation()[2]
    for _ in range(20):
        p_PQ = np.array([0.0, 0.0, rng.uniform(0.0, 0.054)])
        direction = rng.normal(size=3)
        peak = rng.uniform(1.0, 6.0) * direction / np.linalg.norm(direction)
        for share in np.concatenate([np.linspace(0, 1, 20), np.linspace(1, 0, 20)]):
            before = rig.X_JP @ p_PQ
            rig.pull(p_PQ, share * peak)
            rig.step()
            work += float(share * peak @ (rig.X_JP @ p_PQ - before))
            center = rig.X_JP.translation()[2] - start
            gained = rig.plant.EvalKineticEnergy(rig.context) + mass * 9.81 * center
            assert gained < work + 1e-4
