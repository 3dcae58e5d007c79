"""Saving and restoring a run: what follows is the same to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cell import Cell, Simulation
from cell.simulation.events import soften_jig
from cell.simulation.state import read_state, restore_state, save_state, write_state

STEPS = 50


def history(simulation: Simulation) -> np.ndarray:
    """Step on; return positions and velocities after every step, (STEPS, n)."""
    rows = []
    for _ in range(STEPS):
        simulation.step()
        plant, context = simulation.cell.plant, simulation.context
        rows.append(plant.GetPositionsAndVelocities(context).copy())
    return np.array(rows)


def under_way(cell: Cell, seed: int = 0) -> Simulation:
    """Return a run with motor and bolt awake, the jaws closing, the spindle turning, a soft bag."""
    simulation = Simulation(cell, seed)
    cell.parts.sleep_all_but(simulation.root, ["motor", "bolt_3"])
    cell.gripper.command(simulation.root, 0.03, 10.0)
    cell.driver.command(simulation.root, 20.0)
    soften_jig("motor")(simulation)
    for _ in range(20):
        simulation.step()
    return simulation


def test_continuing_is_bit_identical_in_the_same_and_in_a_new_simulation(
    motor_unit_cell: Cell, tmp_path: Path
) -> None:
    simulation = under_way(motor_unit_cell)
    write_state(tmp_path / "state.npz", save_state(simulation))
    expected = history(simulation)
    assert np.ptp(expected, axis=0).max() > 1e-3  # Something moves.
    state = read_state(tmp_path / "state.npz")
    restore_state(simulation, state)
    np.testing.assert_array_equal(history(simulation), expected)
    fresh = Simulation(motor_unit_cell)
    restore_state(fresh, state)
    assert fresh.time == pytest.approx(0.020)
    np.testing.assert_array_equal(history(fresh), expected)


def test_restored_state_saves_to_the_same_arrays(motor_unit_cell: Cell) -> None:
    state = save_state(under_way(motor_unit_cell, seed=5))
    fresh = Simulation(motor_unit_cell)
    restore_state(fresh, state)
    again = save_state(fresh)
    assert again.keys() == state.keys()
    for name, value in state.items():
        np.testing.assert_array_equal(again[name], value, err_msg=name)


def test_restoring_brings_back_sleep_and_drive_mode(motor_unit_cell: Cell) -> None:
    cell = motor_unit_cell
    simulation = Simulation(cell)
    cell.parts.sleep_all_but(simulation.root, ["plate"])
    cell.left.use_torque_drive()
    state = save_state(simulation)
    cell.left.use_position_drive()
    cell.parts.sleep_all_but(simulation.root, ["motor"])
    restore_state(simulation, state)
    assert cell.left.in_torque_drive()
    assert [part.part.name for part in cell.parts if not part.asleep] == ["plate"]
    cell.left.use_position_drive()


def test_noise_continues_where_it_was(make_noisy: Simulation) -> None:
    state = save_state(make_noisy)
    expected = [make_noisy.sense("motor").translation() for _ in range(3)]
    restore_state(make_noisy, state)
    again = [make_noisy.sense("motor").translation() for _ in range(3)]
    np.testing.assert_array_equal(again, expected)
    assert np.ptp(expected, axis=0).min() > 0.0


@pytest.fixture
def make_noisy(motor_unit_cell: Cell) -> Simulation:
    from dataclasses import replace

    simulation = Simulation(motor_unit_cell)
    simulation.sensor = replace(simulation.sensor, position_noise=1e-3)
    return simulation
