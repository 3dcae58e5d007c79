"""What is assembled: parts in their assembled poses, fasteners, and the orders of assembly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import trimesh
from pydrake.math import RigidTransform

from cell.errors import UnknownName


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
        model: Name of the SDF model in ``models/sdf``, or None for a part that is only planned.
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
class Fastener:
    """A threaded part and the hole it is driven into.

    Attributes:
        part: Name of the bolt.
        into: Name of the part that carries the thread.
        clamps: Name of the part under the head.
        thread: Designation, for example "M3".
        diameter: Nominal diameter d [m].
        pitch: Thread pitch P [m].
        thread_depth: Engaged length of thread when seated [m].
        torque: Tightening torque T [N m].
        nut_factor: K in T = K d F.
    """

    part: str
    into: str
    clamps: str
    thread: str
    diameter: float
    pitch: float
    thread_depth: float
    torque: float
    nut_factor: float


@dataclass(frozen=True)
class Fit:
    """A shaft or boss of one part in a hole of another, in the assembled product.

    Attributes:
        shaft: Name of the part with the shaft.
        hole: Name of the part with the hole.
        p_AoF: Centre F of the hole's mouth, where the shaft enters, in the product frame A [m].
        depth: Length of the fit [m]: how far before the seat the shaft meets the hole.
    """

    shaft: str
    hole: str
    p_AoF: np.ndarray
    depth: float


@dataclass(frozen=True)
class Product:
    """Parts in assembled poses, with groups, fasteners and assembly orders.

    Attributes:
        name: For example "motor_unit".
        parts: By name, in matrix order.
        groups: Group name -> names of its parts; a group is one item of an assembly order.
        orders: Assembly orders, each a tuple of part or group names; the first is the default.
        fasteners: By the name of the bolt.
        fits: Shafts in holes.
        up: Axis of the product frame that points up on the jig: "+x" ... "-z".
        contact_tolerance: Gap up to which two parts count as touching, and overlap up to which they
            do not block each other [m]; None to derive it from sizes and clearances.
        tray: Name of the SDF model of the tray that presents the parts, if there is one.
        remarks: What was assumed or repaired while it was read, a sentence each.
    """

    name: str
    parts: Mapping[str, Part]
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    orders: tuple[tuple[str, ...], ...] = ()
    fasteners: Mapping[str, Fastener] = field(default_factory=dict)
    fits: tuple[Fit, ...] = ()
    up: str = "+z"
    contact_tolerance: float | None = None
    tray: str | None = None
    remarks: tuple[str, ...] = ()

    def members(self, item: str) -> tuple[str, ...]:
        """Return the part names behind an item of an order: a group's members, or the part."""
        if item in self.groups:
            return self.groups[item]
        if item in self.parts:
            return (item,)
        raise UnknownName("part or group", item, [*self.parts, *self.groups])

    def items(self) -> tuple[str, ...]:
        """Return groups and ungrouped parts, in part order: what an assembly order must list."""
        grouped = {name: group for group, names in self.groups.items() for name in names}
        return tuple(dict.fromkeys(grouped.get(name, name) for name in self.parts))
