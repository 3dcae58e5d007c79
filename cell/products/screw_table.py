"""Metric screws from M2 to M6: thread, heads and drives, clearance holes, tightening torque.

Lengths in millimetres. [R] from tables that suppliers and engineering sites print of the standards,
not from the standards themselves: ISO 4762 (hexagon socket cap heads with coarse pitch, bearing
face and depth of the socket; geartoolkit.com), ISO 7045, recess H (pan heads; fullerfasteners.com,
other sites print DIN 7985 under that number), ISO 273 medium (clearance holes;
engineeringhardware.com), ISO 898-1 and ISO 3506-1 (strength classes; roymech.co.uk). Stress areas
by the formula of ISO 898-1 agree with its table from M3 on (usefastener.com), tap drills of one
pitch less than the diameter with drill charts (nightshade.net).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from cell.errors import UnknownName


@dataclass(frozen=True)
class Head:
    """A head of one size, with what turns it.

    Attributes:
        kind: "socket cap" or "pan".
        drive: For example "hex 2.5" (across flats) or "cross 1" (size of the recess).
        diameter: Largest [mm].
        height: [mm].
        bearing: Diameter of the bearing face, the smallest that is allowed [mm].
        engagement: Depth of the drive, the smallest that is allowed [mm].
    """

    kind: str
    drive: str
    diameter: float
    height: float
    bearing: float
    engagement: float


@dataclass(frozen=True)
class ScrewSize:
    """One nominal size.

    Attributes:
        name: "M3".
        diameter: Nominal, d [mm].
        pitch: [mm].
        clearance_hole: Its diameter [mm].
        heads: The kinds that are known.
    """

    name: str
    diameter: float
    pitch: float
    clearance_hole: float
    heads: tuple[Head, ...]

    @property
    def tap_drill(self) -> float:
        """Diameter of the hole that a thread is cut into [mm]."""
        return self.diameter - self.pitch

    @property
    def stress_area(self) -> float:
        """Nominal stress area, pi / 4 ((d_2 + d_3) / 2)^2 [mm2]."""
        return math.pi / 4.0 * (self.diameter - 0.9382 * self.pitch) ** 2

    def preload_torque(self, strength: str, nut_factor: float) -> float:
        """Return the tightening torque for 70 % of the yield strength [N m].

        [D] T = K d F with F = 0.7 R_p0.2 A_s, the share that tables of tightening torques use
        (VDI 2230 allows 90 % of yield, of which torsion takes about a fifth).

        Raises:
            UnknownName: No such strength class.
        """
        if strength not in YIELD:
            raise UnknownName("strength class", strength, YIELD)
        return nut_factor * 1e-3 * self.diameter * 0.7 * YIELD[strength] * self.stress_area


YIELD: Mapping[str, float] = {
    "4.8": 340.0,
    "5.8": 420.0,
    "8.8": 640.0,
    "10.9": 940.0,
    "12.9": 1100.0,
    "A2-70": 450.0,
    "A4-80": 600.0,
}
"""R_p0.2 or R_eL by strength class [MPa] [R] ISO 898-1, ISO 3506-1."""

NUT_FACTOR = 0.202
"""[D] K in T = K d F for friction of 0.14 in the thread and under the head, M3."""

_SIZES = (
    ("M2", 2.0, 0.4, 2.4, (1.5, 3.8, 2.0, 3.48, 1.0), (0, 4.0, 1.6, 3.6, 0.9)),
    ("M2.5", 2.5, 0.45, 2.9, (2.0, 4.5, 2.5, 4.18, 1.1), (1, 5.0, 2.1, 4.5, 1.15)),
    ("M3", 3.0, 0.5, 3.4, (2.5, 5.5, 3.0, 5.07, 1.3), (1, 5.6, 2.4, 5.1, 1.4)),
    ("M4", 4.0, 0.7, 4.5, (3.0, 7.0, 4.0, 6.53, 2.0), (2, 8.0, 3.1, 7.2, 1.9)),
    ("M5", 5.0, 0.8, 5.5, (4.0, 8.5, 5.0, 8.03, 2.5), (2, 9.5, 3.7, 8.6, 2.4)),
    ("M6", 6.0, 1.0, 6.6, (5.0, 10.0, 6.0, 9.38, 3.0), (3, 12.0, 4.6, 11.0, 3.1)),
)
"""Name, d, P, clearance hole; socket cap: flats, diameter, height, bearing,
depth of the drive; pan: recess, diameter, height, bearing [D: 0.9 of the diameter], depth."""

SIZES: tuple[ScrewSize, ...] = tuple(
    ScrewSize(
        *row[:4],
        (
            Head("socket cap", f"hex {row[4][0]:g}", *row[4][1:]),
            Head("pan", f"cross {row[5][0]}", *row[5][1:]),
        ),
    )
    for row in _SIZES
)

SIZE_MISFIT = 0.06
"""[A] Of the nominal diameter: a shank drawn at the mean of its tolerance is 2 % thin, a faceted
one 3 %; neighbouring sizes are 20 % apart."""

HEAD_MISFIT = 0.15
"""[A] Of diameter and height: standards for one kind of head differ by 10 %."""


def size_of(diameter: float) -> ScrewSize | None:
    """Return the size whose nominal diameter a shank's is [mm], or None."""
    best = min(SIZES, key=lambda size: abs(size.diameter - diameter))
    return best if abs(best.diameter / diameter - 1.0) < SIZE_MISFIT else None


def head_of(size: ScrewSize, diameter: float, height: float) -> tuple[Head, float]:
    """Return the kind of head that is nearest to a drawn one [mm], and by how much it is off."""

    def misfit(head: Head) -> float:
        return max(abs(diameter / head.diameter - 1.0), abs(height / head.height - 1.0))

    best = min(size.heads, key=misfit)
    return best, misfit(best)
