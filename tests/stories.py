"""Runs of a small cell that are told as commands by step, to be played in different loops."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    ProximityProperties,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from cell import Cell, CellConfig, Product, Simulation, load_product
from cell.forces import applied_force
from cell.products.joints import Screw
from cell.workpieces.thread import Engagement, ThreadState

Command = Callable[[Cell, Context], None]
Story = dict[int, Command]  # What is commanded before a step, by the number of the step.
Snapshot = dict[str, np.ndarray]

QUICK = CellConfig.load(overrides=["jig.vacuum.time_constant=0.05"])  # Jams in 0.15 s.
STEP = QUICK.simulation.time_step
CAN_REAR = -0.0534  # Of the motor's can, in the motor's frame [m].


BOX = (0.03, 0.03, 0.04)  # Of a caller's own body [m].


def add_box(plant: MultibodyPlant, _: SceneGraph) -> None:
    """Add a caller's own body, which the frozen bed can hold."""
    instance = plant.AddModelInstance("box")
    body = plant.AddRigidBody("box", instance, SpatialInertia.SolidBoxWithMass(0.2, *BOX))
    properties = ProximityProperties()
    AddRigidHydroelasticProperties(0.01, properties)
    AddContactMaterial(friction=CoulombFriction(0.5, 0.5), properties=properties)
    pose = RigidTransform()
    plant.RegisterCollisionGeometry(body, pose, Box(*BOX), "bed_box", properties)
    plant.SetDefaultFloatingBaseBodyPose(body, RigidTransform([0.0, 0.15, 0.5]))


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


def stand_on_jig(cell: Cell, root: Context, body: RigidBody, low: float, sink: float) -> None:
    """Stand a free body on the fixture, awake: its lowest point ``sink`` [m] below the top."""
    cell.sleeper.wake(root, body)
    context = cell.plant.GetMyMutableContextFromRoot(root)
    X_JP = RigidTransform([0.0, 0.0, cell.fixture.entry_height - low - sink])
    cell.plant.SetFreeBodyPose(context, body, cell.fixture.pose(context) @ X_JP)


def push(cell: Cell, root: Context, body: RigidBody, force: float) -> None:
    """Push a body down [N], near its low end."""
    F_W = SpatialForce(np.zeros(3), np.array([0.0, 0.0, -force]))
    low = np.array([0.0, 0.0, -0.05 if body.name() != "box" else -0.02])
    port = cell.ports.inputs["external_forces"]
    context = port.get_system().GetMyMutableContextFromRoot(root)
    port.FixValue(context, [applied_force(body.index(), low, F_W)] if force else [])


def press_motor(cell: Cell, root: Context) -> None:
    """Put the motor onto the fixture and push it in."""
    motor = cell.parts["motor"]
    stand_on_jig(cell, root, motor.body, CAN_REAR, 0.002)
    cell.fixture.receive(root, motor.body, motor.part.mesh)
    push(cell, root, motor.body, 20.0)


def press_box(cell: Cell, root: Context) -> None:
    """Put a caller's own body onto the fixture and push it in."""
    box = cell.plant.GetBodyByName("box")
    stand_on_jig(cell, root, box, -BOX[2] / 2, 0.002)
    cell.fixture.receive(root, box, trimesh.creation.box(BOX))
    push(cell, root, box, 20.0)


def let_go(cell: Cell, root: Context) -> None:
    """End the push."""
    push(cell, root, cell.parts["motor"].body, 0.0)


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
    """Screw a bolt home into the motor, wherever that is, and let the spindle turn."""
    context, thread = cell.plant.GetMyMutableContextFromRoot(root), cell.threads["bolt_1"]
    cell.parts.wake(root, "bolt_1")
    X_WF = thread.thread_frame.CalcPoseInWorld(context)
    cell.plant.SetFreeBodyPose(context, thread.bolt, X_WF)
    cell.screwdriver.command(root, 5.0)
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
BOX_STORY: Story = JIG_STORY | {
    0: press_box,
    450: lambda cell, root: cell.sleeper.put_to_sleep(root, cell.plant.GetBodyByName("box")),
    500: lambda cell, root: cell.sleeper.wake(root, cell.plant.GetBodyByName("box")),
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
    """Plays a story with Drake's own simulator: one line more than any Drake program has.

    Args:
        cell: In the diagram.
        story: Its commands.
        simulator: Of the diagram, with the monitor; None makes one.
    """

    def __init__(self, cell: Cell, story: Story, simulator: Simulator | None = None) -> None:
        assert cell.diagram is not None
        self.cell, self.story = cell, story
        if simulator is None:
            simulator = Simulator(cell.diagram)
            simulator.set_monitor(cell.monitor)
        self.simulator = simulator
        self.simulator.Initialize()
        self.root = self.simulator.get_mutable_context()
        self.step = round(self.root.get_time() / STEP)
        if self.step == 0:
            cell.parts.sleep_all_but(self.root, ())

    def play(self, steps: int) -> Player:
        """Go on by some steps, in as few strides as the story allows."""
        end = self.step + steps
        while self.step < end:
            if self.step in self.story:
                self.story[self.step](self.cell, self.root)
            self.step = min([k for k in self.story if self.step < k < end] + [end])
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
        "links": cell.links.save(root),
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
