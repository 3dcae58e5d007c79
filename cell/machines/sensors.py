"""Force-torque sensors of the cell: at the wrists and under the force plate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import WeldJoint
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem, OutputPort


class WrenchSensor(LeafSystem):
    """A six-axis force-torque sensor built into a weld.

    The reading is the wrench that the body beyond the weld (the tool, the force plate with all it
    carries) exerts on the sensor, expressed in W, about the weld's origin; weights are in it.
    Output port ``wrench`` (6): torque [N m], then force [N].

    Args:
        plant: The plant.
        weld: Where it is built in.
    """

    def __init__(self, plant: MultibodyPlant, weld: WeldJoint) -> None:
        super().__init__()
        self.plant, self.weld = plant, weld
        self._index = int(weld.index())
        self._body = int(weld.child_body().index())
        self._R_BJc = weld.frame_on_child().GetFixedPoseInBodyFrame().rotation()
        forces, poses = AbstractValue.Make([SpatialForce()]), AbstractValue.Make([RigidTransform()])
        self._forces_in = self.DeclareAbstractInputPort("reaction_forces", forces)
        self._poses_in = self.DeclareAbstractInputPort("body_poses", poses)
        self.DeclareVectorOutputPort("wrench", 6, self._calc)

    def connect(self, builder: DiagramBuilder, name: str) -> OutputPort:
        """Add it to a diagram under a name, connected to the finalized plant; return its output."""
        builder.AddNamedSystem(name, self)
        builder.Connect(self.plant.get_reaction_forces_output_port(), self._forces_in)
        builder.Connect(self.plant.get_body_poses_output_port(), self._poses_in)
        return self.get_output_port()

    def _calc(self, context: Context, output: BasicVector) -> None:
        X_WB = self._poses_in.Eval(context)[self._body]
        F_CJc_Jc = self._forces_in.Eval(context)[self._index]
        output.SetFromVector(_wrench(X_WB.rotation() @ self._R_BJc, F_CJc_Jc))

    def read(self, plant_context: Context) -> np.ndarray:
        """Return the wrench (6,), given the plant's context: the same as the output port's."""
        (wrench,) = read_all([self], plant_context)
        return wrench


def read_all(sensors: Sequence[WrenchSensor], plant_context: Context) -> list[np.ndarray]:
    """Return the wrench (6,) of each of several sensors of one plant, as `WrenchSensor.read`."""
    if not sensors:
        return []
    # Once for all: Drake hands the forces of every joint over.
    forces = sensors[0].plant.get_reaction_forces_output_port().Eval(plant_context)
    return [
        _wrench(
            sensor.weld.frame_on_child().CalcRotationMatrixInWorld(plant_context),
            forces[sensor._index],
        )
        for sensor in sensors
    ]


def _wrench(R_WJc: RotationMatrix, F_CJc_Jc: SpatialForce) -> np.ndarray:
    """Drake reports what the joint exerts on its child C, in the joint frame Jc on the child."""
    return -(R_WJc.matrix() @ F_CJc_Jc.get_coeffs().reshape(2, 3).T).T.reshape(-1)
