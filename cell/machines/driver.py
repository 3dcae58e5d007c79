"""The electric screwdriver: a spindle with a speed drive and a floating bit holder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, Joint, ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    LeafSystem,
)

from cell.machines.drive import JointDrive, NamedPorts

# Speed loop of the spindle: its speed falls by 10 rad/s per N m, as that of a DC motor does [A].
SPINDLE_GAIN = 0.1
# Floating bit holder: lateral and axial springs [N/m], as compliant screwdriving heads have [A].
FLOAT_JOINTS = ("float_x_joint", "float_y_joint", "float_z_joint")
FLOAT_STIFFNESS = (3e3, 3e3, 2e3)
FLOAT_DAMPING = (25.0, 25.0, 20.0)
N_JOINTS = len(FLOAT_JOINTS) + 1
# Speed of a bolt's circumference when its torque is reached [m/s], 2 rad/s for M3 [M]: with less,
# regularised friction under the head is not fully mobilised and the clamp force too high (by 9 % in
# place of 5 % at 1 rad/s); with more, the torque rises too far while the clutch trips.
TRIP_SPEED = 3e-3


def tightening_speed(torque: float, diameter: float) -> float:
    """Return the spindle speed to command [rad/s] so that a bolt still turns at its torque [D].

    Args:
        torque: Of the bolt [N m].
        diameter: Of its thread [m].
    """
    return TRIP_SPEED / (diameter / 2) + torque / SPINDLE_GAIN


def largest_torque(speed: float, diameter: float) -> float:
    """Return the torque [N m] up to which a commanded speed suffices: `tightening_speed` undone."""
    return SPINDLE_GAIN * (speed - TRIP_SPEED / (diameter / 2))


@dataclass(frozen=True)
class DriverReading:
    """What a screwdriver feels.

    Attributes:
        push: Axial force of the bit holder's spring [N].
        torque: Of the spindle motor [N m].
        speed: Of the spindle [rad/s].
    """

    push: float
    torque: float
    speed: float


class DriverDrive(JointDrive):
    """Turns the spindle. Input port, optional: ``speed`` [rad/s], positive tightens."""

    def __init__(self) -> None:
        super().__init__(np.zeros(N_JOINTS))
        self._speed_in = self.DeclareVectorInputPort("speed", 1)

    def desired(self, context: Context) -> np.ndarray:
        """Return the desired state (8,) of bit holder and spindle."""
        if not self._speed_in.HasValue(context):
            return super().desired(context)
        return np.append(np.zeros(2 * N_JOINTS - 1), self._speed_in.Eval(context)[0])

    def commanded_speed(self, root: Context) -> float:
        """Return the speed that the spindle is told to turn at [rad/s]."""
        return float(self.desired(self.GetMyContextFromRoot(root))[-1])


class DriverSensor(LeafSystem):
    """Output ports ``torque`` [N m] of the spindle motor and ``push`` [N] of the bit holder."""

    def __init__(self, driver: Driver) -> None:
        super().__init__()
        plant, self._push_at = driver.plant, driver.float_z.position_start()
        self._state = self.DeclareVectorInputPort("state", plant.num_multibody_states())
        self._actuation = self.DeclareVectorInputPort("actuation", N_JOINTS)
        self.DeclareVectorOutputPort("torque", 1, self._calc_torque)
        self.DeclareVectorOutputPort("push", 1, self._calc_push)

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        output[0] = self._actuation.Eval(context)[-1]

    def _calc_push(self, context: Context, output: BasicVector) -> None:
        output[0] = -FLOAT_STIFFNESS[2] * self._state.Eval(context)[self._push_at]


@dataclass(frozen=True)
class Driver:
    """A screwdriver on an arm.

    Attributes:
        name: Of the device, for example "spindle".
        plant: The plant it lives in.
        instance: Its model instance.
        spindle: Joint that turns the bit.
        float_z: Axial joint of the bit holder.
        drive: Its drive.
    """

    role = "driver"

    name: str
    plant: MultibodyPlant
    instance: ModelInstanceIndex
    spindle: Joint
    float_z: Joint
    drive: DriverDrive

    @staticmethod
    def add(
        plant: MultibodyPlant, instance: ModelInstanceIndex, name: str, drive: DriverDrive
    ) -> Driver:
        """Give spindle and bit holder of a model their drives, before the plant is finalized."""
        for joint, p, d in zip(FLOAT_JOINTS, FLOAT_STIFFNESS, FLOAT_DAMPING, strict=True):
            actuator = plant.GetJointActuatorByName(joint, instance)
            actuator.set_controller_gains(PdControllerGains(p=p, d=d))
        actuator = plant.GetJointActuatorByName("spindle_joint", instance)
        actuator.set_controller_gains(PdControllerGains(p=0.0, d=SPINDLE_GAIN))
        spindle = plant.GetJointByName("spindle_joint", instance)
        float_z = plant.GetJointByName("float_z_joint", instance)
        return Driver(name, plant, instance, spindle, float_z, drive)

    def connect(self, builder: DiagramBuilder, prefix: str) -> NamedPorts:
        """Connect to the finalized plant; return inputs and outputs by name."""
        self.drive.connect(builder, self.plant, self.instance)
        sensor = builder.AddNamedSystem(f"{prefix}{self.name}_sensor", DriverSensor(self))
        builder.Connect(self.plant.get_state_output_port(), sensor.GetInputPort("state"))
        actuation = self.plant.get_net_actuation_output_port(self.instance)
        builder.Connect(actuation, sensor.GetInputPort("actuation"))
        outputs = {name: sensor.GetOutputPort(name) for name in ("torque", "push")}
        return {"speed": self.drive.GetInputPort("speed")}, outputs

    @property
    def bit_frame(self) -> Frame:
        """Frame E at the bit's end face, +z out of the tool."""
        return self.plant.GetFrameByName("bit_tip", self.instance)

    def command(self, root: Context, speed: float) -> None:
        """Turn the spindle about the tool's axis [rad/s].

        Clockwise seen from the driver is positive and tightens.
        """
        self.drive.set_target(root, np.zeros(N_JOINTS), np.append(np.zeros(N_JOINTS - 1), speed))

    def push(self, plant_context: Context) -> float:
        """Return the axial force of the bit holder's spring [N]."""
        return -FLOAT_STIFFNESS[2] * float(self.float_z.GetOnePosition(plant_context))

    def read(self, plant_context: Context) -> DriverReading:
        """Return push, torque and speed."""
        port = self.plant.get_net_actuation_output_port(self.instance)
        torque = float(port.Eval(plant_context)[-1])
        speed = float(self.spindle.GetOneVelocity(plant_context))
        return DriverReading(self.push(plant_context), torque, speed)
