"""Letting go of a part on the bed while it is soft: it comes to rest in its imprint."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from test_jam_postures import POSTURES, PRESS_FORCE

from cell import load_product
from cell.fixtures.soft_jig import JigState
from cell.fixtures.soft_jig.parameters import BagParameters, SoilParameters
from cell.fixtures.soft_jig.soft.bed import Bed
from cell.fixtures.soft_jig.soft.samples import SurfaceSamples
from cell.fixtures.soft_jig.soft.stable import Carried, largest_stiffness, normal_rows
from experiments.jig.element_rig import ElementRig
from experiments.jig.specimens import ProductPart


def released(posture: str, time_step: float):
    """Return the rig a second after a sudden release, and the part's speed per step [m/s]."""
    name, up = POSTURES[posture]
    specimen = ProductPart(load_product("motor_unit").parts[name], up)
    rig = ElementRig(part=specimen, press_force=PRESS_FORCE, time_step=time_step)
    rig.lower_to(0.025, speed=0.08)
    pressed, speeds = rig.depth, []
    rig.let_go(0)
    for _ in range(round(1.2 / time_step)):
        rig.step()
        speeds.append(rig.speed)
    return rig, pressed, np.array(speeds)


@pytest.mark.parametrize("posture", POSTURES)
def test_part_comes_to_rest_on_the_soft_bed(posture: str) -> None:
    """Let go at once after a press by 20 N; below 2 mm/s, carried, and most of the depth kept."""
    rig, pressed, speeds = released(posture, 1e-3)
    assert rig.jig.memory(rig.root).state is JigState.SOFT
    assert speeds[-100:].max() < 2e-3
    assert rig.depth > 0.75 * pressed
    weight = rig.body.default_mass() * 9.81
    assert rig.bed_force == pytest.approx(weight, rel=0.1)


@pytest.mark.parametrize("posture", POSTURES)
def test_how_deep_a_hand_presses_does_not_depend_on_the_step(posture: str) -> None:
    """On its own, a plate has a softer bed at 1 ms; in a hand it has that of the beads."""
    name, up = POSTURES[posture]
    specimen = ProductPart(load_product("motor_unit").parts[name], up)
    depths = []
    for time_step in (1e-3, 2.5e-4):
        rig = ElementRig(part=specimen, press_force=PRESS_FORCE, time_step=time_step)
        rig.lower_to(0.025, speed=0.08)
        depths.append(rig.depth)
    assert depths[0] == pytest.approx(depths[1], rel=0.02)


def test_half_the_step_comes_to_rest_as_well() -> None:
    rig, pressed, speeds = released("plate P2", 5e-4)
    assert speeds[-100:].max() < 2e-3
    assert rig.depth > 0.75 * pressed


def test_stiffness_is_bounded_by_step_and_inertia() -> None:
    """A flat square on a point mass: k A dt2 / m below one; half the step allows four times it."""
    side = np.linspace(-0.01, 0.01, 5)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    arms, areas = np.column_stack([x, y, np.zeros(25)]), np.full(25, 1e-5)
    inertia = np.diag([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])  # Too much to turn.
    bound = largest_stiffness(inertia, arms, areas, 1e-3)
    assert 0.5 < bound * areas.sum() * 1e-6 / 0.1 < 1.0
    assert largest_stiffness(inertia, arms, areas, 5e-4) == pytest.approx(4 * bound)


def test_block_that_swings_between_pads_comes_to_rest_under_traction() -> None:
    """Pressed in and sideways, free to turn about the pads: friction must not keep it swinging."""
    bed, dt, inertia = Bed(BagParameters(), SoilParameters()), 1e-3, 4e-5
    samples = SurfaceSamples.of("block", trimesh.creation.box((0.036, 0.044, 0.032)))
    spatial = np.diag([inertia] * 3 + [0.14] * 3)
    position, angle, rate, rates = np.array([0.0, 0.0, bed.bag.cap_height + 0.016]), 0.0, 0.0, []
    for k in range(700):
        velocity = np.array([0.01, 0.0, -0.02]) if k < 300 else np.zeros(3)
        R_JP = trimesh.transformations.rotation_matrix(angle, [0, 1, 0])[:3, :3]
        V_JP = np.array([0.0, rate, 0.0]), velocity
        _, torque = bed.press((R_JP, position), V_JP, samples, dt, spatial)
        bed.settle(dt)
        rate += dt * torque[1] / inertia
        angle, position = angle + dt * rate, position + dt * velocity
        rates.append(rate)
    assert 0.05 < angle < 0.4
    assert np.abs(rates[-100:]).max() < 1e-6  # [rad/s]


def test_predicted_velocity_is_backward_euler() -> None:
    """A free mass that the bed pushes up: m dv = dt (F - weight - c v)."""
    inertia, rows = np.diag([1e-3] * 3 + [0.1] * 3), normal_rows(np.zeros((1, 3)))
    V, F = np.zeros(6), np.array([0, 0, 0, 0, 0, 1.0])
    weight = 0.1 * 9.81
    after = np.array([0, 0, 0, 0, 0, (1.0 - weight) / 0.1 * 1e-3])
    carried = Carried(V, F, True)
    ahead = carried.ahead(inertia, rows, np.array([2.0]), np.array([30.0]), after, 1e-3)
    expected = (0.1 * after[5] + 1e-3 * (2.0 - weight)) / (0.1 + 1e-3 * 30.0)
    assert ahead[5] == pytest.approx(expected)
