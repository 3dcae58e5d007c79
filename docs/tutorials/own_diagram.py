"""The cell in your own diagram: your body, your controller, Drake's own Simulator.

The left arm presses a box into the bag and the pump freezes the beads around it: the jaws slip off
when they pull with 5 N. Once air is back in, they lift the box.
"""

import numpy as np
import trimesh
from pydrake.geometry import AddRigidHydroelasticProperties, Box, ProximityProperties
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from cell import CellConfig, Product, add_cell

SIZE = np.array([0.03, 0.03, 0.06])  # Of the box [m].


def add_box(plant, scene_graph):
    inertia = SpatialInertia.SolidBoxWithMass(0.2, *SIZE)
    box = plant.AddRigidBody("box", plant.AddModelInstance("box"), inertia)
    touch = ProximityProperties()
    AddRigidHydroelasticProperties(0.01, touch)
    # The frozen bag holds collision geometry whose name starts with "bed_".
    plant.RegisterCollisionGeometry(box, RigidTransform(), Box(*SIZE), "bed_box", touch)


class Hand(LeafSystem):
    def __init__(self, q_up, q_down):
        super().__init__()
        self.q_up, self.q_down = q_up, q_down
        self.DeclareVectorOutputPort("desired_state", 2 * len(q_up), self.calc)

    def calc(self, context, output):
        times, down = [0.1, 0.5, 1.6, 1.8, 2.8, 3.0], [0.0, 1.0, 1.0, 0.5, 0.5, 0.0]
        q = self.q_up + np.interp(context.get_time(), times, down) * (self.q_down - self.q_up)
        output.SetFromVector(np.append(q, 0.0 * q))


builder = DiagramBuilder()
cell = add_cell(builder, CellConfig.load(), Product("nothing", {}), extend=add_box)
plant, arm, box = cell.plant, cell.arms["left"], cell.plant.GetBodyByName("box")
X_WTop = cell.X_WJ @ RigidTransform([0.0, 0.0, cell.fixture.entry_height])


def reach(z):  # Joint angles near home, jaws down, z above the top of the bag.
    X_TopF = RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0, 0, z + arm.tool.model.tip_z])
    found = arm.model.inverse(arm.config.X_WB.inverse() @ X_WTop @ X_TopF, arm.home)
    return min(found, key=lambda q: np.abs(np.sin((q - arm.home) / 2)).sum())


controller = builder.AddSystem(Hand(reach(0.045), reach(0.015)))
cell.ports.connect(builder, controller.get_output_port(), "left.desired_state")
simulator = Simulator(builder.Build())
simulator.set_monitor(cell.monitor)
simulator.Initialize()
root = simulator.get_mutable_context()
context = plant.GetMyMutableContextFromRoot(root)
plant.SetPositions(context, arm.instance, controller.q_up)
plant.SetFreeBodyPose(context, box, X_WTop @ RigidTransform([0.0, 0.0, 0.045]))
cell.fixture.receive(root, box, trimesh.creation.box(SIZE))
arm.tool.command(root, opening=SIZE[0], force=20.0)


def run_until(time, what):
    simulator.AdvanceTo(time)
    p_TopB = X_WTop.inverse() @ plant.EvalBodyPoseInWorld(context, box).translation()
    z, pull = p_TopB[2] - SIZE[2] / 2, -arm.wrist.read(context)[5]
    print(f"{time} s, {what}: box at {1e3 * z:+.2f} mm, the arm pulls with {pull:+.1f} N")
    return z


run_until(0.7, "pressed")
cell.fixture.fix(root)
frozen = run_until(1.6, "frozen")
arm.tool.command(root, opening=SIZE[0], force=5.0)
pulled = run_until(1.8, "pulled")
cell.fixture.free(root)
arm.tool.command(root, opening=SIZE[0], force=20.0)
freed = run_until(2.8, "air let in")
lifted = run_until(3.1, "lifted")
assert abs(pulled - frozen) < 0.2e-3 and lifted - freed > 10e-3
