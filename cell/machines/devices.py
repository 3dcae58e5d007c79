"""The devices that a configuration names: arms by model, each with a tool by model.

A device is its SDF, a drive, readings and limits. To add an arm or a gripper, describe its model
in `cell.machines.arms` or `cell.machines.grippers`, or put it into their registry; for another kind
of tool, add a line to `OTHER_TOOLS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from cell.configuration.config import CellConfig
from cell.errors import UnknownName
from cell.machines.arm import Arm, Tool, add_arm, arm_drive
from cell.machines.arms import arm_model
from cell.machines.cameras.camera import add_hand_eye
from cell.machines.drive import ArmDrive, JointDrive
from cell.machines.driver import Driver, DriverDrive
from cell.machines.gripper import Gripper, GripperDrive
from cell.machines.grippers import GRIPPER_MODELS, GripperModel


@dataclass(frozen=True)
class ToolKind:
    """How a tool is added to an arm.

    Attributes:
        role: What it is for: "gripper" or "driver".
        sdf: Name of its model in models/sdf, or a URL.
        drive: Makes its drive.
        add: Makes its handle from plant, model instance, device name and drive.
    """

    role: str
    sdf: str
    drive: Callable[[], JointDrive]
    add: Callable[[MultibodyPlant, ModelInstanceIndex, str, JointDrive], Tool]


def _gripper(model: GripperModel) -> ToolKind:
    return ToolKind(
        Gripper.role,
        model.sdf,
        lambda: GripperDrive(model),
        lambda plant, instance, name, drive: Gripper.add(plant, instance, name, model, drive),
    )


# Tools that are no grippers, by name.
OTHER_TOOLS: dict[str, ToolKind] = {
    "screwdriver": ToolKind(Driver.role, "screwdriver", DriverDrive, Driver.add)
}


@dataclass(frozen=True)
class DeviceDrives:
    """The drives of one arm and its tool, made before the plant.

    Attributes:
        tool_name: Name of the tool as a device: "<arm>_gripper"; "spindle" for the only driver.
        arm, tool: Of the arm, of the tool.
    """

    tool_name: str
    arm: ArmDrive
    tool: JointDrive


def make_drives(config: CellConfig) -> dict[str, DeviceDrives]:
    """Return the drives of every arm that the configuration names, by the name of the arm.

    Raises:
        UnknownName: An arm model or a tool that does not exist.
        InputError: A setting with another number of joints than the arm has.
    """
    kinds = {name: tool_kind(arm.tool) for name, arm in config.arms.items()}
    drivers = [name for name, kind in kinds.items() if kind.role == Driver.role]
    drives = {}
    for name, arm in config.arms.items():
        kind, model = kinds[name], arm_model(arm.model)
        only_driver = drivers == [name]
        tool_name = "spindle" if only_driver else f"{name}_{kind.role}"
        drive = arm_drive(model, arm, kind.role, config.simulation.time_step)
        drives[name] = DeviceDrives(tool_name, drive, kind.drive())
    return drives


def tool_kind(name: str) -> ToolKind:
    """Return how the tool of a name is added."""
    if name in GRIPPER_MODELS:
        return _gripper(GRIPPER_MODELS[name])
    if name not in OTHER_TOOLS:
        raise UnknownName("tool", name, [*GRIPPER_MODELS, *OTHER_TOOLS])
    return OTHER_TOOLS[name]


def add_arms(
    plant: MultibodyPlant, config: CellConfig, drives: Mapping[str, DeviceDrives]
) -> dict[str, Arm]:
    """Add every arm with its tool to a plant that is not finalized yet; return them by name."""
    arms = {}
    for name, arm in config.arms.items():
        kind, own = tool_kind(arm.tool), drives[name]

        def add_tool(
            instance: ModelInstanceIndex, kind: ToolKind = kind, own: DeviceDrives = own
        ) -> Tool:
            return kind.add(plant, instance, own.tool_name, own.tool)

        arms[name] = add_arm(plant, name, arm_model(arm.model), arm, own.arm, kind.sdf, add_tool)
        if kind.role == Gripper.role and config.hand_eye:
            add_hand_eye(plant, arms[name], config.camera)
    return arms
