"""Joints between the parts of a product: fits, screws, presses, and parts that only rest.

In a product file a joint is an entry of `joints:`, whose ``type`` names its kind. A new kind is a
frozen dataclass with `keys`, `read` and `parts`, added to `JOINT_TYPES`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from cell.errors import InputError
from cell.products.drives import Drive
from cell.products.fields import Fields, mapping_at, one_of

FRICTION_RADIUS_PER_DIAMETER = 0.7
"""[D] (d_w + d_h) / 4 of the head's bearing face (ISO 4762) and the clearance hole (ISO 273,
medium), over the nominal diameter: 0.71 for M3, 0.67 for M8."""


BIT_SEAT = 1.2e-3
"""Where nothing is said: of M3 in hex 2.5, 1.3 to 2 mm deep in a head of 3 mm [R] ISO 4762 [m]."""


class PartNames(Protocol):
    """What a joint needs to know of a product: the names of parts and groups."""

    @property
    def parts(self) -> Mapping[str, Any]:
        """The parts by name."""
        ...

    def members(self, item: str) -> tuple[str, ...]:
        """Return the names of the parts behind a part or group."""
        ...


@dataclass(frozen=True)
class Fit:
    """A shaft or boss of one part in a hole of another, with clearance.

    Attributes:
        shaft: Name of the part with the shaft.
        hole: Name of the part with the hole.
        p_AoF: Centre F of the hole's mouth, where the shaft enters, in the product frame A [m].
        depth: Engaged length of the assembled fit [m]; the shaft meets the hole this far before
            its seat.
    """

    keys: ClassVar[tuple[str, ...]] = ("shaft", "hole", "at_mm", "depth_mm")

    shaft: str
    hole: str
    p_AoF: np.ndarray
    depth: float

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that it joins."""
        return self.shaft, self.hole

    @classmethod
    def read(cls, entry: Fields, product: PartNames) -> Sequence[Fit]:
        """Return the fit that an entry describes."""
        return [cls(**_shaft_in_hole(entry, product))]


@dataclass(frozen=True)
class Press:
    """A shaft of one part in a hole of another, with interference: it takes force to seat it.

    Attributes:
        shaft, hole, p_AoF, depth: As for a `Fit`.
        force: Friction of the seated fit along its axis [N]; on the way it grows with the depth.
    """

    keys: ClassVar[tuple[str, ...]] = (*Fit.keys, "force_N")

    shaft: str
    hole: str
    p_AoF: np.ndarray
    depth: float
    force: float

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that it joins."""
        return self.shaft, self.hole

    @classmethod
    def read(cls, entry: Fields, product: PartNames) -> Sequence[Press]:
        """Return the press fit that an entry describes."""
        return [cls(**_shaft_in_hole(entry, product), force=entry.positive("force_N"))]


@dataclass(frozen=True)
class Screw:
    """A bolt, the part that it clamps and the tapped hole that it is driven into.

    Attributes:
        part: Name of the bolt.
        into: Name of the part that carries the thread.
        clamps: Name of the part under the head.
        thread: Designation, for example "M3".
        diameter: Nominal diameter d [m].
        pitch: Thread pitch P [m].
        thread_depth: Engaged length of thread when seated [m].
        torque: Tightening torque T [N m].
        nut_factor: K in T = K d F, with the clamp force F.
        friction_radius: Mean distance from the axis of the contact under the head [m]; None for
            that of a standard head and hole.
        drive: What turns it.
        bit_seat: Height of the bit's end above the underside of the head, when it is in [m].
        passes: 1: tightened at once. 2: all screws that ask for it to half their torque first, for
            where several clamp one part and disturb each other.
    """

    keys: ClassVar[tuple[str, ...]] = (
        "part",
        "into",
        "clamps",
        "thread",
        "diameter_mm",
        "pitch_mm",
        "thread_depth_mm",
        "torque_Nm",
        "nut_factor",
        "friction_radius_mm",
        "drive",
        "bit_seat_mm",
        "passes",
    )

    part: str
    into: str
    clamps: str
    thread: str
    diameter: float
    pitch: float
    thread_depth: float
    torque: float
    nut_factor: float
    friction_radius: float | None = None
    drive: Drive = Drive("hex 2.5")
    bit_seat: float = BIT_SEAT
    passes: int = 1

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that it joins."""
        return self.part, self.into, self.clamps

    @classmethod
    def read(cls, entry: Fields, product: PartNames) -> Sequence[Screw]:
        """Return the screw that an entry describes; for a group, one for each of its members."""
        screws = [
            cls(
                part=bolt,
                into=_part(entry, "into", product),
                clamps=_part(entry, "clamps", product),
                thread=entry.text("thread"),
                diameter=entry.positive("diameter_mm") * 1e-3,
                pitch=entry.positive("pitch_mm") * 1e-3,
                thread_depth=entry.positive("thread_depth_mm") * 1e-3,
                torque=entry.positive("torque_Nm"),
                nut_factor=entry.positive("nut_factor"),
                friction_radius=(
                    entry.positive("friction_radius_mm") * 1e-3
                    if "friction_radius_mm" in entry
                    else None
                ),
                drive=Drive(entry.text("drive") if "drive" in entry else "hex 2.5"),
                bit_seat=(
                    entry.positive("bit_seat_mm") * 1e-3 if "bit_seat_mm" in entry else BIT_SEAT
                ),
                passes=_passes(entry),
            )
            for bolt in product.members(entry.text("part"))
        ]
        for screw in screws:
            head_friction(screw)  # Refuses a nut factor that no friction gives.
            _ = screw.drive.positions  # Refuses a drive that no bit fits.
        return screws


@dataclass(frozen=True)
class Rest:
    """A part that stands on another, held by gravity alone.

    Attributes:
        part: Name of the part that stands.
        on: Name of the part that it stands on.
        depth: How far before its seat it enters what guides it, such as a lip its opening [m]; 0:
            nothing does.
    """

    keys: ClassVar[tuple[str, ...]] = ("part", "on", "depth_mm")

    part: str
    on: str
    depth: float = 0.0

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that it joins."""
        return self.part, self.on

    @classmethod
    def read(cls, entry: Fields, product: PartNames) -> Sequence[Rest]:
        """Return the joint that an entry describes; for a group, one for each of its members."""
        on = _part(entry, "on", product)
        depth = entry.positive("depth_mm") * 1e-3 if "depth_mm" in entry else 0.0
        return [cls(part, on, depth) for part in product.members(entry.text("part"))]


Joint = Fit | Screw | Press | Rest

JOINT_TYPES: dict[str, type[Joint]] = {"fit": Fit, "screw": Screw, "press": Press, "rest": Rest}
"""The kinds of joint, by the ``type`` of their entries in a product file."""


def read_joints(entries: Iterable[tuple[Any, str]], product: PartNames) -> tuple[Joint, ...]:
    """Return the joints that the entries of a product file describe, in their order.

    Args:
        entries: What the file holds, each with its place for messages.
        product: With parts and groups, which the joints refer to by name.

    Raises:
        UnknownName: A type, key, part or group that does not exist.
        InputError: A value that cannot be used, a part joined to itself, or a second screw for
            one bolt.
    """
    joints: list[Joint] = []
    bolts: set[str] = set()
    for data, where in entries:
        if "type" not in mapping_at(data, where):
            known = ", ".join(sorted(JOINT_TYPES))
            raise InputError(f"{where}: 'type' is missing, one of {known}.")
        kind = JOINT_TYPES[one_of(f"joint type in {where} called", str(data["type"]), JOINT_TYPES)]
        for joint in kind.read(Fields(data, where, ("type", *kind.keys)), product):
            if len(set(joint.parts)) < len(joint.parts):
                raise InputError(f"{where}: it joins a part to itself: {', '.join(joint.parts)}.")
            if isinstance(joint, Screw):
                if joint.part in bolts:
                    raise InputError(f"{where}: '{joint.part}' has a screw joint already.")
                bolts.add(joint.part)
            joints.append(joint)
    return tuple(joints)


def head_friction(screw: Screw, counter: float | None = None) -> float:
    """Return the friction coefficient of the bolt's head that realises its nut factor K.

    The simulated thread is frictionless, so that the head bears the friction of both. The torque
    of a screw, T = F (P / (2 pi) + 0.58 d_2 mu_thread + r mu_head) [R] (VDI 2230, part 1), without
    its second term and with T = K d F gives mu = (K d - P / (2 pi)) / r, where r is the friction
    radius under the head. Drake combines the coefficients of two surfaces to
    mu = 2 mu_1 mu_2 / (mu_1 + mu_2).

    Args:
        screw: Nut factor, diameter, pitch and friction radius.
        counter: Coefficient of the surface that the head bears on; None if it is given the same
            coefficient as the head.

    Returns:
        The coefficient to six significant digits, as models are written.

    Raises:
        InputError: No coefficient gives this nut factor.
    """
    K, d, P = screw.nut_factor, screw.diameter, screw.pitch
    r = screw.friction_radius or FRICTION_RADIUS_PER_DIAMETER * d
    mu = (K * d - P / (2.0 * np.pi)) / r
    if mu <= 0.0:
        raise InputError(
            f"Screw '{screw.part}': a nut factor of {K:g} is no more than P / (2 pi d) = "
            f"{P / (2.0 * np.pi * d):.3g}, that of a screw without friction."
        )
    if counter is not None:
        if counter <= mu / 2.0:
            raise InputError(
                f"Screw '{screw.part}': a nut factor of {K:g} needs a friction coefficient above "
                f"{mu / 2.0:.3g} of '{screw.clamps}' under the head; it has {counter:g}."
            )
        mu = mu * counter / (2.0 * counter - mu)
    return float(f"{mu:.6g}")


def _part(entry: Fields, key: str, product: PartNames) -> str:
    return one_of("part", entry.text(key), product.parts)


def _passes(entry: Fields) -> int:
    passes = entry.positive("passes") if "passes" in entry else 1
    if passes not in (1, 2):
        raise InputError(f"{entry.at('passes')}: expected 1 or 2, got {passes:g}.")
    return int(passes)


def _shaft_in_hole(entry: Fields, product: PartNames) -> dict[str, Any]:
    return {
        "shaft": _part(entry, "shaft", product),
        "hole": _part(entry, "hole", product),
        "p_AoF": entry.vector("at_mm") * 1e-3,
        "depth": entry.positive("depth_mm") * 1e-3,
    }
