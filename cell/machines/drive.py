"""Drives: what the joints of a device are told to do, held in the Context until told otherwise.

Each device has one drive, a system of the diagram between whoever commands it and the plant's two
input ports of its model instance. A command comes from code, through `set_target` and
`set_effort`, or through an input port of the drive that a caller has connected or fixed; the port
wins. With nothing connected the device holds its latest target.

Drives are added to the builder before the plant: their updates then run before the plant's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointActuator, ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    InputPort,
    LeafSystem,
    OutputPort,
)

from cell.errors import InputError

NamedPorts = tuple[dict[str, InputPort], dict[str, OutputPort]]  # Inputs and outputs by name.


class JointDrive(LeafSystem):
    """Holds desired joint positions, velocities and efforts of one device.

    Output ports ``desired_state`` (2n) and ``actuation`` (n), for the plant.

    Args:
        q_home: (n,) positions to hold at first.
    """

    def __init__(self, q_home: np.ndarray) -> None:
        super().__init__()
        self.size = n = len(q_home)
        self._target = self.DeclareDiscreteState(np.concatenate([q_home, np.zeros(n)]))
        self._effort = self.DeclareDiscreteState(np.zeros(n))
        told = {self.discrete_state_ticket(self._target), self.all_input_ports_ticket()}
        self.DeclareVectorOutputPort("desired_state", 2 * n, self._calc_desired, told)
        told = {self.discrete_state_ticket(self._effort), self.all_input_ports_ticket()}
        self.DeclareVectorOutputPort("actuation", n, self._calc_actuation, told)

    def connect(
        self, builder: DiagramBuilder, plant: MultibodyPlant, instance: ModelInstanceIndex
    ) -> None:
        """Connect to the inputs of a model instance of the finalized plant."""
        desired, actuation = self.GetOutputPort("desired_state"), self.GetOutputPort("actuation")
        builder.Connect(desired, plant.get_desired_state_input_port(instance))
        builder.Connect(actuation, plant.get_actuation_input_port(instance))

    def set_target(self, root: Context, q: np.ndarray, v: np.ndarray) -> None:
        """Command desired positions and velocities (n,) of the joints.

        Raises:
            InputError: Another number of them.
        """
        if len(q) != self.size or len(v) != self.size:
            raise InputError(
                f"'{self.get_name()}' takes {self.size} positions and as many velocities, "
                f"not {len(q)} and {len(v)}."
            )
        context = self.GetMyMutableContextFromRoot(root)
        context.SetDiscreteState(self._target, np.concatenate([q, v]))

    def set_effort(self, root: Context, effort: np.ndarray) -> None:
        """Command the feed-forward effort (n,) of the joints.

        Raises:
            InputError: Another number of them.
        """
        if len(effort) != self.size:
            raise InputError(f"'{self.get_name()}' takes {self.size} efforts, not {len(effort)}.")
        self.GetMyMutableContextFromRoot(root).SetDiscreteState(self._effort, effort)

    def target(self, root: Context) -> np.ndarray:
        """Return the desired positions (n,) of the joints, whoever commands them."""
        return self.desired(self.GetMyContextFromRoot(root))[: self.size]

    def desired(self, context: Context) -> np.ndarray:
        """Return the desired state (2n,) in the drive's own Context."""
        return context.get_discrete_state(self._target).value()

    def effort(self, context: Context) -> np.ndarray:
        """Return the feed-forward effort (n,) in the drive's own Context."""
        return context.get_discrete_state(self._effort).value()

    def _calc_desired(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self.desired(context))

    def _calc_actuation(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self.effort(context))

    def save(self, root: Context) -> np.ndarray:
        """Return everything that was commanded, in one array."""
        state = self.GetMyContextFromRoot(root).get_discrete_state()
        return np.concatenate([state.value(i) for i in range(state.num_groups())])

    def restore(self, root: Context, saved: np.ndarray) -> None:
        """Undo `save`."""
        context, start = self.GetMyMutableContextFromRoot(root), 0
        for i in range(context.num_discrete_state_groups()):
            size = context.get_discrete_state(i).size()
            context.SetDiscreteState(i, saved[start : start + size])
            start += size


class ArmDrive(JointDrive):
    """The drives of an arm: stiff position loops, or commanded torques.

    Input ports, both optional: ``desired_state`` (2n) [rad, rad/s] and ``torque`` (n) [N m]. With
    only ``torque`` connected the position loops are off; with both, the torque is added to them.

    Drake keeps controller gains in the plant's model, not in the Context. Which ones hold is
    remembered here in the Context, and set before each step of that Context.

    Args:
        q_home: (n,) joint angles to hold at first [rad].
        position_gains: Stiffness [N m/rad] and damping [N m s/rad] of each joint.
        torque_damping: Of a joint whose position loop is off [N m s/rad].
        time_step: Of the plant [s].
    """

    def __init__(
        self,
        q_home: np.ndarray,
        position_gains: Sequence[tuple[float, float]],
        torque_damping: float,
        time_step: float,
    ) -> None:
        super().__init__(q_home)
        n = self.size
        self._gains = (
            [PdControllerGains(p=p, d=d) for p, d in position_gains],
            [PdControllerGains(p=0.0, d=torque_damping)] * n,
        )
        self._state_in = self.DeclareVectorInputPort("desired_state", 2 * n)
        self._torque_in = self.DeclareVectorInputPort("torque", n)
        self._mode = self.DeclareDiscreteState([0.0])  # 1 while torques are commanded.
        self._actuators: tuple[JointActuator, ...] = ()
        self._mode_of_model = False  # What the gains in the plant's model are at present.
        # Of the same kind as the plant's own update: Drake runs all unrestricted ones first.
        self.DeclarePeriodicUnrestrictedUpdateEvent(time_step, 0.0, self._set_gains)

    def drive(self, actuators: Sequence[JointActuator]) -> None:
        """Take charge of the joints' gains; call before the plant is finalized."""
        self._actuators = tuple(actuators)
        for actuator, gains in zip(self._actuators, self._gains[0], strict=True):
            actuator.set_controller_gains(gains)

    def use_torque(self, root: Context, torque: bool) -> None:
        """Follow commanded torques from the next step on, or else the desired joint state."""
        context = self.GetMyMutableContextFromRoot(root)
        context.SetDiscreteState(self._mode, [1.0 if torque else 0.0])

    def uses_torque(self, root: Context) -> bool:
        """Return whether torques are commanded."""
        return self._torque_mode(self.GetMyContextFromRoot(root))

    def desired(self, context: Context) -> np.ndarray:
        """Return the desired state (2n,): the port's, if it has a value."""
        if self._state_in.HasValue(context):
            return self._state_in.Eval(context)
        return super().desired(context)

    def effort(self, context: Context) -> np.ndarray:
        """Return the commanded torque (n,): the port's, if it has a value."""
        if self._torque_in.HasValue(context):
            return self._torque_in.Eval(context)
        return super().effort(context)

    def _torque_mode(self, context: Context) -> bool:
        if self._torque_in.HasValue(context):
            return not self._state_in.HasValue(context)
        return bool(context.get_discrete_state(self._mode).value()[0])

    def _set_gains(self, context: Context, _: object) -> None:
        """Let the plant's model have the gains of the Context that is about to be stepped."""
        mode = self._torque_mode(context)
        if mode != self._mode_of_model:
            for actuator, gains in zip(self._actuators, self._gains[mode], strict=True):
                actuator.set_controller_gains(gains)
            self._mode_of_model = mode
