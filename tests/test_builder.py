"""The cell as a Drake diagram: of its own, in a caller's, from anywhere, with nothing connected."""

from __future__ import annotations

import gc
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    ProximityProperties,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from stories import small_product, stand_on_jig

from cell import Cell, CellConfig, Simulation, add_cell, build_cell, load_product
from cell.errors import InputError, UnknownName
from cell.fixtures.base import FixtureError
from cell.monitor import Monitor
from cell.simulation.events import receive_part
from cell.simulation.state import restore_state, save_state
from cell.workpieces.thread import Engagement, ThreadState


def caller_diagram() -> tuple[Diagram, Monitor]:
    """Return a caller's diagram with a cell in it, and its monitor; the handles are gone."""
    builder = DiagramBuilder()
    cell = add_cell(builder, CellConfig(), load_product("motor_unit"))
    return builder.Build(), cell.monitor


def test_cell_is_built_from_any_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    cell = build_cell(CellConfig.load("default"), load_product("motor_unit"))
    assert cell.diagram is not None
    assert {part.part.name for part in cell.parts} == set(cell.product.parts)
    assert set(cell.threads) == set(cell.product.screws)


def test_callers_diagram_steps_after_the_handles_are_dropped() -> None:
    """Nothing that a step needs belongs to the dropped value."""
    diagram, monitor = caller_diagram()
    gc.collect()
    simulator = Simulator(diagram)
    simulator.set_monitor(monitor)
    del monitor
    plant = diagram.GetSubsystemByName("plant")
    before = plant.GetPositions(plant.GetMyContextFromRoot(simulator.get_context()))
    simulator.AdvanceTo(0.02)
    gc.collect()
    simulator.AdvanceTo(0.04)
    after = plant.GetPositions(plant.GetMyContextFromRoot(simulator.get_context()))
    np.testing.assert_allclose(after, before, atol=5e-4)  # Parts awake in the tray settle.
    for arm in map(plant.GetModelInstanceByName, ("left_arm", "right_arm")):
        held = plant.GetPositionsFromArray(arm, before)
        np.testing.assert_allclose(plant.GetPositionsFromArray(arm, after), held, atol=1e-4)


def test_an_earlier_run_is_forgotten(motor_unit_cell: Cell) -> None:
    """A second simulation of a cell begins like the first, whatever happened in that."""
    cell = motor_unit_cell
    first = Simulation(cell)
    cell.parts.sleep_all_but(first.root, ["motor"])
    cell.holder.drive.use_torque(first.root, True)
    receive_part("motor")(first)
    cell.threads.set(first.root, "bolt_1", Engagement(ThreadState.CAUGHT))
    first.step()
    second = Simulation(cell)
    root = second.root
    assert all(part.asleep(root) for part in cell.parts)
    assert not cell.holder.drive.uses_torque(root)
    assert cell.threads.state(root, "bolt_1") is ThreadState.FREE
    assert cell.fixture.reading(root) == {"pressure": 0.0, "state": 0}
    assert not any(cell.fixture.holds(root, part.body) for part in cell.parts)
    before = cell.plant.GetPositions(second.context)
    for _ in range(5):
        second.step()
    np.testing.assert_allclose(cell.plant.GetPositions(second.context), before, atol=1e-6)


def test_arms_hold_with_nothing_connected(motor_unit_cell: Cell) -> None:
    simulation = Simulation(motor_unit_cell)
    before = {name: arm.positions(simulation.context) for name, arm in motor_unit_cell.arms.items()}
    for _ in range(100):
        simulation.step()
    for name, arm in motor_unit_cell.arms.items():
        drift = np.abs(arm.positions(simulation.context) - before[name])
        assert drift.max() < 1e-4, name
        np.testing.assert_allclose(before[name], arm.home, atol=1e-12)


def test_sleeping_cell_has_no_contact_and_moves_no_part(motor_unit_cell: Cell) -> None:
    simulation = Simulation(motor_unit_cell)
    poses = {p.part.name: p.X_WP(simulation.context).GetAsMatrix4() for p in motor_unit_cell.parts}
    simulation.step()
    for part in motor_unit_cell.parts:
        assert part.asleep(simulation.root)
        np.testing.assert_array_equal(
            part.X_WP(simulation.context).GetAsMatrix4(), poses[part.part.name]
        )
    port = motor_unit_cell.plant.get_contact_results_output_port()
    contacts = port.Eval(simulation.context)
    assert contacts.num_hydroelastic_contacts() == 0
    assert contacts.num_point_pair_contacts() == 0


def test_parts_awake_in_the_tray_stay_there(motor_unit_cell: Cell) -> None:
    simulation = Simulation(motor_unit_cell)
    parts, context = motor_unit_cell.parts, simulation.context
    parts.sleep_all_but(simulation.root, parts.by_name)
    before = {name: parts[name].X_WP(context).translation() for name in parts.by_name}
    for _ in range(100):
        simulation.step()
    for name, p_WP in before.items():
        assert np.linalg.norm(parts[name].X_WP(context).translation() - p_WP) < 0.5e-3, name


def test_two_cells_from_one_configuration_are_alike() -> None:
    """Rebuilding gives the same plant, down to the order of its states."""
    one, other = (build_cell(CellConfig(), load_product("motor_unit")).plant for _ in range(2))
    assert one.GetStateNames() == other.GetStateNames()
    q_one, q_other = (plant.GetPositions(plant.CreateDefaultContext()) for plant in (one, other))
    np.testing.assert_array_equal(q_one, q_other)


@pytest.mark.parametrize("fixed", ["true", "false"])
def test_jig_base_rests_on_the_force_plate_bolted_or_free(fixed: str) -> None:
    """A base that is not bolted down stays where it is by its weight; the plate reads it."""
    config = CellConfig.load(overrides=[f"workcell.jig_base_fixed={fixed}"])
    cell = build_cell(config, load_product("motor_unit"))
    simulation = Simulation(cell)
    for _ in range(200):
        simulation.step()
    X_WJ = cell.fixture.pose(simulation.context)
    assert np.linalg.norm(X_WJ.translation() - cell.X_WJ.translation()) < 0.1e-3
    bodies = [cell.plant.GetBodyByName(name) for name in ("force_plate", "jig_base")]
    weight = 9.81 * sum(body.get_mass(simulation.context) for body in bodies)
    wrench = cell.force_plate.read(simulation.context)
    np.testing.assert_allclose(wrench[3:], [0.0, 0.0, -weight], atol=0.01 * weight)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("workcell.fixture=soft_jog", "No fixture 'soft_jog'.*'soft_jig'.*Known:.*flat_plate"),
        ("arms.left.model=ur6e", "No arm model 'ur6e'.*Did you mean 'ur.*Known:.*iiwa14"),
        ("arms.left.tool=hand_x", "No tool 'hand_x'.*'hand_e'.*Known:.*screwdriver"),
        ("arms.left.home_deg=[0,90]", "'home_deg' of an arm has 2 numbers;.*'ur5e' has 6 joints"),
        ("arms.right.stiffness=[1,2,3]", "'stiffness' of an arm has 3 numbers;.*6 joints"),
        ("arms.left.model=iiwa14", "Arm 'left' cannot wait with joint_1 at 180 deg: .*-170 to 170"),
        ("arms.right.damping=[1]", "'damping' of an arm has 1 numbers;.*6 joints"),
    ],
)
def test_devices_that_do_not_exist_are_one_line(override: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        build_cell(CellConfig.load(overrides=[override]), small_product())
    assert "\n" not in str(error.value)


def test_cell_without_a_tool_of_a_role_says_which_there_are() -> None:
    config = CellConfig.load(overrides=["arms.right.tool=hand_e"])
    cell = build_cell(config, load_product("motor_unit"))
    assert [arm.tool.name for arm in cell.arms.values()] == ["left_gripper", "right_gripper"]
    with pytest.raises(UnknownName, match="No arm with a 'driver'.*Known: gripper"):
        assert cell.driver
    assert len(cell.threads) == 0
    Simulation(cell).step()


def test_cell_without_its_diagram_cannot_be_simulated() -> None:
    with pytest.raises(InputError, match="use build_cell, or cell.with_diagram"):
        Simulation(add_cell(DiagramBuilder(), CellConfig(), small_product()))


def add_ball(plant: MultibodyPlant, _: SceneGraph) -> None:
    """Add a caller's own body that knows nothing of the jig, in an instance with scopes."""
    instance = plant.AddModelInstance("mine::deep/ball")
    body = plant.AddRigidBody("ball", instance, SpatialInertia.SolidSphereWithMass(0.1, 0.02))
    properties = ProximityProperties()
    AddRigidHydroelasticProperties(0.01, properties)
    AddContactMaterial(friction=CoulombFriction(0.5, 0.5), properties=properties)
    plant.RegisterCollisionGeometry(body, RigidTransform(), Sphere(0.02), "ball", properties)


def test_callers_body_meets_the_bag_as_plain_contact() -> None:
    """The bag cannot conform to it and says so; it still does not fall through."""
    cell = build_cell(CellConfig(), small_product(), extend=add_ball)
    simulation = Simulation(cell)
    ball = cell.plant.GetBodyByName("ball")
    stand_on_jig(cell, simulation.root, ball, -0.02, -0.001)
    with pytest.raises(FixtureError, match="'mine::deep/ball::ball' cannot be held.*'bed_...'"):
        cell.fixture.receive(simulation.root, ball, trimesh.creation.icosphere(radius=0.02))
    for _ in range(100):
        simulation.step()
    X_JB = cell.fixture.pose(simulation.context).InvertAndCompose(
        cell.plant.EvalBodyPoseInWorld(simulation.context, ball)
    )
    assert X_JB.translation()[2] > cell.fixture.entry_height
    cell.sleeper.put_to_sleep(simulation.root, ball)
    again = Simulation(cell)
    restore_state(again, save_state(simulation))
    assert ball.is_locked(again.context)
