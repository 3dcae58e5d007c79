"""The rig of the element tests: one part on a driven vertical carriage over a fixed soft jig.

The part is lowered to a depth, the bag is jammed, the carriage lets go, and a stiff spring drags
the part sideways or up at constant speed. Force and displacement are recorded.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import (
    PdControllerGains,
    PrismaticJoint,
    SpatialInertia,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder

from cell.errors import RunFailure
from cell.fixtures.soft_jig import JigParameters, SoftJig
from cell.fixtures.wiring import wire_fixture
from cell.forces import applied_force
from cell.monitor import Monitor, StepCounter
from experiments.jig.specimens import Prism, Specimen

Array = NDArray[np.float64]

# The spring between the target of the drag and the part [N/m], and its damper [N s/m]: stiff
# against the 10 to 100 N/mm of the bed, soft enough for an explicit force at 1 ms on 0.2 kg.
DRAG_STIFFNESS = 2.0e4
DRAG_DAMPING = 40.0


@dataclass(frozen=True)
class Drag:
    """The record of a drag, per step (n,).

    Attributes:
        way: Displacement of the dragged point along the direction [m].
        force: Of the spring [N].
        tilt: Rotation of the part since the start [rad].
    """

    way: Array
    force: Array
    tilt: Array

    @property
    def holding_force(self) -> float:
        """Largest force after the part has moved by 0.05 mm, median over 5 steps [N].

        Raises:
            RunFailure: The part did not move: the spring is too soft.
        """
        moved = np.flatnonzero(self.way > 0.05e-3)
        if len(moved) == 0 or len(self.force) - moved[0] < 5:
            raise RunFailure(f"The part did not move under {self.force.max():.3g} N.")
        moving = self.force[moved[0] :]
        smooth = np.median(np.lib.stride_tricks.sliding_window_view(moving, 5), axis=1)
        return float(smooth.max())


@dataclass
class ElementRig:
    """The diagram and its simulator; all poses in J, which coincides with W.

    Attributes:
        params: Of the jig.
        part: The specimen.
        press_force: Limit of the carriage's drive [N].
        time_step: [s].
        approximation: Discrete contact approximation of Drake.
    """

    params: JigParameters = field(default_factory=JigParameters)
    part: Specimen = field(default_factory=Prism)
    press_force: float = 500.0
    time_step: float = 1e-3
    approximation: str = "lagged"

    def __post_init__(self) -> None:
        builder = DiagramBuilder()
        counter = builder.AddNamedSystem("steps", StepCounter(self.time_step))
        config = MultibodyPlantConfig(
            time_step=self.time_step,
            contact_model="hydroelastic_with_fallback",
            discrete_contact_approximation=self.approximation,
        )
        self.plant, self.scene_graph = AddMultibodyPlant(config, builder)
        base = self.plant.AddRigidBody("base", SpatialInertia.SolidBoxWithMass(1.5, 0.2, 0.2, 0.02))
        self.plant.WeldFrames(self.plant.world_frame(), base.body_frame())
        self.jig = SoftJig(self.plant, self.scene_graph, base, self.params)
        self.body = self.part.add_to(self.plant)
        self._X_CP = self.part.X_CP
        self._add_carriage()
        self.plant.Finalize()
        self._forces = wire_fixture(builder, self.plant, self.scene_graph, self.jig, [base]).forces
        self.simulator = Simulator(builder.Build())
        self.simulator.set_monitor(Monitor(counter, self.jig.install, [self.jig]))
        self.root = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)
        self.jig.receive(self.root, self.body, self.part.mesh())
        self._steps = 0
        self._height = self.params.bag.cap_height + 0.5e-3
        self._set_height(self._height, 0.0)
        X_JP = self.X_JC(self._height) @ self._X_CP
        self.plant.SetFreeBodyPose(self.context, self.body, X_JP)
        self._slide.set_translation(self.context, self._height)
        self.simulator.Initialize()

    @staticmethod
    def X_JC(height: float) -> RigidTransform:
        """Return the pose of the carriage at a height [m]."""
        return RigidTransform([0.0, 0.0, height])

    def _add_carriage(self) -> None:
        instance = self.plant.AddModelInstance("carriage")
        inertia = SpatialInertia.SolidBoxWithMass(5.0, 0.1, 0.1, 0.1)
        carriage = self.plant.AddRigidBody("carriage", instance, inertia)
        self._slide = self.plant.AddJoint(
            PrismaticJoint(
                "slide", self.plant.world_frame(), carriage.body_frame(), [0.0, 0.0, 1.0]
            )
        )
        actuator = self.plant.AddJointActuator("slide", self._slide, self.press_force)
        actuator.set_controller_gains(PdControllerGains(p=1e6, d=1e4))
        self.plant.set_gravity_enabled(instance, False)
        self._carriage = instance
        self._grip = self.plant.AddWeldConstraint(
            carriage, RigidTransform(), self.body, self._X_CP.inverse()
        )

    # Motion.

    def _set_height(self, height: float, speed: float) -> None:
        self._height = height
        port = self.plant.get_desired_state_input_port(self._carriage)
        port.FixValue(self.context, [height, speed])

    def step(self, count: int = 1) -> None:
        """Advance by some steps."""
        for _ in range(count):
            self._steps += 1
            self.simulator.AdvanceTo(self._steps * self.time_step)

    def lower_to(self, depth: float, speed: float = 0.02) -> Array:
        """Press the part to a depth below the apex [m]; return depth [m] and force [N] (n, 2)."""
        goal, curve = self.params.bag.cap_height - depth, []
        while self._height > goal:
            self._set_height(max(self._height - speed * self.time_step, goal), -speed)
            self.step()
            curve.append((self.depth, self.bed_force))
        self._set_height(goal, 0.0)
        self.step(round(0.1 / self.time_step))
        return np.array(curve)

    def saved(self) -> Context:
        """Return a copy of the state."""
        return self.root.Clone()

    def restore(self, saved: Context) -> None:
        """Go back to a state that `saved` has returned."""
        self.root.SetTimeStateAndParametersFrom(saved)
        self._steps = round(saved.get_time() / self.time_step)
        self.simulator.Initialize()

    @property
    def bed_force(self) -> float:
        """Upward force of the soft bed on the part [N]."""
        forces = self.jig.memory(self.root).forces
        return float(forces[0].F_Bq_W.translational()[2]) if forces else 0.0

    def jam(self, wait: float = 0.5) -> None:
        """Evacuate until the bed is frozen, stop the carriage where it is, and wait [s]."""
        self.jig.evacuate(self.root)
        while not self.jig.fixed(self.root):
            self.step()
        self._set_height(self.params.bag.cap_height - self.depth, 0.0)
        self.step(round(wait / self.time_step))

    def let_go(self, wait: float = 0.5) -> None:
        """Open the grip of the carriage, which nothing touches, and wait [s]."""
        self.plant.SetConstraintActiveStatus(self.context, self._grip, False)
        self.step(round(wait / self.time_step))

    def drag(self, p_PQ: Array, direction: Array, way: float = 0.006, speed: float = 0.01) -> Drag:
        """Drag a point of the part along a straight line, at constant speed of the target.

        Args:
            p_PQ: (3,) the point, in P [m].
            direction: (3,) unit vector in J.
            way: Of the target [m].
            speed: Of the target [m/s].
        """
        p_JQ0, R_JP0 = self.X_JP @ p_PQ, self.X_JP.rotation()
        rows = []
        while (target := speed * self.time_step * len(rows)) < way:
            moved = float(direction @ (self.X_JP @ p_PQ - p_JQ0))
            V_WP = self.plant.EvalBodySpatialVelocityInWorld(self.context, self.body)
            V_WQ = V_WP.Shift(self.X_JP.rotation() @ p_PQ)
            rate = float(direction @ V_WQ.translational())
            force = DRAG_STIFFNESS * (target - moved) + DRAG_DAMPING * (speed - rate)
            self.pull(p_PQ, max(force, 0.0) * direction)
            self.step()
            turn = (R_JP0.inverse() @ self.X_JP.rotation()).ToAngleAxis().angle()
            rows.append((moved, max(force, 0.0), turn))
        self._forces.fix(self.root, "external", [])
        return Drag(*np.array(rows).T)

    def pull(self, p_PQ: Array, force: Array) -> None:
        """Let a force (3,) [N] in J act at a point (3,) of the part, in P, until the next one."""
        pull = SpatialForce(np.zeros(3), force)
        self._forces.fix(self.root, "external", [applied_force(self.body.index(), p_PQ, pull)])

    @property
    def speed(self) -> float:
        """Speed of the part's origin [m/s]."""
        V_WP = self.plant.EvalBodySpatialVelocityInWorld(self.context, self.body)
        return float(np.linalg.norm(V_WP.translational()))

    @property
    def X_JP(self) -> RigidTransform:
        """Pose of the part."""
        return self.plant.EvalBodyPoseInWorld(self.context, self.body)

    @property
    def depth(self) -> float:
        """Depth of the part's lowest point below the apex of the inflated bag [m]."""
        low = (self.X_JP @ self._X_CP.inverse()).translation()[2]
        return self.params.bag.cap_height - float(low)
