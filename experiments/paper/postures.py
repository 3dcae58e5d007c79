"""The paper's postures and push directions, in one table.

The figures that define them are not part of the public text, so this is an interpretation, stated
case by case; the report shows every one. P is the part's frame: the motor's has +z along the shaft
and the shaft's eccentricity towards +y; the plate's has the hole's axis along z, the face between
z = 0 (motor side) and 5 mm, and the foot at y = -33 .. -28 mm, reaching to z = -15 mm.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from cell.errors import UnknownName
from cell.products.product import Grasp

MM = 1e-3
AXES = {
    sign + name: (1.0 if sign == "+" else -1.0) * np.eye(3)[k]
    for k, name in enumerate("xyz")
    for sign in "+-"
}


@dataclass(frozen=True)
class Posture:
    """The orientation of a part on the jig, and the grasp with which it is placed.

    Attributes:
        part: "motor" or "plate".
        name: The paper's label.
        up: Axis of P that points up.
        meaning: In words.
        grasp: From above or from the side, chosen manually as in the paper.
        X_PTurned: Rotation of the part in the tray relative to the product file, such that the
            robot can reach this grasp there, too.
    """

    part: str
    name: str
    up: str
    meaning: str
    grasp: Grasp
    X_PTurned: RigidTransform = field(default_factory=RigidTransform)

    @property
    def label(self) -> str:
        """For example "motor/P2"."""
        return f"{self.part}/{self.name}"


@dataclass(frozen=True)
class PushSpec:
    """A straight push of a part that the jig holds.

    Attributes:
        posture: Of the part.
        direction: The paper's label.
        along: Direction of the push, an axis of P.
        foot, top: (3,) lower and upper end of the pushed face at the point of contact, in P [mm].
        expected: "success" or "failure", as in the paper.
        meaning: In words.
    """

    posture: Posture
    direction: str
    along: str
    foot: tuple[float, float, float]
    top: tuple[float, float, float]
    expected: str
    meaning: str

    @property
    def label(self) -> str:
        """For example "motor/P2/a"."""
        return f"{self.posture.label}/{self.direction}"


def _grasp(
    name: str,
    jaw: str,
    at_mm: tuple[float, float, float],
    approach: np.ndarray,
    closing: str,
    width_mm: float,
    force: float,
) -> Grasp:
    x, z = AXES[closing], approach
    R_PJaw = RotationMatrix(np.column_stack([x, np.cross(z, x), z]))
    return Grasp(name, jaw, RigidTransform(R_PJaw, np.array(at_mm) * MM), width_mm * MM, force)


def _turned(axis: str, angle_deg: float, through_mm: tuple[float, float, float]) -> RigidTransform:
    """Return the pose of a part turned about an axis of P through a point of P [mm]."""
    p = np.array(through_mm) * MM
    turn = RigidTransform(AngleAxis(np.deg2rad(angle_deg), AXES[axis]), [0.0, 0.0, 0.0])
    return RigidTransform(p) @ turn @ RigidTransform(-p)


# The motor is gripped by its sides, lying with a horizontal hand and the recessed jaws above; the
# horizontal plate from above, close to its centre of mass, with the fingertips beyond the foot; the
# upright plate by its edges, on the foot with a hand tilted by 20 deg (a horizontal one cannot
# reach it). The force is the maximum of the gripper: in a weaker grip a part that is pressed away
# from the middle of the pads turns.
MOTOR_LYING = _grasp("gearbox", "tip", (0, 0, -14), AXES["-z"], "+x", 36.8, 65.0)
MOTOR_STANDING = _grasp("can", "tip", (0, 0, -33), AXES["-y"], "+x", 34.8, 65.0)
PLATE_FOOT_UP = _grasp("edges", "wide", (0, -21, -2.5), AXES["+z"], "+x", 70.0, 65.0)
PLATE_FOOT_DOWN = _grasp("edges", "wide", (0, -21, 7.5), AXES["-z"], "-x", 70.0, 65.0)
LEAN = np.deg2rad(20.0)
LEANING = np.cos(LEAN) * AXES["-y"] + np.sin(LEAN) * AXES["-z"]
PLATE_ON_FOOT = _grasp("edges", "wide", (0, 17, 2.5), LEANING, "-x", 70.0, 65.0)
PLATE_ON_SIDE = _grasp("edges", "wide", (20, -3, 2.5), AXES["-x"], "+y", 60.0, 65.0)

# The tray's cradle takes the motor in any roll, its ledges take the plate either way up.
SHAFT_LOW = _turned("+z", -90.0, (0, 0, 0))
SHAFT_HIGH = _turned("+z", 90.0, (0, 0, 0))
FOOT_HIGH = _turned("+y", 180.0, (0, 0, 2.5))

POSTURES = {
    posture.label: posture
    for posture in (
        Posture("motor", "P1", "-y", "lying on its side, shaft low", MOTOR_LYING, SHAFT_LOW),
        Posture(
            "motor", "P2", "+z", "standing on its terminals, shaft up", MOTOR_STANDING, SHAFT_HIGH
        ),
        Posture(
            "plate", "P1", "-z", "face level, motor side and foot up", PLATE_FOOT_UP, FOOT_HIGH
        ),
        Posture("plate", "P2", "+y", "standing on the foot's 70 x 20 face", PLATE_ON_FOOT),
        Posture("plate", "P3", "+x", "standing on a side edge", PLATE_ON_SIDE),
        Posture("plate", "P4", "+z", "face level, bolt side up, foot down", PLATE_FOOT_DOWN),
    )
}


def _push(label: str, along: str, foot, top, expected: str, meaning: str) -> PushSpec:
    part, name, direction = label.split("/")
    return PushSpec(POSTURES[f"{part}/{name}"], direction, along, foot, top, expected, meaning)


S, F = "success", "failure"
PUSHES = {
    push.label: push
    for push in (
        _push("motor/P1/a", "-z", (0, 18.4, 0), (0, -18.4, 0), S, "along the axis, on the gearbox"),
        _push("motor/P1/b", "+x", (-18.4, 17.4, -25.7), (-18.4, -17.4, -25.7), S, "across"),
        _push("motor/P2/a", "+x", (-17.4, 0, -53.4), (-18.4, 0, 0), F, "on the standing can"),
        _push("plate/P1/a", "+y", (0, -33, 5), (0, -33, -15), S, "on the foot's outer face"),
        _push("plate/P1/b", "+x", (-35, -30.5, 5), (-35, -30.5, -15), F, "on the foot's end"),
        _push("plate/P1/c", "+x", (-35, -8.8, 5), (-35, -8.8, 0), S, "on the face's side edge"),
        _push("plate/P2/a", "+z", (0, -28, 0), (0, 27, 0), F, "from the foot's side to the heel"),
        _push("plate/P2/b", "-z", (0, -33, 5), (0, 27, 5), F, "from the front to the foot's toe"),
        _push("plate/P2/c", "+x", (-35, -33, 2.5), (-35, 27, 2.5), S, "in the plane of the face"),
    )
}


def chosen(kind: str, table: dict, case: str | None) -> list:
    """Return the entries of a table that a label selects: one, or all of a part or posture.

    Args:
        kind: Of entries, for the error message.
        table: Entries by label.
        case: The label; None selects all.

    Raises:
        UnknownName: No entry has this label.
    """
    if case is None:
        return list(table.values())
    wanted = case.strip("/")
    found = [item for label, item in table.items() if (label + "/").startswith(wanted + "/")]
    if not found:
        raise UnknownName(kind, case, list(table))
    return found
