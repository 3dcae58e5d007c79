"""Contexts of one diagram are independent; a caller's mistakes are said before Drake gives up."""

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Box, Cylinder, ProximityProperties, SceneGraph, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder

from cell import (
    Cell,
    CellConfig,
    FixtureError,
    InputError,
    Product,
    Simulation,
    add_cell,
    build_cell,
    restore_state,
    save_state,
)
from cell.builder import Extend

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


def adds(shape: Shape) -> Extend:
    """Return what adds a body "mine" for the bag to hold."""

    def extend(plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
        inertia = SpatialInertia.SolidBoxWithMass(0.1, 0.03, 0.03, 0.03)
        body = plant.AddRigidBody("mine", plant.AddModelInstance("mine"), inertia)
        touch = ProximityProperties()
        plant.RegisterCollisionGeometry(body, RigidTransform(), shape, "bed_mine", touch)

    return extend


def test_a_shape_that_the_bed_cannot_conform_to_is_refused_before_the_press() -> None:
    cell = build_cell(CellConfig(), EMPTY, extend=adds(Cylinder(0.015, 0.03)))
    _, root = start(cell)
    mesh = trimesh.creation.cylinder(0.015, 0.03)
    with pytest.raises(FixtureError, match="'bed_mine' is a Cylinder"):
        cell.fixture.receive(root, cell.plant.GetBodyByName("mine"), mesh)


def test_a_state_of_other_bodies_is_refused() -> None:
    """Drake would end the process over the number of positions."""
    with_body = build_cell(CellConfig(), EMPTY, extend=adds(Box(0.03, 0.03, 0.03)))
    without = Simulation(build_cell(CellConfig(), EMPTY))
    with pytest.raises(InputError):
        restore_state(without, save_state(Simulation(with_body)))
