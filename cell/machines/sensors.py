"""What the cell can know of itself: wrenches at wrists and force plate, poses of parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import WeldJoint
from pydrake.systems.framework import Context

from cell.workpieces.parts import Parts


@dataclass(frozen=True)
class WrenchSensor:
    """A six-axis force-torque sensor built into a weld.

    The reading is the wrench that the body beyond the weld (the tool, the force plate with all it
    carries) exerts on the sensor, expressed in W, about the weld's origin; weights are in it.
    """

    plant: MultibodyPlant
    weld: WeldJoint

    def read(self, plant_context: Context) -> np.ndarray:
        """Return the wrench (6,): torque [N m], then force [N], in W."""
        forces = self.plant.get_reaction_forces_output_port().Eval(plant_context)
        F_CJc_Jc = forces[int(self.weld.index())]
        # Drake reports what the joint exerts on its child, in the joint frame on the child.
        R_WJc = self.weld.frame_on_child().CalcPoseInWorld(plant_context).rotation()
        return -np.concatenate([R_WJc @ F_CJc_Jc.rotational(), R_WJc @ F_CJc_Jc.translational()])


@dataclass(frozen=True)
class PoseSensor:
    """Where a part is: the truth plus configurable noise. A camera will take its place.

    Attributes:
        parts: The parts it sees.
        position_noise: Standard deviation per axis [m].
        angle_noise: Standard deviation about each axis [rad].
        rng: Source of the noise.
    """

    parts: Parts
    position_noise: float
    angle_noise: float
    rng: np.random.Generator

    def read(self, plant_context: Context, name: str) -> RigidTransform:
        """Return the sensed pose X_WP of a part."""
        X_WP = self.parts[name].X_WP(plant_context)
        if self.position_noise == 0.0 and self.angle_noise == 0.0:
            return X_WP
        offset = self.rng.normal(scale=self.position_noise, size=3)
        turn = RollPitchYaw(self.rng.normal(scale=self.angle_noise, size=3))
        X_PS = RigidTransform(turn, [0.0, 0.0, 0.0])
        return RigidTransform(X_WP.rotation(), X_WP.translation() + offset) @ X_PS
