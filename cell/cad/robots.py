"""SDF models of the driven machines: arms, grippers, driver."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from cell.cad.arms import seven_axis, ur
from cell.cad.grippers import gripper_85, hand_e
from cell.cad.screwdriver import screwdriver
from cell.cad.sdf_model import SdfModel
from cell.machines.arms.seven_axis import IIWA14
from cell.machines.arms.ur import UR3E, UR5E, UR10E


def robot_models() -> Iterator[SdfModel]:
    """Yield every arm, gripper and driver."""
    yield from map(ur, (UR3E, UR5E, UR10E))
    yield seven_axis(IIWA14)
    yield from (hand_e(), gripper_85(), screwdriver())


def write_models(folder: Path) -> None:
    """Write every arm, gripper and driver into ``folder`` (models/sdf)."""
    for model in robot_models():
        model.write(folder)
