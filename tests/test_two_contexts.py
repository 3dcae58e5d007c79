"""Contexts of one diagram do not meet; a caller's mistakes are said before Drake gives up."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from cell import Cell, CellConfig, InputError, Product, add_cell, build_cell

EMPTY = Product("nothing", {})
TORQUE = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]  # [N m]


def start(cell: Cell) -> tuple[Simulator, Context]:
    assert cell.diagram is not None
    simulator = Simulator(cell.diagram)
    simulator.set_monitor(cell.monitor)
    simulator.Initialize()
    return simulator, simulator.get_mutable_context()


def test_torques_in_one_context_and_positions_in_another() -> None:
    """Drake keeps gains in the model: each step has those of its own Context all the same."""
    cell = build_cell(CellConfig(), EMPTY)
    assert cell.diagram is not None
    arm, port = cell.arms["left"], cell.diagram.GetInputPort("left.torque")

    def moved(root: Context) -> np.ndarray:
        return arm.positions(cell.plant.GetMyContextFromRoot(root)) - arm.home

    alone, root = start(cell)
    port.FixValue(root, TORQUE)
    alone.AdvanceTo(0.02)
    expected = moved(root)
    assert expected[5] > 1e-4
    (torque, torque_root), (position, position_root) = start(cell), start(cell)
    port.FixValue(torque_root, TORQUE)
    for step in range(1, 21):
        torque.AdvanceTo(step * 1e-3)
        position.AdvanceTo(step * 1e-3)
    np.testing.assert_array_equal(moved(torque_root), expected)
    np.testing.assert_allclose(moved(position_root), 0.0, atol=1e-9)


def test_two_cells_of_one_name_are_refused() -> None:
    builder = DiagramBuilder()
    add_cell(builder, CellConfig(), EMPTY)
    with pytest.raises(InputError, match="two systems named .*plant.*name="):
        add_cell(builder, CellConfig(), EMPTY)


@pytest.mark.parametrize("name", ["left.desired_state", "external_forces"])
def test_an_output_of_another_size_is_refused(name: str) -> None:
    builder = DiagramBuilder()
    cell = add_cell(builder, CellConfig(), EMPTY)
    source = builder.AddNamedSystem("mine", ConstantVectorSource(np.zeros(5)))
    with pytest.raises(InputError, match=rf"'{name}' .* 5 numbers .* of 'mine'"):
        cell.ports.connect(builder, source.get_output_port(), name)
