"""The types of gripper that an arm can carry, by name.

To add one, describe it here and draw its palm with a generator in cell/cad.
"""

from __future__ import annotations

from cell.errors import UnknownName
from cell.machines.grippers.base import GripperModel

# [R AGH-CEAI/robotiq_hande_description, commit 4f66b057]: sizes, masses, stroke, speed, effort;
# coupler 11 mm and 0.119 kg, body 99 mm and 0.86387 kg. Least force [A].
HAND_E = GripperModel(
    name="hand_e",
    travel=0.025,
    speed=0.15,
    effort=130.0,
    least_effort=20.0,
    palm_length=0.011 + 0.099,
    palm_mass=0.119 + 0.86387,
    finger_mass=0.03804,
)
# An electric gripper of 85 mm stroke, simplified to parallel jaws. Stroke, speed, forces and total
# mass of 0.925 kg are those of a Robotiq 2F-85 [R "2F-85 & 2F-140 instruction manual", 6.1]; what
# of it is fingers, and the size of the palm, are [A].
GRIPPER_85 = GripperModel(
    name="gripper_85",
    travel=0.0425,
    speed=0.15,
    effort=235.0,
    least_effort=20.0,
    palm_length=0.125,
    palm_mass=0.785,
    finger_mass=0.070,
)

GRIPPER_MODELS: dict[str, GripperModel] = {model.name: model for model in (HAND_E, GRIPPER_85)}


def too_wide(gripper: GripperModel, width: float) -> str:
    """Return in words that a part [m] is wider than a gripper opens, and which one would do."""
    wider = [model.name for model in GRIPPER_MODELS.values() if model.stroke > width]
    other = f"; as the tool of its arm, {' or '.join(wider)} opens wider" if wider else ""
    opens = f"{gripper.name} opens {1e3 * gripper.stroke:.3g} mm"
    return f"it is {1e3 * width:.3g} mm across, and {opens}{other}"


def gripper_model(name: str) -> GripperModel:
    """Return a type of gripper.

    Raises:
        UnknownName: There is none of this name.
    """
    if name not in GRIPPER_MODELS:
        raise UnknownName("gripper model", name, GRIPPER_MODELS)
    return GRIPPER_MODELS[name]
