"""What is assembled: parts in their assembled poses, joints between them, and assembly orders."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import trimesh
from pydrake.math import RigidTransform

from cell.errors import BadPart, InputError, UnknownName
from cell.products.declared import Declared
from cell.products.joints import Fit, Joint, Press, Screw
from cell.products.mesh_io import LARGEST_PART
from cell.vectors import rotation_with_up


@dataclass(frozen=True)
class Grasp:
    """A way for the parallel-jaw gripper to hold a part.

    Attributes:
        name: Label, for example "edges".
        jaw: Which jaw surfaces touch: "tip" (main pads), "wide" (recessed wing pads), "nose".
        X_PJaw: Pose of the jaw frame in the part frame P. The jaw's x is the closing direction,
            its z is the approach direction (from the palm to the part).
        width: Distance between the gripped surfaces [m].
        force: Grip force per pad [N].
    """

    name: str
    jaw: str
    X_PJaw: RigidTransform
    width: float
    force: float


@dataclass(frozen=True)
class Part:
    """One rigid part, in its own CAD frame P.

    Attributes:
        name: Unique within the product.
        mesh: Closed surface in P [m].
        mass: [kg].
        X_AP: Assembled pose in the product frame A.
        model: Name of the SDF model in ``models/sdf``, or URL of one elsewhere; None for a part
            that is only planned.
        X_TrayP: Pose in which the parts tray presents the part, in the tray's frame T (centre of
            its base plate's top face, +z up); None for a part that is only planned.
        grasps: Ways to hold it, best first.
    """

    name: str
    mesh: trimesh.Trimesh
    mass: float
    X_AP: RigidTransform
    model: str | None = None
    X_TrayP: RigidTransform | None = None
    grasps: tuple[Grasp, ...] = ()


@dataclass(frozen=True)
class LeftOut:
    """What was in the input and is not planned.

    Attributes:
        name: Of a part, a sub-assembly or a file.
        reason: Why, for example "not watertight: 4 open edges".
    """

    name: str
    reason: str


@dataclass(frozen=True)
class Product:
    """Parts in assembled poses, with groups, joints and assembly orders.

    Attributes:
        name: For example "motor_unit".
        parts: By name, in matrix order; a product without parts leaves the cell to other bodies.
        groups: Group name -> names of its parts; a group is one item of an assembly order.
        orders: Assembly orders, each a tuple of part or group names; the first is the default.
        joints: What holds the parts together, in the order of the product file.
        up: Axis of the product frame that points up on the jig: "+x" ... "-z".
        contact_tolerance: Gap up to which two parts count as touching, and overlap up to which they
            do not block each other [m]; None to derive it from sizes and clearances.
        declared: What the user vouches for where the rule for rigid bodies would refuse it.
        tray: Name or URL of the SDF model of the tray that presents the parts; None if there is
            none.
        remarks: What was assumed or repaired when it was read, one sentence each.
        left_out: What was in the input and is not planned.
    """

    name: str = "nothing"
    parts: Mapping[str, Part] = field(default_factory=dict)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    orders: tuple[tuple[str, ...], ...] = ()
    joints: tuple[Joint, ...] = ()
    up: str = "+z"
    contact_tolerance: float | None = None
    declared: Declared = field(default_factory=Declared)
    tray: str | None = None
    remarks: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out, by reason, and the remarks: one sentence each."""
        names: dict[str, list[str]] = {}
        for thing in self.left_out:
            names.setdefault(thing.reason, []).append(thing.name)
        left_out = (f"left out: {', '.join(which)} ({why})" for why, which in names.items())
        return (*left_out, *self.remarks)

    @property
    def fits(self) -> tuple[Fit, ...]:
        """The joints that are fits of a shaft in a hole."""
        return tuple(joint for joint in self.joints if isinstance(joint, Fit))

    @property
    def presses(self) -> tuple[Press, ...]:
        """The joints that are press fits."""
        return tuple(joint for joint in self.joints if isinstance(joint, Press))

    @property
    def up_axis(self) -> np.ndarray:
        """Unit vector (3,) in A that points up on the jig."""
        return rotation_with_up(self.up).inverse() @ np.array([0.0, 0.0, 1.0])

    def enters_from_above(self, joint: Fit | Press) -> bool:
        """Return whether a shaft comes down into its hole: what has the hole is below its mouth."""
        hole = self.parts[joint.hole]
        p_AoG = hole.X_AP @ np.asarray(hole.mesh.center_mass, float)
        return bool(self.up_axis @ (p_AoG - joint.p_AoF) < 0.0)

    @property
    def screws(self) -> Mapping[str, Screw]:
        """The joints that are screws, by the name of the bolt."""
        return {joint.part: joint for joint in self.joints if isinstance(joint, Screw)}

    def members(self, item: str) -> tuple[str, ...]:
        """Return the part names behind an item of an order: a group's members, or the part itself.

        Raises:
            UnknownName: Neither a part nor a group.
        """
        if item in self.groups:
            return self.groups[item]
        if item in self.parts:
            return (item,)
        raise UnknownName("part or group", item, [*self.parts, *self.groups])

    def items(self) -> tuple[str, ...]:
        """Return groups and ungrouped parts, in part order: what an assembly order must list."""
        grouped = {name: group for group, names in self.groups.items() for name in names}
        return tuple(dict.fromkeys(grouped.get(name, name) for name in self.parts))

    def check_simulable(self) -> None:
        """Raise `InputError` for a product that can be planned but not simulated.

        Every part needs a model with contact geometry, and a place in the tray to start from, and
        the arms have to reach around it.
        """
        parts = self.parts.values()
        for part in parts:
            if (size := float(part.mesh.extents.max())) > LARGEST_PART:
                reach = f"{LARGEST_PART:g} m at most"
                raise BadPart(
                    part.name, f"it is {size:.3g} m long: nothing here can hold it ({reach})"
                )
        lacking = {
            "a contact model": [part.name for part in parts if part.model is None],
            "a place in the tray": [part.name for part in parts if part.X_TrayP is None],
        }
        missing = [f"{', '.join(names)}: {what}" for what, names in lacking.items() if names]
        if missing:
            raise InputError(
                f"Product '{self.name}' can be planned, but not assembled in the twin; missing for "
                f"{'; for '.join(missing)}. A product file states both, as 'model' and 'tray_pose'."
            )
