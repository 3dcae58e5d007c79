"""Pins in the frozen bed: which surface counts, and how it pushes, yields and comes free."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from cell.fixtures.soft_jig import JigParameters, SurfaceSamples
from cell.fixtures.soft_jig.frozen.pins import Pins
from cell.fixtures.soft_jig.frozen.yielding import Strength
from cell.fixtures.soft_jig.mesh.contact_mesh import bed_mesh, imprint_mesh
from cell.fixtures.soft_jig.parameters import SoilParameters
from cell.fixtures.soft_jig.soft.bed import Bed

WIDTH, LENGTH = 0.002, 0.020
MODULUS = 4e8
STRENGTH = Strength(90e3, SoilParameters().friction_angle)
STAYS = np.eye(3)
HEAVY = np.diag([1.0, 1.0, 1.0, 10.0, 10.0, 10.0])
PARAMS = JigParameters()
APEX = PARAMS.bag.cap_height


def pin(samples: SurfaceSamples | None = None, inertia: np.ndarray = HEAVY) -> Pins:
    """Return a square pin embedded by half its length in the middle of the bare dome."""
    box = trimesh.creation.box((WIDTH, WIDTH, LENGTH))
    samples = samples or SurfaceSamples.of("pin", box, spacing=0.0005)
    mesh = bed_mesh(Bed(PARAMS.bag, PARAMS.soil), PARAMS.jammed)
    return Pins.inside(mesh, samples, at(), MODULUS, inertia, 1e-3)


def at(x: float = 0.0, z: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    return STAYS, np.array([x, 0.0, APEX + z])


def test_only_embedded_surface_counts() -> None:
    """Four sides over half the length, and the tip."""
    expected = 4 * WIDTH * LENGTH / 2 + WIDTH**2
    found = pin()
    assert found.areas.sum() == pytest.approx(expected, rel=0.1)
    assert found.p_JS[:, 2].max() < APEX


def test_surface_that_rests_on_the_mesh_does_not_count() -> None:
    """The underside of a plate on the apex of the dome is carried by the mesh."""
    plate = trimesh.creation.box((0.01, 0.01, 0.005))
    plate.apply_translation([0, 0, 0.0025 - 0.2e-3])
    assert np.all(pin(SurfaceSamples.of("plate", plate)).normals[:, 2] == 0)


def test_small_displacement_is_elastic() -> None:
    """Force is modulus times depth times projected area, acting at half the depth of the pin."""
    depth = 0.1e-3
    force, torque = pin().push(at(depth), STRENGTH)
    area = WIDTH * LENGTH / 2
    assert force == pytest.approx([-MODULUS * depth * area, 0, 0], rel=0.1, abs=1e-3)
    assert torque[1] == pytest.approx(-force[0] * LENGTH / 4, rel=0.15)


def test_large_displacement_reaches_the_strength_of_the_beads() -> None:
    """2 c sqrt(Kp) on the side, c Nc under the tip."""
    force, _ = pin().push(at(2e-3), STRENGTH)
    assert force[0] == pytest.approx(-STRENGTH.lateral * WIDTH * LENGTH / 2, rel=0.1)
    force, _ = pin().push(at(z=-2e-3), STRENGTH)
    assert force[2] == pytest.approx(STRENGTH.bearing * WIDTH**2, rel=0.1)


def test_yield_leaves_a_gap() -> None:
    """After 2 mm of displacement the pin is free until it is back where the beads yielded to."""
    pushed = pin()
    pushed.push(at(2e-3), STRENGTH)
    given = 2e-3 - STRENGTH.lateral / MODULUS
    assert pushed.push(at(given - 1e-5), STRENGTH)[0] == pytest.approx(np.zeros(3), abs=1e-9)
    assert pushed.push(at(given + 1e-5), STRENGTH)[0][0] < -0.01


def test_pin_is_pulled_out_without_resistance() -> None:
    """Beads under vacuum do not stick to it."""
    force, torque = pin().push(at(z=3e-3), STRENGTH)
    assert force == pytest.approx(np.zeros(3), abs=1e-9)
    assert torque == pytest.approx(np.zeros(3), abs=1e-9)


def test_pin_that_has_left_the_beads_is_free_of_contact() -> None:
    """Pulled out by its 10 mm and moved aside; half pulled out, half of it still resists."""
    force, _ = pin().push(at(5e-3, 11e-3), STRENGTH)
    assert force == pytest.approx(np.zeros(3), abs=1e-12)
    whole, half = (pin().push(at(0.1e-3, z), STRENGTH)[0][0] for z in (0.0, 5e-3))
    assert half == pytest.approx(whole / 2, rel=0.2)


def test_light_part_gets_softer_springs() -> None:
    """On 1 g an explicit step of 1 ms is unstable at the stiffness of the beads."""
    light = pin(inertia=np.diag([1e-8, 1e-8, 1e-8, 1e-3, 1e-3, 1e-3]))
    assert light.modulus < MODULUS / 10
    assert pin().modulus == MODULUS


def test_restored_pins_continue_bit_for_bit() -> None:
    """After they have yielded."""
    pushed = pin()
    pushed.push(at(1e-3), STRENGTH)
    again = Pins.from_arrays(pushed.arrays())
    pushed.push(at(0.9e-3), STRENGTH)
    forces = [pins.push(at(0.9e-3), STRENGTH)[0] for pins in (pushed, again)]
    assert np.array_equal(forces[0], forces[1])


def test_crack_beside_a_faceted_hull_contains_no_bead() -> None:
    """A round punch protrudes from its 24-sided hull by 0.15 mm: that is not a pin."""
    radius, sides = 0.0175, 24
    punch = trimesh.creation.cylinder(radius=radius, height=0.05, sections=240)
    punch.apply_translation([0, 0, 0.025])
    angle = np.arange(sides) * 2 * np.pi / sides
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    hull = np.concatenate([np.column_stack([ring, np.full(sides, z)]) for z in (0.0, 0.05)])
    bed, samples = Bed(PARAMS.bag, PARAMS.soil), SurfaceSamples.of("punch", punch, 0.4e-3)
    for k in range(1, 1001):
        p_JP = np.array([0.0, 0.0, APEX - k * 1e-5])
        bed.press((STAYS, p_JP), (np.zeros(3), np.array([0, 0, -0.01])), samples, 1e-3)
        bed.settle(1e-3)
    bed.jam(0.0)
    mesh = imprint_mesh(bed, PARAMS.jammed, [hull + p_JP])
    assert len(Pins.inside(mesh, samples, (STAYS, p_JP), MODULUS, HEAVY, 1e-3).areas) == 0
