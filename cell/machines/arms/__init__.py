"""The types of arm that a cell can have, by name.

To add one, describe it in a module of this folder, name it in `ARM_MODELS` and draw it with a
generator in cell/cad. A table of links is enough; inverse kinematics need no closed form.
"""

from __future__ import annotations

from cell.errors import UnknownName
from cell.machines.arms.base import ArmModel
from cell.machines.arms.seven_axis import IIWA14
from cell.machines.arms.ur import UR3E, UR5E, UR10E

ARM_MODELS: dict[str, ArmModel] = {model.name: model for model in (UR3E, UR5E, UR10E, IIWA14)}


def arm_model(name: str) -> ArmModel:
    """Return a type of arm.

    Raises:
        UnknownName: There is none of this name.
    """
    if name not in ARM_MODELS:
        raise UnknownName("arm model", name, ARM_MODELS)
    return ARM_MODELS[name]
