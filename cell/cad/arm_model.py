"""The skeleton of an arm's SDF: links, inertias and driven joints from the arm's own table."""

from __future__ import annotations

from cell.cad.sdf_model import Color, Contact, Inertia, Pose, SdfModel, tag
from cell.machines.arms.base import ArmModel

GREY: Color = (0.70, 0.71, 0.72)
BLUE: Color = (0.24, 0.48, 0.70)
DARK: Color = (0.16, 0.17, 0.18)
ARM_CONTACT = Contact("point", friction=0.3)  # [A] painted aluminium.


def arm_skeleton(arm: ArmModel, base: Inertia) -> SdfModel:
    """Return a model of links and joints without shapes and without the flange's frame.

    Args:
        arm: The arm.
        base: Inertia of the link that stands still.
    """
    model = SdfModel(arm.name)
    model.link(arm.base_frame, base)
    parent = arm.base_frame
    for link in arm.links:
        inertia = Inertia(link.mass, link.com, link.moments)
        model.link(link.name, inertia, parent=parent, pose=Pose(*link.xyz, *link.rpy))
        model.joint(
            link.joint,
            "revolute",
            parent,
            link.name,
            position=(link.lower, link.upper),
            velocity=link.speed,
            effort=link.effort,
            damping=arm.joint_damping,
            extra=[
                tag("drake:rotor_inertia", arm.rotor_inertia),
                tag("drake:gear_ratio", arm.gear_ratio),
            ],
        )
        parent = link.name
    return model
