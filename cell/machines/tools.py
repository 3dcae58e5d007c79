"""The tools on the flanges: parallel-jaw gripper and electric screwdriver, as handles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import Context, DiagramBuilder

from cell.machines.arm import Drive
from cell.machines.grippers import HAND_E

JAW_STIFFNESS, JAW_DAMPING = HAND_E.stiffness, HAND_E.damping
# Speed loop of the spindle: at the seating speed of 7 rad/s it stalls at 0.7 N m, so that the bolt
# still turns when the clutch trips at 0.5 N m and friction is fully mobilised [A].
SPINDLE_GAIN = 0.1
# Floating bit holder: lateral and axial springs [N/m], as compliant screwdriving heads have [A].
FLOAT_JOINTS = ("float_x_joint", "float_y_joint", "float_z_joint")
FLOAT_STIFFNESS = (3e3, 3e3, 2e3)
FLOAT_DAMPING = (25.0, 25.0, 20.0)

JAW_SETBACK = HAND_E.setback


@dataclass(frozen=True)
class Gripper:
    """The parallel-jaw gripper: two coupled fingers with one force-limited drive."""

    plant: MultibodyPlant
    instance: ModelInstanceIndex
    finger: Joint
    drive: Drive

    def command(self, root: Context, opening: float, force: float) -> None:
        """Aim at an opening of the tip pads [m]; press with ``force`` per pad [N] there."""
        # The drive's force is shared by two fingers, hence the factor 2.
        q = np.array([opening / 2 - 2 * force / JAW_STIFFNESS])
        self.drive.set_target(root, q, np.zeros(1))

    def opening(self, plant_context: Context) -> float:
        """Return the distance between the tip pads [m]."""
        return 2 * float(self.finger.GetOnePosition(plant_context))

    def rate(self, plant_context: Context) -> float:
        """Return the rate of the opening [m/s]."""
        return 2 * float(self.finger.GetOneVelocity(plant_context))


@dataclass(frozen=True)
class Driver:
    """The electric screwdriver: a spindle with a speed drive, a clutch, a floating bit holder."""

    plant: MultibodyPlant
    instance: ModelInstanceIndex
    spindle: Joint
    float_z: Joint
    drive: Drive

    def command(self, root: Context, speed: float) -> None:
        """Turn the spindle about the tool's axis [rad/s].

        Clockwise seen from the driver is positive and tightens.
        """
        n = len(FLOAT_JOINTS) + 1
        v = np.zeros(n)
        v[-1] = speed
        self.drive.set_target(root, np.zeros(n), v)

    def torque(self, plant_context: Context) -> float:
        """Return the torque of the spindle motor [N m]."""
        port = self.plant.get_net_actuation_output_port(self.instance)
        return float(port.Eval(plant_context)[-1])

    def rate(self, plant_context: Context) -> float:
        """Return the spindle speed [rad/s]."""
        return float(self.spindle.GetOneVelocity(plant_context))

    def push(self, plant_context: Context) -> float:
        """Return the axial force of the bit holder's spring [N]."""
        return -FLOAT_STIFFNESS[2] * float(self.float_z.GetOnePosition(plant_context))


def set_gripper_gains(plant: MultibodyPlant, instance: ModelInstanceIndex) -> None:
    """Give the jaw its drive, before the plant is finalized."""
    finger = plant.GetJointActuatorByName("finger_left_joint", instance)
    finger.set_controller_gains(PdControllerGains(p=JAW_STIFFNESS, d=JAW_DAMPING))


def set_driver_gains(plant: MultibodyPlant, instance: ModelInstanceIndex) -> None:
    """Give spindle and bit holder their drives, before the plant is finalized."""
    for name, p, d in zip(FLOAT_JOINTS, FLOAT_STIFFNESS, FLOAT_DAMPING, strict=True):
        actuator = plant.GetJointActuatorByName(name, instance)
        actuator.set_controller_gains(PdControllerGains(p=p, d=d))
    spindle = plant.GetJointActuatorByName("spindle_joint", instance)
    spindle.set_controller_gains(PdControllerGains(p=0.0, d=SPINDLE_GAIN))


def connect_gripper(
    builder: DiagramBuilder, plant: MultibodyPlant, instance: ModelInstanceIndex, opening: float
) -> Gripper:
    """Connect the gripper's inputs (plant finalized); it starts at and holds ``opening`` [m]."""
    finger = plant.GetJointByName("finger_left_joint", instance)
    for joint in (finger, plant.GetJointByName("finger_right_joint", instance)):
        joint.set_default_translation(opening / 2)
    drive = Drive.connect(builder, plant, instance, np.array([opening / 2]))
    return Gripper(plant, instance, finger, drive)


def connect_driver(
    builder: DiagramBuilder, plant: MultibodyPlant, instance: ModelInstanceIndex
) -> Driver:
    """Connect the driver's inputs (plant finalized); it stands still."""
    spindle = plant.GetJointByName("spindle_joint", instance)
    float_z = plant.GetJointByName("float_z_joint", instance)
    drive = Drive.connect(builder, plant, instance, np.zeros(len(FLOAT_JOINTS) + 1))
    return Driver(plant, instance, spindle, float_z, drive)
