"""SDF of the seven-axis arm: kinematics and masses of `cell.machines.arms.seven_axis`, own shapes.

Capsules that overlap at the joints, drawn by eye from the link lengths [A]; what is seen is what
touches, as points only. The forearm is slimmer towards the wrist so that the flange passes it with
the wrist bent as far as it goes.
"""

from __future__ import annotations

from cell.cad.arm_model import ARM_CONTACT, BLUE, DARK, GREY, arm_skeleton
from cell.cad.sdf_model import Inertia, Pose, SdfModel, capsule, cylinder, pointing
from cell.machines.arms.base import ArmModel

BASE_RADIUS, BASE_LENGTH = 0.078, 0.150
# Link, axis, where the capsule's straight part begins and ends on it, radius [m].
CAPSULES = (
    ("link_1", "+z", 0.075, 0.2025, 0.070),
    ("link_2", "+y", 0.0, 0.175, 0.070),
    ("link_3", "+z", 0.030, 0.2155, 0.065),
    ("link_4", "+y", 0.0, 0.155, 0.065),
    ("link_5", "+z", 0.020, 0.120, 0.055),
    ("link_5", "+z", 0.120, 0.2155, 0.045),
    ("link_6", "+y", 0.0, 0.050, 0.050),
)
FLANGE_RADIUS, FLANGE_START = 0.042, 0.010
RING = 0.008  # Length of the dark ring around the flange.


def seven_axis(arm: ArmModel) -> SdfModel:
    """Return the model."""
    base = Inertia(arm.base_mass, (-0.1, 0.0, 0.07), (0.05, 0.06, 0.03))  # [R] as the links.
    model = arm_skeleton(arm, base)
    foot = cylinder(BASE_RADIUS, BASE_LENGTH)
    model.visual(arm.base_frame, "base", foot, DARK, Pose(z=BASE_LENGTH / 2))
    model.collision(arm.base_frame, "base", foot, ARM_CONTACT, Pose(z=BASE_LENGTH / 2))
    for index, (link, axis, start, end, radius) in enumerate(CAPSULES):
        shape, pose = (
            capsule(radius, end - start),
            pointing(axis, (0.0, 0.0, 0.0), (start + end) / 2),
        )
        color = BLUE if link in ("link_2", "link_4", "link_6") else GREY
        model.visual(link, f"tube_{index}", shape, color, pose)
        model.collision(link, f"tube_{index}", shape, ARM_CONTACT, pose)
    last = arm.links[-1].name
    length = arm.flange_z - FLANGE_START
    plate, middle = cylinder(FLANGE_RADIUS, length), Pose(z=FLANGE_START + length / 2)
    model.visual(last, "plate", plate, GREY, middle)
    model.collision(last, "plate", plate, ARM_CONTACT, middle)
    ring = Pose(z=arm.flange_z - RING / 2)
    model.visual(last, "ring", cylinder(FLANGE_RADIUS + 0.0008, RING), DARK, ring)
    model.frame(arm.flange_frame, last, Pose(z=arm.flange_z))
    return model
