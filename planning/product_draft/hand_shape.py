"""The gripper as grasps meet it: its jaws' faces, and the hand's surface at an opening.

Frames: tip, midway between the main pads, with x the closing direction and z the approach; jaw, the
frame of the jaw that a grasp names.
"""

from __future__ import annotations

from dataclasses import dataclass

import fcl
import numpy as np
import trimesh

from cell.cad.grippers import BODY_RADIUS, BRIDGE, PAD_CONTACT, STEM
from cell.cad.shapes import joined
from cell.machines.grippers import GripperModel

JAWS = ("tip", "wide", "nose")


@dataclass(frozen=True)
class Face:
    """The face of a jaw in its own frame: middle (y, z) and size (y, z) [m]."""

    middle: tuple[float, float]
    size: tuple[float, float]


class HandShape:
    """Faces of the jaws, and collision shapes of the hand, of one gripper.

    Args:
        gripper: Its type.
    """

    def __init__(self, gripper: GripperModel) -> None:
        tips = gripper.tips
        self.gripper = gripper
        self.faces = {
            "tip": Face((0.0, 0.0), tips.pad[1:]),
            "wide": Face((0.0, 0.0), tips.wing[1:]),
            "nose": Face((0.0, tips.nose_start + tips.nose[2] / 2 - tips.nose_z), tips.nose[1:]),
        }
        self.p_TipJaw = {
            "tip": np.zeros(3),
            "wide": np.array([0.0, tips.wing_y, 0.0]),
            "nose": np.array([0.0, 0.0, tips.nose_z]),
        }
        self._thickness = {"tip": tips.pad[0], "wide": tips.wing[0], "nose": tips.nose[0]}
        wing_x = tips.wing_offset + tips.wing[0] / 2
        self._fixed = [STEM[1:], BRIDGE[1:]]
        self._pads = [
            (tips.pad, (tips.pad[0] / 2, 0.0, 0.0)),
            (tips.wing, (wing_x, tips.wing_y, 0.0)),
            (tips.nose, (tips.nose[0] / 2, 0.0, tips.nose_start + tips.nose[2] / 2)),
        ]
        self._built: dict[tuple[float, float], fcl.BVHModel] = {}

    def widths(self, jaw: str) -> tuple[float, float]:
        """Return the smallest and largest width that a jaw grips [m]."""
        setback = self.gripper.setback[jaw]
        return setback + LEAST_OPENING, setback + self.gripper.stroke

    def stiffness(self, jaw: str) -> float:
        """Return the pressure of a pad per depth to which it is squeezed [Pa/m].

        Drake's pressure rises to the modulus where the pad is half as thick.
        """
        return PAD_CONTACT.modulus / (self._thickness[jaw] / 2.0)

    def shape(self, opening: float, margin: float) -> fcl.BVHModel:
        """Return the hand's surface in the frame tip.

        Args:
            opening: Of the tip pads [m].
            margin: By which all shapes are thicker [m].
        """
        key = round(opening, 4), round(margin, 5)
        if key not in self._built:
            boxes = []
            for size, centre in (*self._fixed, *self._pads):
                for sign in (1.0, -1.0):
                    middle = [sign * (centre[0] + opening / 2), centre[1], centre[2]]
                    X = trimesh.transformations.translation_matrix(middle)
                    boxes.append(trimesh.creation.box(np.array(size) + 2 * margin, X))
            length = self.gripper.palm_length
            palm = trimesh.creation.cylinder(BODY_RADIUS + margin, length, sections=16)
            palm.apply_translation([0, 0, length / 2 - self.gripper.tip_z])
            self._built[key] = surface(joined([*boxes, palm]))
        return self._built[key]


LEAST_OPENING = 1e-3  # [A] Of the tip pads when they hold something [m].


def surface(mesh: trimesh.Trimesh) -> fcl.BVHModel:
    """Return a surface for collision queries."""
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.faces))
    model.addSubModel(np.asarray(mesh.vertices, float), np.asarray(mesh.faces))
    model.endModel()
    return model
