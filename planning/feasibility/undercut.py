"""Undercuts: how far a part must bend or stretch to leave another along a direction.

A snap hook, or a belt between flanges, is mounted by bending it over an edge. Along a direction,
the parts are in each other's way over some region of the plane across it. The undercut is the
width of that region where it is widest: the diameter of the largest disc in it, 0.8 mm for a hook
0.8 mm deep, whatever its length and height. A snap fit leaves along the direction of its smallest
undercut.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from planning.feasibility.clipping import Polygons, point_in_wide_union
from planning.feasibility.directions import DIRECTIONS, axis_index
from planning.feasibility.envelope import Envelope, envelope
from planning.feasibility.face_pairs import blocked_regions, crossing_faces
from planning.feasibility.solids import Solid

HALVINGS = 12  # Bisects 10 mm to 2.5 um.
ALIKE = 1.05  # [A] Undercuts this close are equal: a belt leaves over either flange.


@dataclass(frozen=True)
class Undercut:
    """What a declared snap fit or flexible part bends or stretches over.

    Attributes:
        part: Name of the part that leaves.
        other: Name of the part that it leaves; of several, that with the largest undercut.
        direction: "+x" ... "-z", in which it does.
        width: By how much it bends or stretches [m]; 0 if nothing is in the way.
        kind: "snap" or "flexible", as declared.
    """

    part: str
    other: str
    direction: str
    width: float
    kind: str


def undercut(moving: Solid, staying: Solid, direction: str, tolerance: float) -> float:
    """Return the undercut that holds a part against leaving along a direction [m].

    Args:
        moving: The part that leaves.
        staying: The part that it leaves.
        direction: "+x" ... "-z".
        tolerance: Height of overlap that does not count [m].
    """
    # Leaving along -d is the other part leaving along +d.
    pair = (moving, staying) if direction[0] == "+" else (staying, moving)
    views: list[Envelope] = [envelope(solid, axis_index(direction)) for solid in pair]
    faces = crossing_faces(views[0].down, views[1].up, tolerance)
    if not len(faces):
        return 0.0
    regions = blocked_regions([faces], tolerance)
    filled = regions.chosen(regions.areas() > 0.0)
    return 2.0 * _widest_disc(filled) if filled.count.size else 0.0


def _widest_disc(regions: Polygons) -> float:
    """Return the radius of the largest disc in the union of some regions [m]."""
    corners = regions.closed()
    most = float((corners.max(axis=(0, 1)) - corners.min(axis=(0, 1))).min()) / 2.0
    least = 0.0
    for _ in range(HALVINGS):
        middle = (least + most) / 2.0
        if point_in_wide_union([regions], middle) is None:
            most = middle
        else:
            least = middle
    return least


def snap_direction(part: Solid, other: Solid, tolerance: float) -> Undercut:
    """Return the direction in which a part leaves another with the smallest undercut."""
    widths = {j: undercut(part, other, j, tolerance) for j in DIRECTIONS}
    direction = min(DIRECTIONS, key=widths.__getitem__)
    return Undercut(part.name, other.name, direction, widths[direction], "snap")


def stretch_directions(
    part: Solid,
    others: Sequence[Solid],
    free: Mapping[str, Sequence[bool]],
    tolerance: float,
) -> list[Undercut]:
    """Return the directions in which a flexible part comes off all others with the least stretch.

    Args:
        part: The flexible part.
        others: All other parts.
        free: Per direction, for each of the others, whether the part leaves it without stretching.
        tolerance: Height of overlap that does not count [m].
    """
    found = []
    for j in DIRECTIONS:
        widths = [
            0.0 if leaves else undercut(part, other, j, tolerance)
            for other, leaves in zip(others, free[j], strict=True)
        ]
        widest = max(range(len(others)), key=widths.__getitem__)
        found.append(Undercut(part.name, others[widest].name, j, widths[widest], "flexible"))
    least = min(one.width for one in found)
    return [one for one in found if one.width <= ALIKE * least + tolerance]
