"""The parallel-jaw gripper: two coupled fingers with one force-limited drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    LeafSystem,
)

from cell.machines.drive import JointDrive, NamedPorts
from cell.machines.grippers import GripperModel

FINGER_JOINTS = ("finger_left_joint", "finger_right_joint")
# The jaws wait this far open [m]: wide enough for the motor, narrow enough to see that they move.
JAW_REST = 0.045


@dataclass(frozen=True)
class GripperReading:
    """What a gripper feels.

    Attributes:
        opening: Distance between the tip pads [m].
        rate: Its rate [m/s].
    """

    opening: float
    rate: float


class GripperDrive(JointDrive):
    """Drives the jaws to an opening, and presses with a force on what is in between.

    Input ports, optional: ``opening`` [m] of the tip pads, and with it ``force`` [N] per pad; a
    force alone says nothing.
    """

    def __init__(self, model: GripperModel) -> None:
        super().__init__(np.array([JAW_REST / 2]))
        self._model = model
        self._opening_in = self.DeclareVectorInputPort("opening", 1)
        self._force_in = self.DeclareVectorInputPort("force", 1)

    def desired(self, context: Context) -> np.ndarray:
        """Return the desired state (2,) of the driven finger."""
        if not self._opening_in.HasValue(context):
            return super().desired(context)
        force = self._force_in.Eval(context)[0] if self._force_in.HasValue(context) else 0.0
        return np.append(self.finger_target(float(self._opening_in.Eval(context)[0]), force), 0.0)

    def finger_target(self, opening: float, force: float) -> np.ndarray:
        """Return the target (1,) of the driven finger for an opening [m] and a force per pad [N].

        The drive's force is shared by two fingers, hence the factor 2.
        """
        return np.array([opening / 2 - 2 * force / self._model.stiffness])


class OpeningSensor(LeafSystem):
    """Output port ``opening`` [m] of the tip pads, from the state of the plant."""

    def __init__(self, plant: MultibodyPlant, finger: Joint) -> None:
        super().__init__()
        self._position = finger.position_start()
        self._state = self.DeclareVectorInputPort("state", plant.num_multibody_states())
        self.DeclareVectorOutputPort("opening", 1, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        output[0] = 2 * self._state.Eval(context)[self._position]


@dataclass(frozen=True)
class Gripper:
    """A gripper on an arm.

    Attributes:
        name: Of the device, for example "left_gripper".
        model: Its type: stroke, jaws.
        plant: The plant it lives in.
        instance: Its model instance.
        finger: The driven joint.
        drive: Its drive.
    """

    role = "gripper"

    name: str
    model: GripperModel
    plant: MultibodyPlant
    instance: ModelInstanceIndex
    finger: Joint
    drive: GripperDrive

    @staticmethod
    def add(
        plant: MultibodyPlant,
        instance: ModelInstanceIndex,
        name: str,
        model: GripperModel,
        drive: GripperDrive,
    ) -> Gripper:
        """Give the jaws of a model their drive, before the plant is finalized."""
        left, right = (plant.GetJointByName(joint, instance) for joint in FINGER_JOINTS)
        actuator = plant.GetJointActuatorByName(FINGER_JOINTS[0], instance)
        actuator.set_controller_gains(PdControllerGains(p=model.stiffness, d=model.damping))
        for joint in (left, right):
            joint.set_default_translation(JAW_REST / 2)
        return Gripper(name, model, plant, instance, left, drive)

    def connect(self, builder: DiagramBuilder, prefix: str) -> NamedPorts:
        """Connect to the finalized plant; return inputs and outputs by name."""
        self.drive.connect(builder, self.plant, self.instance)
        sensor = builder.AddNamedSystem(
            f"{prefix}{self.name}_sensor", OpeningSensor(self.plant, self.finger)
        )
        builder.Connect(self.plant.get_state_output_port(), sensor.get_input_port())
        inputs = {name: self.drive.GetInputPort(name) for name in ("opening", "force")}
        return inputs, {"opening": sensor.get_output_port()}

    def command(self, root: Context, opening: float, force: float) -> None:
        """Aim at an opening of the tip pads [m]; press with ``force`` per pad [N] there."""
        self.drive.set_target(root, self.drive.finger_target(opening, force), np.zeros(1))

    def read(self, plant_context: Context) -> GripperReading:
        """Return opening and rate."""
        position = float(self.finger.GetOnePosition(plant_context))
        return GripperReading(2 * position, 2 * float(self.finger.GetOneVelocity(plant_context)))
