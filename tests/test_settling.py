"""Parts lie at rest in their tray when a run begins, for coarse steps, too."""

import numpy as np
import pytest

from cell import CellConfig, load_product
from cell.simulation.settling import settle
from cell.simulation.simulation import Simulation
from cell.simulation.state import save_state
from experiments.assembly.prepare import RunningCell
from planning.operations.place_bolts import PLACE_BOLTS

PRODUCTS = ("motor_unit", "idler")


def moved_in_50_ms(simulation: Simulation, part: str) -> float:
    """Return the largest distance [m] of a part from where it was, alone awake for 50 ms."""
    cell, context = simulation.cell, simulation.context
    cell.parts.sleep_all_but(simulation.root, [part])
    before, largest = cell.parts[part].X_WP(context).translation(), 0.0
    for _ in range(round(0.05 / simulation.time_step)):
        simulation.step()
        now = cell.parts[part].X_WP(context).translation()
        largest = max(largest, float(np.linalg.norm(now - before)))
    return largest


@pytest.mark.parametrize("name", PRODUCTS)
def test_parts_rest_at_coarse_steps(name: str) -> None:
    running = RunningCell(load_product(name), CellConfig(), seed=0)
    running.go_on(PLACE_BOLTS)
    assert running.coarse
    for part in running.simulation.cell.parts:
        # Ten times the depth of the contact that bears a bolt.
        assert moved_in_50_ms(running.simulation, part.part.name) < 1e-7


def test_nothing_but_the_parts_is_changed_and_not_by_much() -> None:
    simulation = RunningCell(load_product("idler"), CellConfig(), seed=0).simulation
    before = save_state(simulation)
    settle(simulation)
    after = save_state(simulation)
    changed = {name for name in before if not np.array_equal(before[name], after[name])}
    assert changed <= {"q", "of/arrays"}
    np.testing.assert_allclose(after["q"], before["q"], atol=1e-8)
    plant, context = simulation.cell.plant, simulation.context
    for arm in simulation.cell.arms.values():
        np.testing.assert_array_equal(plant.GetPositions(context, arm.instance), arm.home)


def test_it_is_the_same_every_time() -> None:
    first, second = (
        save_state(RunningCell(load_product("idler"), CellConfig(), seed=3).simulation)["q"]
        for _ in range(2)
    )
    np.testing.assert_array_equal(first, second)
