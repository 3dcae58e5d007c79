"""Saving and restoring a run: what follows is the same to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cell import Cell, Simulation
from cell.simulation.events import receive_part
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


def under_way(cell: Cell) -> Simulation:
    """Return a run with motor and bolt awake, the jaws closing, the spindle turning, a soft bag."""
    simulation = Simulation(cell)
    cell.parts.sleep_all_but(simulation.root, ["motor", "bolt_3"])
    cell.holder.tool.command(simulation.root, 0.03, 10.0)
    cell.driver.tool.command(simulation.root, 20.0)
    receive_part("motor")(simulation)
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
    state = save_state(under_way(motor_unit_cell))
    fresh = Simulation(motor_unit_cell)
    restore_state(fresh, state)
    again = save_state(fresh)
    assert again.keys() == state.keys()
    for name, value in state.items():
        np.testing.assert_array_equal(again[name], value, err_msg=name)


def test_restoring_brings_back_sleep_and_drive_mode(motor_unit_cell: Cell) -> None:
    cell = motor_unit_cell
    simulation = Simulation(cell)
    root, drive = simulation.root, cell.holder.drive
    cell.parts.sleep_all_but(root, ["plate"])
    drive.use_torque(root, True)
    state = save_state(simulation)
    drive.use_torque(root, False)
    cell.parts.sleep_all_but(root, ["motor"])
    restore_state(simulation, state)
    assert drive.uses_torque(root)
    assert [part.part.name for part in cell.parts if not part.asleep(root)] == ["plate"]
