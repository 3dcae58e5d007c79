"""Your own controller for an arm: torques instead of positions.

The left hand becomes a spring in space: joint torques are J' (K e - D V). A side wind of 10 N then
pushes it 20 mm away, as Hooke's law says for 500 N/m.
"""

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from cell import CellConfig, Product, add_cell

STIFFNESS = np.array([50.0, 50.0, 50.0, 500.0, 500.0, 500.0])  # [N m/rad], [N/m]
DAMPING = np.array([10.0, 10.0, 10.0, 100.0, 100.0, 100.0])  # [N m s/rad], [N s/m]
WIND = 10.0  # [N]


class Spring(LeafSystem):
    """Holds the frame "tip" of an arm's gripper where it is in the home configuration.

    Input port: the state of the arm's joints, as Drake's plant puts it out. Output port: torques.
    """

    def __init__(self, arm):
        super().__init__()
        self.arm, self.tip = arm, arm.frame("tip")
        # The controller's own Context of the plant: it computes with it, nobody steps it.
        self.context = arm.plant.CreateDefaultContext()
        self.X_WGoal = self.tip.CalcPoseInWorld(self.context)
        self.DeclareVectorInputPort("state", 2 * arm.dof)
        self.DeclareVectorOutputPort("torque", arm.dof, self.calc)

    def calc(self, context, output):
        state = self.get_input_port().Eval(context)
        self.arm.plant.SetPositionsAndVelocities(self.context, self.arm.instance, state)
        X_WTip = self.tip.CalcPoseInWorld(self.context)
        turn = (self.X_WGoal.rotation() @ X_WTip.rotation().inverse()).ToAngleAxis()
        shift = self.X_WGoal.translation() - X_WTip.translation()
        error = np.append(turn.angle() * turn.axis(), shift)
        jacobian = self.arm.jacobian(self.context, self.tip, np.zeros(3))
        velocity = jacobian @ self.arm.velocities(self.context)
        output.SetFromVector(jacobian.T @ (STIFFNESS * error - DAMPING * velocity))


builder = DiagramBuilder()
cell = add_cell(builder, CellConfig.load(), Product("nothing", {}))
arm, plant = cell.arms["left"], cell.plant
spring = builder.AddSystem(Spring(arm))
builder.Connect(plant.get_state_output_port(arm.instance), spring.get_input_port())
# With only torques connected, the arm's position drives are off.
cell.ports.connect(builder, spring.get_output_port(), "left.torque")
simulator = Simulator(builder.Build())
simulator.set_monitor(cell.monitor)
simulator.Initialize()
root = simulator.get_mutable_context()
context = plant.GetMyContextFromRoot(root)


def offset():
    """Return how far the tip is from its goal, along y of the world [m]."""
    p_WTip = spring.tip.CalcPoseInWorld(context).translation()
    return (p_WTip - spring.X_WGoal.translation())[1]


def blow(newton):
    """Push the hand along y, at its tip."""
    force = ExternallyAppliedSpatialForce()
    force.body_index = spring.tip.body().index()
    force.p_BoBq_B = spring.tip.GetFixedPoseInBodyFrame().translation()
    force.F_Bq_W = SpatialForce(np.zeros(3), [0.0, newton, 0.0])
    port = cell.ports.inputs["external_forces"]
    port.FixValue(port.get_system().GetMyMutableContextFromRoot(root), Value([force]))


simulator.AdvanceTo(0.2)
calm = offset()
blow(WIND)
simulator.AdvanceTo(3.0)
pushed = offset()
expected = WIND / STIFFNESS[3]
print(f"calm: {1e3 * calm:+.3f} mm")
print(f"{WIND:g} N: {1e3 * pushed:+.2f} mm, by Hooke's law {1e3 * expected:+.2f} mm")
assert abs(calm) < 1e-4 and abs(pushed - expected) < 0.05 * expected
