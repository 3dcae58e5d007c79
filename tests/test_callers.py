"""Contexts of one diagram are independent; a caller's mistakes are said before Drake gives up."""

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Box, Cylinder, ProximityProperties, SceneGraph, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus
from pydrake.systems.primitives import ConstantVectorSource
from pydrake.visualization import ApplyVisualizationConfig, VisualizationConfig

from cell import (
    Cell,
    CellConfig,
    FixtureError,
    InputError,
    Product,
    Simulation,
    add_cell,
    build_cell,
    join_monitors,
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
    with pytest.raises(InputError, match="would be named steps: .*name="):
        add_cell(builder, CellConfig(), EMPTY)


def adds(shape: Shape, mass: float = 0.1) -> Extend:
    """Return what adds a body "mine" for the bag to hold."""

    def extend(plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
        inertia = SpatialInertia.SolidBoxWithMass(mass, 0.03, 0.03, 0.03)
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
    """With none, Drake would end the process over the number of positions."""
    saved = save_state(
        Simulation(build_cell(CellConfig(), EMPTY, extend=adds(Box(0.03, 0.03, 0.03))))
    )
    for other in (None, adds(Box(0.03, 0.03, 0.04)), adds(Box(0.03, 0.03, 0.03), mass=0.2)):
        simulation = Simulation(build_cell(CellConfig(), EMPTY, extend=other))
        with pytest.raises(InputError, match="another set of bodies"):
            restore_state(simulation, saved)


def test_what_the_bag_cannot_hold_is_refused() -> None:
    """One without hydroelastic properties, one of another plant, one that is part of the cell."""
    cell, other = (
        build_cell(CellConfig(), EMPTY, extend=adds(Box(0.03, 0.03, 0.03))) for _ in range(2)
    )
    _, root = start(cell)
    for plant, name, message in (
        (cell.plant, "mine", "'bed_mine' has no hydroelastic properties"),
        (other.plant, "mine", "of another plant"),
        (cell.plant, cell.jig_base.body.name(), "is not free"),
    ):
        with pytest.raises(FixtureError, match=message):
            cell.fixture.receive(root, plant.GetBodyByName(name))


def test_callers_own_plant_beside_a_cell_with_a_name() -> None:
    builder = DiagramBuilder()
    cell = add_cell(builder, CellConfig(), EMPTY, name="cell")
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    plant.Finalize()
    start(cell.with_diagram(builder.Build()))


def test_drakes_visualizers_find_a_cell_without_a_name() -> None:
    builder = DiagramBuilder()
    cell = add_cell(builder, CellConfig(), EMPTY)
    config = VisualizationConfig(publish_contacts=False, enable_meshcat_creation=False)
    ApplyVisualizationConfig(config, builder)
    start(cell.with_diagram(builder.Build()))


def test_ports_are_exported_but_for_those_that_are_connected() -> None:
    builder = DiagramBuilder()
    cells = {name: add_cell(builder, CellConfig(), EMPTY, name=name) for name in ("one", "two")}
    opening = builder.AddSystem(ConstantVectorSource(np.array([0.02]))).get_output_port()
    cells["one"].ports.connect(builder, opening, "left_gripper.opening")
    for name, cell in cells.items():
        cell.ports.export(builder, f"{name}.")
    diagram = builder.Build()
    assert not diagram.HasInputPort("one.left_gripper.opening")
    assert diagram.HasInputPort("two.left_gripper.opening")
    with pytest.raises(InputError, match="'left_gripper.opening': .*Build"):
        cells["two"].ports.connect(builder, opening, "left_gripper.opening")


def test_joined_monitors_stop_a_run_as_one_alone_does() -> None:
    cell = build_cell(CellConfig(), EMPTY)
    simulator, _ = start(cell)

    def mine(root: Context) -> EventStatus | None:
        if root.get_time() >= 0.01:
            return EventStatus.ReachedTermination(cell.plant, "enough")
        return None

    simulator.set_monitor(join_monitors(cell.monitor, mine))
    simulator.AdvanceTo(0.05)
    assert simulator.get_context().get_time() == pytest.approx(0.01)


def test_monitor_of_another_cell_is_one_line() -> None:
    cell, other = (build_cell(CellConfig(), EMPTY) for _ in range(2))
    simulator = Simulator(cell.diagram)
    simulator.set_monitor(other.monitor)
    with pytest.raises(InputError, match="monitor's cell is not in the diagram"):
        simulator.Initialize()
