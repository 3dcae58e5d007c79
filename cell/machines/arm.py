"""An arm as its user sees it: joints, tool, position drive and torque drive.

Each joint has the position drive of an industrial arm, a stiff PD loop that the contact solver
integrates implicitly (stable at any gain). For compliant motion the drive is switched to torque:
the PD gains drop to a small damping and the joint follows the commanded torque. Gravity of the arm
and its tool is taken to be compensated exactly, as the controllers of such arms do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    Frame,
    JacobianWrtVariable,
    JointActuator,
    ModelInstanceIndex,
    RevoluteJoint,
)
from pydrake.systems.framework import Context, DiagramBuilder

from cell.configuration.config import ArmConfig
from cell.errors import InputError, RunFailure
from cell.machines.arms import ArmModel
from cell.machines.arms.base import LIMIT_MARGIN
from cell.machines.drive import ArmDrive, NamedPorts
from cell.machines.driver import Driver
from cell.machines.gripper import Gripper
from cell.machines.sensors import WrenchSensor
from cell.paths import model_url, new_parser

# Joint friction that stays when the position drive is off [N m s/rad]; [A], below 1 % of a
# UR5e wrist joint's torque at working speed.
TORQUE_MODE_DAMPING = 0.3

Tool = Gripper | Driver


class Unreachable(RunFailure):
    """A pose that no acceptable joint configuration reaches, with the reason."""

    def __init__(self, arm: str, frame: str, X_WT: RigidTransform, reason: str) -> None:
        place = ", ".join(f"{value:.3f}" for value in X_WT.translation())
        turn = ", ".join(f"{a:.0f}" for a in np.rad2deg(RollPitchYaw(X_WT.rotation()).vector()))
        super().__init__(
            f"The {arm} arm cannot bring frame '{frame}' to ({place}) m, "
            f"roll-pitch-yaw ({turn}) deg: {reason}."
        )


@dataclass(frozen=True)
class Arm:
    """An arm with a tool on its flange.

    Attributes:
        name: For example "left".
        plant: The plant it lives in.
        instance: Model instance of the arm (without tool).
        tool: What it carries.
        joints: From base to flange.
        actuators: In the order of ``joints``.
        wrist: Force-torque sensor between flange and tool.
        config: Where it stands, gains and home configuration.
        model: Its type: kinematics, limits.
        drive: What the joints are told.
    """

    name: str
    plant: MultibodyPlant
    instance: ModelInstanceIndex
    tool: Tool
    joints: tuple[RevoluteJoint, ...]
    actuators: tuple[JointActuator, ...]
    wrist: WrenchSensor
    config: ArmConfig
    model: ArmModel
    drive: ArmDrive

    @property
    def dof(self) -> int:
        """Number of joints."""
        return self.model.dof

    @property
    def home(self) -> np.ndarray:
        """Home configuration (n,) [rad]."""
        return home_of(self.model, self.config, self.tool.role)

    @property
    def effort_limits(self) -> np.ndarray:
        """Torque limits (n,) [N m]."""
        return np.array([actuator.effort_limit() for actuator in self.actuators])

    @property
    def tool_instance(self) -> ModelInstanceIndex:
        """Model instance of the tool."""
        return self.tool.instance

    def frame(self, name: str) -> Frame:
        """Return a frame of the tool, for example "tip" or "bit_tip"."""
        return self.plant.GetFrameByName(name, self.tool.instance)

    def positions(self, plant_context: Context) -> np.ndarray:
        """Return the joint angles (n,) [rad]."""
        return self.plant.GetPositions(plant_context, self.instance)

    def velocities(self, plant_context: Context) -> np.ndarray:
        """Return the joint rates (n,) [rad/s]."""
        return self.plant.GetVelocities(plant_context, self.instance)

    def jacobian(self, plant_context: Context, frame: Frame, p_FoC: np.ndarray) -> np.ndarray:
        """Return J (6, n) with V_WC = J v, for the point C of F; angular rows first, in W."""
        world = self.plant.world_frame()
        jacobian = self.plant.CalcJacobianSpatialVelocity(
            plant_context, JacobianWrtVariable.kV, frame, p_FoC, world, world
        )
        start = self.joints[0].velocity_start()
        return jacobian[:, start : start + self.dof]

    def connect(self, builder: DiagramBuilder, prefix: str) -> NamedPorts:
        """Connect arm, tool and wrist sensor to the finalized plant.

        Args:
            builder: Holds the drives already.
            prefix: Of the names of systems in the diagram.

        Returns:
            Inputs and outputs by name: "left.torque", "left_gripper.opening" ...
        """
        self.drive.connect(builder, self.plant, self.instance)
        wrench = self.wrist.connect(builder, f"{prefix}{self.name}_wrist")
        inputs, outputs = self.tool.connect(builder, prefix)
        inputs = {f"{self.tool.name}.{name}": port for name, port in inputs.items()}
        outputs = {f"{self.tool.name}.{name}": port for name, port in outputs.items()}
        for name in ("desired_state", "torque"):
            inputs[f"{self.name}.{name}"] = self.drive.GetInputPort(name)
        return inputs, outputs | {f"{self.name}.wrench": wrench}

    # Kinematics. The joints of the tool count as they are in the plant's context.

    @property
    def joint_limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper joint limits (n,) [rad] with `LIMIT_MARGIN` taken off."""
        lower = np.array([joint.position_lower_limits()[0] for joint in self.joints])
        upper = np.array([joint.position_upper_limits()[0] for joint in self.joints])
        return lower + LIMIT_MARGIN, upper - LIMIT_MARGIN

    def tool_pose(self, plant_context: Context, frame: Frame, q: np.ndarray) -> RigidTransform:
        """Return X_WT of a frame of the tool with the arm at ``q`` (n,) [rad]."""
        X_WB, X_FT = self._ends(plant_context, frame)
        return X_WB @ self.model.flange_pose(q) @ X_FT

    def configurations(
        self, plant_context: Context, frame: Frame, X_WT: RigidTransform, near: np.ndarray
    ) -> list[np.ndarray]:
        """Return the joint angles (n,) that put a tool frame at a pose, nearest to ``near`` first.

        Every joint whose range allows it is turned by full circles to be as close to ``near`` as
        its limits allow; solutions that cannot keep `LIMIT_MARGIN` from the limits are left out.

        Args:
            plant_context: Of the plant.
            frame: Any frame T fixed to the flange or to the tool.
            X_WT: Where it shall be.
            near: (n,) joint angles [rad].
        """
        X_WB, X_FT = self._ends(plant_context, frame)
        X_BF = X_WB.inverse() @ X_WT @ X_FT.inverse()
        turned = [self._nearest_turn(q, near) for q in self.model.inverse(X_BF, near)]
        inside = [q for q in turned if q is not None]
        return sorted(inside, key=lambda q: float(np.linalg.norm(q - near)))

    def reach(
        self, plant_context: Context, frame: Frame, X_WT: RigidTransform, near: np.ndarray
    ) -> np.ndarray:
        """Return the first of the `configurations` (n,), whatever is in the way.

        Raises:
            Unreachable: There is none.
        """
        for q in self.configurations(plant_context, frame, X_WT, near):
            return q
        raise Unreachable(self.name, frame.name(), X_WT, "out of reach or beyond the joint limits")

    def _ends(self, context: Context, frame: Frame) -> tuple[RigidTransform, RigidTransform]:
        """Return X_WB of the base and X_FT of a tool frame on the flange."""
        base = self.plant.GetFrameByName(self.model.base_frame, self.instance)
        flange = self.plant.GetFrameByName(self.model.flange_frame, self.instance)
        return base.CalcPoseInWorld(context), frame.CalcPose(context, flange)

    def _nearest_turn(self, q: np.ndarray, near: np.ndarray) -> np.ndarray | None:
        """Return q plus full turns: as near as the limits allow, or None where they do not."""
        lower, upper = self.joint_limits
        candidates = q + 2 * np.pi * np.array([-2, -1, 0, 1, 2])[:, None]
        allowed = (candidates >= lower) & (candidates <= upper)
        if not allowed.any(axis=0).all():
            return None
        distance = np.where(allowed, abs(candidates - near), np.inf)
        return candidates[distance.argmin(axis=0), np.arange(len(q))]

    # Commands.

    def hold_here(self, root: Context) -> None:
        """Switch to the position drive, with the target where the arm is."""
        n = self.dof
        self.drive.use_torque(root, False)
        self.drive.set_effort(root, np.zeros(n))
        q = self.positions(self.plant.GetMyContextFromRoot(root))
        self.drive.set_target(root, q, np.zeros(n))


def home_of(model: ArmModel, config: ArmConfig, role: str) -> np.ndarray:
    """Return the joint angles (n,) in which an arm with a tool of a role waits [rad]."""
    own = (config.home_pan_deg, *model.home_deg[role][1:])
    return np.deg2rad(_per_joint(model, "home_deg", config.home_deg, own))


def _per_joint(
    model: ArmModel, key: str, given: Sequence[float], own: Sequence[float]
) -> Sequence[float]:
    """Return what the configuration gives per joint, or else the model's own.

    Raises:
        InputError: Another number of joints.
    """
    if given and len(given) != model.dof:
        raise InputError(
            f"'{key}' of an arm has {len(given)} numbers; arm model '{model.name}' has "
            f"{model.dof} joints. Leave it empty for the model's own."
        )
    return given or own


def arm_drive(model: ArmModel, config: ArmConfig, role: str, time_step: float) -> ArmDrive:
    """Return the drive of an arm, which goes into the diagram before the plant.

    Args:
        model: Type of the arm.
        config: Of the arm.
        role: Of its tool: "gripper" or "driver".
        time_step: Of the plant [s].
    """
    stiffness = _per_joint(model, "stiffness", config.stiffness, model.stiffness)
    damping = _per_joint(model, "damping", config.damping, model.damping)
    gains = list(zip(stiffness, damping, strict=True))
    return ArmDrive(home_of(model, config, role), gains, TORQUE_MODE_DAMPING, time_step)


def add_arm(
    plant: MultibodyPlant,
    name: str,
    model: ArmModel,
    config: ArmConfig,
    drive: ArmDrive,
    tool_model: str,
    add_tool: Callable[[ModelInstanceIndex], Tool],
) -> Arm:
    """Add an arm with a tool to the plant, before it is finalized.

    Args:
        plant: Not finalized yet.
        name: For example "left"; the instances become ``<name>_arm`` and ``<name>_tool``.
        model: Type of the arm.
        config: Pose of the base, gains and home configuration.
        drive: From `arm_drive`.
        tool_model: Name of the SDF model of the tool; its frame ``mount`` meets the flange.
        add_tool: Makes the handle of the tool from its model instance.

    Raises:
        InputError: It would wait beyond the range of a joint, which would throw it back.
    """
    parser = new_parser(plant)
    (instance,) = parser.AddModelsFromUrl(model_url(model.sdf))
    (tool,) = parser.AddModelsFromUrl(model_url(tool_model))
    plant.RenameModelInstance(instance, f"{name}_arm")
    plant.RenameModelInstance(tool, f"{name}_tool")
    base = plant.GetFrameByName(model.base_frame, instance)
    plant.WeldFrames(plant.world_frame(), base, config.X_WB)
    wrist = plant.WeldFrames(
        plant.GetFrameByName(model.flange_frame, instance), plant.GetFrameByName("mount", tool)
    )
    plant.set_gravity_enabled(instance, False)
    plant.set_gravity_enabled(tool, False)
    joints = tuple(plant.GetJointByName(joint, instance) for joint in model.joints)
    actuators = tuple(plant.GetJointActuatorByName(joint, instance) for joint in model.joints)
    drive.drive(actuators)
    arm = Arm(
        name=name,
        plant=plant,
        instance=instance,
        tool=add_tool(tool),
        joints=joints,
        actuators=actuators,
        wrist=WrenchSensor(plant, wrist),
        config=config,
        model=model,
        drive=drive,
    )
    for joint, angle in zip(joints, arm.home, strict=True):
        low, high = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
        if not low <= angle <= high:
            low, high, angle = np.rad2deg([low, high, angle]).round(1)
            raise InputError(
                f"Arm '{name}' cannot wait with {joint.name()} at {angle:g} deg: arm model "
                f"'{model.name}' reaches from {low:g} to {high:g} deg "
                f"(arms.{name}.home_deg, arms.{name}.home_pan_deg)."
            )
        joint.set_default_angle(angle)
    return arm
