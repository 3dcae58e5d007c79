"""Runs of a small cell that are told as commands by step, to be played in different loops."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from cell import Cell, CellConfig, Product, Simulation, load_product
from cell.forces import applied_force
from cell.products.joints import Screw
from cell.workpieces.thread import Engagement, ThreadState

Command = Callable[[Cell, Context], None]
Story = Mapping[int, Command]  # What is commanded before a step, by the number of the step.
Snapshot = dict[str, np.ndarray]

QUICK = CellConfig.load(overrides=["jig.vacuum.time_constant=0.05"])  # Jams in 0.15 s.
STEP = QUICK.simulation.time_step


def small_product(*names: str) -> Product:
    """Return some parts of the motor unit, with the screws among them."""
    whole = load_product("motor_unit")
    parts = {name: whole.parts[name] for name in names}
    joints = [
        joint
        for joint in whole.joints
        if isinstance(joint, Screw) and {joint.part, joint.into, joint.clamps} <= set(names)
    ]
    return replace(whole, parts=parts, joints=tuple(joints), groups={}, orders=())


# Commands.


def put_motor_on_jig(cell: Cell, root: Context, sink: float = 0.002) -> None:
    """Stand the motor on the fixture, this far in [m], awake."""
    motor = cell.parts["motor"]
    cell.parts.wake(root, "motor")
    context = cell.plant.GetMyMutableContextFromRoot(root)
    rear = -0.0534  # Of the can, in the motor's frame [m].
    X_JM = RigidTransform([0.0, 0.0, cell.fixture.entry_height - rear - sink])
    cell.plant.SetFreeBodyPose(context, motor.body, cell.fixture.pose(context) @ X_JM)


def push(cell: Cell, root: Context, force: float) -> None:
    """Push the motor's end down [N]."""
    F_W = SpatialForce(np.zeros(3), np.array([0.0, 0.0, -force]))
    load = applied_force(cell.parts["motor"].body.index(), np.array([0.0, 0.0, -0.05]), F_W)
    port = cell.ports.inputs["external_forces"]
    context = port.get_system().GetMyMutableContextFromRoot(root)
    port.FixValue(context, [load] if force else [])


def press_motor(cell: Cell, root: Context) -> None:
    """Put the motor onto the fixture and push it in."""
    put_motor_on_jig(cell, root)
    motor = cell.parts["motor"]
    cell.fixture.receive(root, motor.body, motor.part.mesh)
    push(cell, root, 20.0)


def let_go(cell: Cell, root: Context) -> None:
    """End the push."""
    push(cell, root, 0.0)


def fix(cell: Cell, root: Context) -> None:
    """Start to fix."""
    cell.fixture.fix(root)


def free(cell: Cell, root: Context) -> None:
    """Start to let go."""
    cell.fixture.free(root)


def sleep(cell: Cell, root: Context) -> None:
    """Put the motor to sleep."""
    cell.parts.sleep(root, "motor")


def wake(cell: Cell, root: Context) -> None:
    """Wake the motor."""
    cell.parts.wake(root, "motor")


def relax_arm(cell: Cell, root: Context) -> None:
    """Switch the holder's drive to torque, with a small one."""
    cell.holder.drive.use_torque(root, True)
    cell.holder.drive.set_effort(root, np.array([0.0, 2.0, 1.0, 0.0, 0.1, 0.0]))


def move_arm(cell: Cell, root: Context) -> None:
    """Send the holder's joints a little away from home."""
    home = cell.holder.home
    cell.holder.drive.set_target(root, home + 0.02, np.zeros(len(home)))


def stiffen_arm(cell: Cell, root: Context) -> None:
    """Switch the holder's drive back to position, where it is."""
    cell.holder.hold_here(root)


def catch_bolt(cell: Cell, root: Context) -> None:
    """Put the first thread into the state of a caught one, the spindle turning."""
    cell.parts.wake(root, "bolt_1")
    cell.driver.tool.command(root, 5.0)
    cell.threads.set(root, "bolt_1", Engagement(ThreadState.CAUGHT))


# Pressed, jammed at about step 350, asleep for a while, vented.
JIG_STORY: Story = {
    0: press_motor,
    200: fix,
    400: let_go,
    450: sleep,
    500: wake,
    600: free,
}
JIG_STEPS = 750

# Loops.


def play_ours(cell: Cell, story: Story, steps: int) -> Simulation:
    """Play a story in the loop of this project; return the simulation at its end."""
    simulation = Simulation(cell)
    for step in range(steps):
        if step in story:
            story[step](cell, simulation.root)
        simulation.step()
    return simulation


class Player:
    """Plays a story with Drake's own simulator: one line more than any Drake program has."""

    def __init__(self, cell: Cell, story: Story) -> None:
        assert cell.diagram is not None
        self.cell, self.story, self.step = cell, story, 0
        self.simulator = Simulator(cell.diagram)
        self.simulator.set_monitor(cell.monitor)
        self.simulator.Initialize()
        self.root = self.simulator.get_mutable_context()
        cell.parts.sleep_all_but(self.root, ())

    def play(self, steps: int) -> Player:
        """Go on by some steps, in as few strides as the story allows."""
        end = self.step + steps
        while self.step < end:
            if self.step in self.story:
                self.story[self.step](self.cell, self.root)
            self.step = min([k for k in self.story if k > self.step] + [end], default=end)
            self.step = min(self.step, end)
            self.simulator.AdvanceTo(self.step * STEP)
        return self


def snapshot(cell: Cell, root: Context) -> Snapshot:
    """Return everything that the course of a run depends on, and what is sensed."""
    context = cell.plant.GetMyContextFromRoot(root)
    state = {
        "q": cell.plant.GetPositions(context),
        "v": cell.plant.GetVelocities(context),
        "drives": {name: drive.save(root) for name, drive in cell.drives.items()},
        "asleep": {part.part.name: part.asleep(root) for part in cell.parts},
        "threads": cell.threads.save(root),
        "fixture": cell.fixture.save(root),
        "loads": cell.sleeper.save(root, [part.body for part in cell.parts]),
        "force_plate": cell.force_plate.read(context),
        "wrists": {name: arm.wrist.read(context) for name, arm in cell.arms.items()},
    }
    return _flat(state)


def _flat(nested: Mapping[str, Any], prefix: str = "") -> Snapshot:
    flat: Snapshot = {}
    for name, value in nested.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}/")
        else:
            flat[prefix + name] = np.array(value)
    return flat


def assert_same(one: Snapshot, other: Snapshot) -> None:
    """Compare to the last bit."""
    assert one.keys() == other.keys()
    for name, value in one.items():
        np.testing.assert_array_equal(other[name], value, err_msg=name)
