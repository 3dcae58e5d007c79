"""The cell in your own diagram: your body, your controller, Drake's own Simulator.

The left arm presses a box into the bag and the pump freezes the beads around it: the jaws slip off
when they pull with 6 N. Once air is back in, they lift the box.
"""

from pydrake.geometry import AddRigidHydroelasticProperties, Box, ProximityProperties
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.trajectories import PiecewisePolynomial

from cell import CellConfig, Product, add_cell

SIZE, DOWN = (0.03, 0.03, 0.06), RotationMatrix.MakeXRotation(3.14159265)  # Of the box [m].


def add_box(plant, scene_graph):
    inertia = SpatialInertia.SolidBoxWithMass(0.2, *SIZE)
    box = plant.AddRigidBody("box", plant.AddModelInstance("box"), inertia)
    AddRigidHydroelasticProperties(0.01, touch := ProximityProperties())
    # The frozen bag holds collision geometry whose name starts with "bed_".
    plant.RegisterCollisionGeometry(box, RigidTransform(), Box(*SIZE), "bed_box", touch)


class Hand(LeafSystem):
    def __init__(self, up, down):
        super().__init__()
        half, times = (up + down) / 2, [0.0, 0.1, 0.5, 1.6, 1.8, 2.8, 3.0, 4.0]
        knots = [q.reshape(-1, 1) for q in (up, up, down, down, half, half, up, up)]
        self.path = PiecewisePolynomial.FirstOrderHold(times, knots)
        self.DeclareVectorOutputPort("desired_state", 2 * len(up), self.calc)

    def calc(self, context, output):
        q = self.path.value(context.get_time()).ravel()
        output.SetFromVector([*q, *(0.0 * q)])


builder = DiagramBuilder()
cell = add_cell(builder, CellConfig.load(), Product(), extend=add_box)
plant, arm, box = cell.plant, cell.arms["left"], cell.plant.GetBodyByName("box")
X_WTop = cell.X_WJ @ RigidTransform([0.0, 0.0, cell.fixture.entry_height])
X_WUp, X_WDown = (X_WTop @ RigidTransform(DOWN, [0.0, 0.0, z]) for z in (0.045, 0.015))
up, down = (
    arm.reach(plant.CreateDefaultContext(), arm.frame("tip"), X, arm.home) for X in (X_WUp, X_WDown)
)
hand = builder.AddSystem(Hand(up, down))
cell.ports.connect(builder, hand.get_output_port(), "left.desired_state")
simulator = Simulator(builder.Build())
simulator.set_monitor(cell.monitor)
simulator.Initialize()
root = simulator.get_mutable_context()
context = plant.GetMyMutableContextFromRoot(root)
plant.SetPositions(context, arm.instance, up)
plant.SetFreeBodyPose(context, box, X_WTop @ RigidTransform([0.0, 0.0, 0.045]))
cell.fixture.receive(root, box)
for time, what, command, force in (
    (0.7, "pressed", None, 20.0),
    (1.6, "frozen", cell.fixture.fix, 20.0),
    (1.8, "pulled", None, 5.0),
    (2.8, "air let in", cell.fixture.free, 20.0),
    (3.1, "lifted", None, 20.0),
):
    if command is not None:
        command(root)
    cell.gripper.command(root, opening=SIZE[0], force=force)
    simulator.AdvanceTo(time)
    z = plant.EvalBodyPoseInWorld(context, box).translation()[2] - X_WTop.translation()[2]
    pull = -arm.wrist.read(context)[5]
    print(f"{time} s, {what}: box at {1e3 * (z - 0.03):+.2f} mm, the arm pulls with {pull:+.1f} N")
assert z > 0.02
