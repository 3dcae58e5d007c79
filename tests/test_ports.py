"""The cell's ports: a caller's systems command it and read it, each by its name."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource
from stories import QUICK, Player, press_motor, small_product, wake

from cell import Cell, add_cell, build_cell
from cell.errors import InputError, UnknownName
from cell.fixtures.soft_jig import JigState
from cell.forces import applied_force

PRODUCT = small_product("motor")
HOLD = "left.desired_state"


@pytest.fixture(scope="module")
def cell() -> Cell:
    return build_cell(QUICK, PRODUCT)


def told(cell: Cell, values: dict[str, list[float] | np.ndarray], steps: int) -> Context:
    """Fix inputs of the diagram, play some steps, return the Context."""
    assert cell.diagram is not None
    player = Player(cell, {})
    for name, value in values.items():
        cell.diagram.GetInputPort(name).FixValue(player.root, value)
    return player.play(steps).root


def plant_of(cell: Cell, root: Context) -> Context:
    return cell.plant.GetMyContextFromRoot(root)


def test_every_output_is_what_the_handles_read(cell: Cell) -> None:
    """Also before the first step."""
    assert cell.diagram is not None
    player = Player(cell, {0: wake})
    for steps in (0, 20):
        root = player.play(steps).root
        context = plant_of(cell, root)
        driver, jig = cell.screwdriver.read(context), cell.fixture.reading(root)
        expected = {
            "left.wrench": cell.arms["left"].wrist.read(context),
            "right.wrench": cell.arms["right"].wrist.read(context),
            "force_plate": cell.force_plate.read(context),
            "left_gripper.opening": [cell.gripper.read(context).opening],
            "spindle.torque": [driver.torque],
            "spindle.push": [driver.push],
            "jig.pressure": [jig["pressure"]],
            "jig.state": [jig["state"]],
            "motor.pose": cell.parts["motor"].X_WP(context),
        }
        assert set(expected) == set(cell.ports.outputs)
        for name, value in expected.items():
            read = cell.diagram.GetOutputPort(name).Eval(root)
            if isinstance(read, RigidTransform):
                assert read.IsExactlyEqualTo(value)
            else:
                np.testing.assert_array_equal(read, value, err_msg=name)


def test_arm_follows_a_desired_state_and_a_torque(cell: Cell) -> None:
    """With only torque given the position loop is off; with both, the torque is added."""
    arm, n = cell.arms["left"], cell.arms["left"].dof
    goal = np.concatenate([arm.home + 0.05, np.zeros(n)])
    twist = np.eye(n)[-1] * 0.5  # N m at the last joint.
    root = told(cell, {HOLD: goal}, 300)
    np.testing.assert_allclose(arm.positions(plant_of(cell, root)), goal[:n], atol=1e-4)
    assert not arm.drive.uses_torque(root)
    root = told(cell, {"left.torque": twist}, 100)
    assert arm.drive.uses_torque(root)
    assert arm.positions(plant_of(cell, root))[-1] - arm.home[-1] > 0.01
    root = told(cell, {HOLD: goal, "left.torque": twist}, 300)
    assert not arm.drive.uses_torque(root)
    off = (arm.positions(plant_of(cell, root)) - goal[:n])[-1]
    assert 0.0 < off < 1e-3


def test_tools_follow_their_ports(cell: Cell) -> None:
    root = told(cell, {"left_gripper.opening": [0.02], "spindle.speed": [5.0]}, 400)
    context = plant_of(cell, root)
    assert cell.gripper.read(context).opening == pytest.approx(0.02, abs=1e-5)
    assert cell.screwdriver.read(context).speed == pytest.approx(5.0, rel=0.01)
    assert cell.screwdriver.drive.commanded_speed(root) == 5.0


def test_commands_of_another_size_are_one_line(cell: Cell) -> None:
    drive, root = cell.holder.drive, told(cell, {}, 0)
    for q, v in ((5, 6), (5, 7), (7, 7)):
        with pytest.raises(InputError, match="'left_drive' takes 6 positions and as many"):
            drive.set_target(root, np.zeros(q), np.zeros(v))
    with pytest.raises(InputError, match="'left_drive' takes 6 efforts, not 5"):
        drive.set_effort(root, np.zeros(5))


def test_grip_force_is_added_behind_the_opening(cell: Cell) -> None:
    """It moves the target of the driven finger, as the handle's command does."""
    drive = cell.gripper.drive
    root = told(cell, {"left_gripper.opening": [0.02], "left_gripper.force": [10.0]}, 1)
    by_port = drive.desired(drive.GetMyContextFromRoot(root))
    root = told(cell, {}, 0)
    cell.gripper.command(root, 0.02, 10.0)
    np.testing.assert_array_equal(drive.desired(drive.GetMyContextFromRoot(root)), by_port)


def test_vacuum_port_jams_and_vents(cell: Cell) -> None:
    """While it has a value, it overrides the commands to the pump."""
    assert cell.diagram is not None
    player = Player(cell, {0: press_motor}).play(50)
    vacuum = cell.diagram.GetInputPort("jig.vacuum")
    vacuum.FixValue(player.root, [60e3])
    player.play(300)
    assert cell.fixture.fixed(player.root)
    assert cell.fixture.reading(player.root)["pressure"] == pytest.approx(60e3, rel=0.01)
    vacuum.FixValue(player.root, [0.0])
    player.play(1)
    assert cell.fixture.reading(player.root)["state"] == list(JigState).index(JigState.SOFT)
    cell.fixture.fix(player.root)
    player.play(300)
    assert cell.fixture.freed(player.root)


@pytest.mark.parametrize("vacuum", [-1.0, 95e3, np.nan])
def test_vacuum_beyond_the_pump_is_one_line(cell: Cell, vacuum: float) -> None:
    with pytest.raises(InputError, match=r"beyond the pump: it draws 0 to 90000 Pa.*\.$"):
        told(cell, {"jig.vacuum": [vacuum]}, 2)


class Spring(LeafSystem):
    """A caller's controller: joint torques that pull to a goal."""

    def __init__(self, goal: np.ndarray, wrist_size: int) -> None:
        super().__init__()
        self._goal = goal
        self._wrench = self.DeclareVectorInputPort("wrench", wrist_size)
        self.DeclareVectorOutputPort("torque", len(goal), self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        assert np.isfinite(self._wrench.Eval(context)).all()
        output.SetFromVector(self._goal)


def test_callers_controller_closes_a_loop_through_the_ports() -> None:
    """From the wrist's wrench to torques of the same arm: no algebraic loop."""
    builder = DiagramBuilder()
    cell = add_cell(builder, QUICK, PRODUCT)
    n = cell.arms["left"].dof
    mine = builder.AddNamedSystem("mine", Spring(0.5 * np.eye(n)[-1], 6))
    builder.Connect(cell.ports.output("left.wrench"), mine.get_input_port())
    cell.ports.connect(builder, mine.get_output_port(), "left.torque")
    hold = builder.AddSystem(ConstantVectorSource(np.append(cell.arms["right"].home, np.zeros(6))))
    cell.ports.connect(builder, hold.get_output_port(), "right.desired_state")
    cell = cell.with_diagram(builder.Build())
    root = Player(cell, {}).play(50).root
    left, right = cell.arms["left"], cell.arms["right"]
    assert left.drive.uses_torque(root)
    assert left.velocities(plant_of(cell, root))[-1] > 0.1
    np.testing.assert_allclose(right.positions(plant_of(cell, root)), right.home, atol=1e-5)


def test_callers_forces_are_added_to_the_cells() -> None:
    builder = DiagramBuilder()
    cell = add_cell(builder, QUICK, PRODUCT)
    body = cell.parts["motor"].body
    F_W = SpatialForce(np.zeros(3), np.array([0.0, 0.0, 5.0]))
    lift = applied_force(body.index(), body.default_com(), F_W)
    source = builder.AddSystem(ConstantValueSource(AbstractValue.Make([lift])))
    cell.ports.connect(builder, source.get_output_port(), "external_forces")
    cell = cell.with_diagram(builder.Build())
    root = Player(cell, {0: wake}).play(20).root
    v = cell.parts["motor"].velocity(plant_of(cell, root))
    rise = 20e-3 * (5.0 / body.default_mass() - 9.81)
    assert v[5] == pytest.approx(rise, rel=0.05)


def test_what_cannot_be_connected_is_one_line() -> None:
    builder, elsewhere = DiagramBuilder(), DiagramBuilder()
    cell = add_cell(builder, QUICK, PRODUCT)
    six, five = (
        builder.AddNamedSystem(f"{n} numbers", ConstantVectorSource(np.zeros(n))) for n in (6, 5)
    )
    word = builder.AddNamedSystem("word", ConstantValueSource(AbstractValue.Make("word")))
    stranger = elsewhere.AddNamedSystem("stranger", ConstantVectorSource(np.zeros(6)))
    cell.ports.connect(builder, six.get_output_port(), "left.torque")
    for source, name, message in (
        (six, "left.torque", "'left.torque' of the cell is connected already"),
        (five, "right.torque", "takes a vector of 6; '5 numbers.y0' is a vector of 5"),
        (word, "right.torque", "takes a vector of 6; 'word.y0' is an abstract value"),
        (six, "external_forces", "takes an abstract value; '6 numbers.y0' is a vector of 6"),
        (word, "external_forces", "'word.y0' cannot be connected to input 'external_forces'"),
        (stranger, "right.torque", "'stranger' has not been registered"),
    ):
        with pytest.raises(InputError, match=message) as error:
            cell.ports.connect(builder, source.get_output_port(), name)
        assert "\n" not in str(error.value)


def test_unknown_ports_are_named_with_the_known_ones(cell: Cell) -> None:
    source = ConstantVectorSource(np.zeros(1)).get_output_port()
    with pytest.raises(
        UnknownName, match="'left.torqe'.*Did you mean 'left.torque'.*spindle.speed"
    ):
        cell.ports.connect(DiagramBuilder(), source, "left.torqe")
    with pytest.raises(UnknownName, match="'plate.pose'.*Known: force_plate.*motor.pose"):
        cell.ports.output("plate.pose")
