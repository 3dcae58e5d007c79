"""An arm as its user sees it: joints, tool, position drive and torque drive.

Each joint has the position drive of an industrial arm, a stiff PD loop that the contact solver
integrates implicitly (stable at any gain). For compliant motion the drive is switched to torque:
the PD gains drop to a small damping and the joint follows the commanded torque. Gravity of the arm
and its tool is taken to be compensated exactly, as the controllers of such arms do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    Frame,
    JacobianWrtVariable,
    JointActuator,
    ModelInstanceIndex,
    PdControllerGains,
    RevoluteJoint,
    WeldJoint,
)
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from cell.configuration.config import ArmConfig
from cell.machines.arms import ArmModel
from cell.machines.arms.ur import UR5E
from cell.paths import model_url, new_parser

# Joint friction that stays when the position drive is off [N m s/rad]; [A], below 1 % of a
# UR5e wrist joint's torque at working speed.
TORQUE_MODE_DAMPING = 0.3


def constant_source(builder: DiagramBuilder, name: str, value: np.ndarray) -> ConstantVectorSource:
    """Add a source whose value lives in the Context, so that a save of the Context holds it."""
    return builder.AddNamedSystem(name, ConstantVectorSource(value))


@dataclass(frozen=True)
class Drive:
    """The inputs of one model instance: desired state [q; v] and feed-forward effort."""

    plant: MultibodyPlant
    instance: ModelInstanceIndex
    target: ConstantVectorSource
    effort: ConstantVectorSource

    @staticmethod
    def connect(
        builder: DiagramBuilder,
        plant: MultibodyPlant,
        instance: ModelInstanceIndex,
        q_home: np.ndarray,
    ) -> Drive:
        """Connect both inputs to sources that hold ``q_home`` (n,) until told otherwise."""
        name = plant.GetModelInstanceName(instance)
        state = np.concatenate([q_home, np.zeros_like(q_home)])
        target = constant_source(builder, f"{name}_target", state)
        effort = constant_source(builder, f"{name}_effort", np.zeros_like(q_home))
        builder.Connect(target.get_output_port(), plant.get_desired_state_input_port(instance))
        builder.Connect(effort.get_output_port(), plant.get_actuation_input_port(instance))
        return Drive(plant, instance, target, effort)

    def set_target(self, root: Context, q: np.ndarray, v: np.ndarray) -> None:
        """Command the desired positions and velocities of the actuated joints."""
        context = self.target.GetMyMutableContextFromRoot(root)
        self.target.get_mutable_source_value(context).SetFromVector(np.concatenate([q, v]))

    def set_effort(self, root: Context, effort: np.ndarray) -> None:
        """Command the feed-forward effort of the actuated joints."""
        context = self.effort.GetMyMutableContextFromRoot(root)
        self.effort.get_mutable_source_value(context).SetFromVector(effort)

    def values(self, root: Context) -> tuple[np.ndarray, np.ndarray]:
        """Return the commanded state and effort."""
        target = self.target.get_source_value(self.target.GetMyContextFromRoot(root))
        effort = self.effort.get_source_value(self.effort.GetMyContextFromRoot(root))
        return target.get_value().copy(), effort.get_value().copy()


@dataclass(frozen=True)
class Arm:
    """An arm with a tool on its flange.

    Attributes:
        name: "left" or "right".
        plant: The plant it lives in.
        instance: Model instance of the arm (without tool).
        tool: Model instance of the tool.
        joints: From base to flange.
        actuators: In the order of ``joints``.
        wrist: The weld between flange and tool: where the wrist wrench is read.
        config: Gains and home configuration.
        model: Its type: kinematics and limits.
    """

    name: str
    plant: MultibodyPlant
    instance: ModelInstanceIndex
    tool: ModelInstanceIndex
    joints: tuple[RevoluteJoint, ...]
    actuators: tuple[JointActuator, ...]
    wrist: WeldJoint
    config: ArmConfig
    model: ArmModel

    @property
    def tool_instance(self) -> ModelInstanceIndex:
        """Model instance of the tool."""
        return self.tool

    @property
    def dof(self) -> int:
        """Number of joints."""
        return self.model.dof

    @property
    def home(self) -> np.ndarray:
        """Home configuration (dof,) [rad]."""
        return np.deg2rad(self.config.home_deg)

    @property
    def effort_limits(self) -> np.ndarray:
        """Torque limits (dof,) [N m]."""
        return np.array([actuator.effort_limit() for actuator in self.actuators])

    def frame(self, name: str) -> Frame:
        """Return a frame of the tool, for example "tip" or "bit_tip"."""
        return self.plant.GetFrameByName(name, self.tool)

    def positions(self, plant_context: Context) -> np.ndarray:
        """Return the joint angles (dof,) [rad]."""
        return self.plant.GetPositions(plant_context, self.instance)

    def velocities(self, plant_context: Context) -> np.ndarray:
        """Return the joint rates (dof,) [rad/s]."""
        return self.plant.GetVelocities(plant_context, self.instance)

    def jacobian(self, plant_context: Context, frame: Frame, p_FoC: np.ndarray) -> np.ndarray:
        """Return J (6, dof) with V_WC = J v, for the point C of F; angular rows first, in W."""
        world = self.plant.world_frame()
        jacobian = self.plant.CalcJacobianSpatialVelocity(
            plant_context, JacobianWrtVariable.kV, frame, p_FoC, world, world
        )
        start = self.joints[0].velocity_start()
        return jacobian[:, start : start + self.dof]

    def use_position_drive(self) -> None:
        """Follow the commanded joint state stiffly."""
        for actuator, p, d in zip(
            self.actuators, self.config.stiffness, self.config.damping, strict=True
        ):
            actuator.set_controller_gains(PdControllerGains(p=p, d=d))

    def use_torque_drive(self) -> None:
        """Follow the commanded joint torque; the desired state is ignored but for damping."""
        for actuator in self.actuators:
            actuator.set_controller_gains(PdControllerGains(p=0.0, d=TORQUE_MODE_DAMPING))

    def in_torque_drive(self) -> bool:
        """Return whether the torque drive is on."""
        return self.actuators[0].get_controller_gains().p == 0.0


def add_arm(
    plant: MultibodyPlant,
    name: str,
    tool_model: str,
    config: ArmConfig,
    model: ArmModel = UR5E,
) -> Arm:
    """Add an arm with a tool to the plant, before it is finalized.

    Args:
        plant: Not finalized yet.
        name: "left" or "right"; the instances become ``<name>_arm`` and ``<name>_tool``.
        tool_model: Name of the SDF model of the tool; its frame ``mount`` meets the flange.
        config: Pose of the base, gains and home configuration.
        model: Type of the arm.
    """
    parser = new_parser(plant)
    (instance,) = parser.AddModelsFromUrl(model_url(model.sdf))
    (tool,) = parser.AddModelsFromUrl(model_url(tool_model))
    plant.RenameModelInstance(instance, f"{name}_arm")
    plant.RenameModelInstance(tool, f"{name}_tool")
    X_WB: RigidTransform = config.X_WB
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(model.base_frame, instance), X_WB)
    wrist = plant.WeldFrames(
        plant.GetFrameByName(model.flange_frame, instance), plant.GetFrameByName("mount", tool)
    )
    plant.set_gravity_enabled(instance, False)
    plant.set_gravity_enabled(tool, False)
    joints = tuple(plant.GetJointByName(joint, instance) for joint in model.joints)
    actuators = tuple(plant.GetJointActuatorByName(joint, instance) for joint in model.joints)
    arm = Arm(name, plant, instance, tool, joints, actuators, wrist, config, model)
    arm.use_position_drive()
    for joint, angle in zip(joints, arm.home, strict=True):
        joint.set_default_angle(angle)
    return arm
