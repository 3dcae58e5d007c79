"""A loose bolt in the part that carries it is linked, until the phase or the load ends that."""

import numpy as np
import pytest
from pydrake.multibody.math import SpatialForce
from stories import QUICK, small_product

from cell import Cell, Simulation, build_cell
from cell.forces import applied_force
from cell.simulation.state import restore_state, save_state

PLATE, BOLT = "plate", "bolt_1"
RIDING = frozenset([BOLT])
LINKED = QUICK.with_changes({"simulation.contact": "linked"})


@pytest.fixture(scope="module")
def cell() -> Cell:
    return build_cell(LINKED, small_product("motor", PLATE, BOLT))


def bolt_in_plate(cell: Cell, riding: frozenset[str]) -> Simulation:
    """Return a cell in which a bolt hangs by its head in the plate, on the tray, for 80 ms."""
    simulation = Simulation(cell)
    plate, bolt = cell.parts[PLATE], cell.parts[BOLT]
    cell.parts.sleep_all_but(simulation.root, [PLATE, BOLT])
    X_WA = plate.X_WP(simulation.context) @ plate.part.X_AP.inverse()
    cell.plant.SetFreeBodyPose(simulation.context, bolt.body, X_WA @ bolt.part.X_AP)
    cell.links.intend(simulation.root, riding=riding)
    step(simulation, 80)
    return simulation


def step(simulation: Simulation, count: int) -> None:
    for _ in range(count):
        simulation.step()


def linked(simulation: Simulation) -> bool:
    """Return whether bolt and plate are."""
    parts = simulation.cell.parts
    pair = {int(parts[name].body.index()) for name in (PLATE, BOLT)}
    return any(set(own) == pair for own in simulation.cell.links.memory(simulation.root).installed)


def pull(simulation: Simulation, force: float) -> None:
    """Pull the bolt up [N]."""
    port = simulation.cell.ports.inputs["external_forces"]
    F_W = SpatialForce(np.zeros(3), np.array([0.0, 0.0, force]))
    load = applied_force(simulation.cell.parts[BOLT].body.index(), np.zeros(3), F_W)
    port.FixValue(port.get_system().GetMyMutableContextFromRoot(simulation.root), [load])


def test_it_is_linked_while_it_rides_only(cell: Cell) -> None:
    assert not linked(bolt_in_plate(cell, frozenset()))
    simulation = bolt_in_plate(cell, RIDING)
    assert linked(simulation)
    cell.links.intend(simulation.root)
    assert not linked(simulation)


def test_it_is_let_go_when_what_pulls_at_it_exceeds_its_weight(cell: Cell) -> None:
    """The head bears pressure only: full contact lets go of it when nothing presses it down."""
    simulation = bolt_in_plate(cell, RIDING)
    weight = 9.81 * cell.parts[BOLT].body.default_mass()
    shares = np.linspace(0.5, 1.1, 300)
    for share in shares:
        pull(simulation, share * weight)
        step(simulation, 1)
        if not linked(simulation):
            break
    # A link may pull with 1 % of the force that pressed the bodies when it was made.
    assert share == pytest.approx(1.0, abs=0.02)
    resting = cell.parts[BOLT].X_WP(simulation.context).translation()[2]
    step(simulation, 50)
    pull(simulation, 1.1 * weight)
    step(simulation, 20)
    assert cell.parts[BOLT].X_WP(simulation.context).translation()[2] > resting + 1e-4


def test_continuing_from_a_saved_state_is_bit_identical(cell: Cell) -> None:
    simulation = bolt_in_plate(cell, RIDING)
    saved = save_state(simulation)
    step(simulation, 30)
    there = save_state(simulation)
    other = Simulation(cell)
    restore_state(other, saved)
    assert linked(other)
    step(other, 30)
    again = save_state(other)
    assert there.keys() == again.keys()
    for name, value in there.items():
        np.testing.assert_array_equal(again[name], value, err_msg=name)
