"""Undercuts: how far a part must bend or stretch to leave another along a direction.

A snap hook, or a belt between flanges, is mounted by bending it over an edge. Seen along the
direction, the two are in each other's way over some region, which lies within the outlines of both.
The undercut is how far the region's innermost point has to move sideways to be clear of the one or
the other outline, whichever is further: 0.8 mm for a hook 0.8 mm deep, the height of the flange for
a belt of any thickness. A part leaves along the direction of its smallest undercut.

Nothing bends out of a closed cavity, and an undercut of more than a tenth of the part's size is not
taken for one. Only the six directions are tried.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from manifold3d import CrossSection, FillRule, JoinType

from planning.feasibility.directions import DIRECTIONS, axis_index
from planning.feasibility.envelope import Faces, envelope
from planning.feasibility.face_pairs import blocked_regions, crossing_faces
from planning.feasibility.solids import Solid

HALVINGS = 14  # Bisects 40 mm to 2.5 um.
ALIKE = 1.05  # [A] Undercuts this close are equal: a belt leaves over either flange.
LARGEST = 0.1  # [A] Of the part's size: hooks, belts and O-rings bend by a few hundredths.
MM = 1e3  # Clipper rounds to fixed decimals: it works in millimetres.


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
    """Return the undercut that holds a part against leaving another along a direction [m].

    Args:
        moving: The part that leaves.
        staying: The part that it leaves.
        direction: "+x" ... "-z".
        tolerance: Height of overlap that does not count [m].
    """
    # Leaving along -d is the other part leaving along +d.
    pair = (moving, staying) if direction[0] == "+" else (staying, moving)
    below, above = (envelope(solid, axis_index(direction)) for solid in pair)
    faces = crossing_faces(below.down, above.up, tolerance)
    if not len(faces):
        return 0.0
    regions = blocked_regions([faces], tolerance)
    used = np.flatnonzero(regions.areas() > 0.0)
    if not len(used):
        return 0.0
    blocked = CrossSection(regions.chosen(used).outlines(MM), FillRule.NonZero)
    # What is in the way: of each part, all that lies beyond the faces of the other that are hit.
    top = above.up.high[faces.u[used], 2].min() - tolerance
    bottom = below.down.low[faces.d[used], 2].max() + tolerance
    upper = above.up.chosen(np.flatnonzero(above.up.high[:, 2] > bottom))
    lower = below.down.chosen(np.flatnonzero(below.down.low[:, 2] < top))
    return max(_depth(blocked, _outline(faces)) for faces in (upper, lower)) / MM


def _outline(faces: Faces) -> CrossSection:
    """Return the union of projected faces [mm]."""
    return CrossSection([MM * corners for corners in faces.corners], FillRule.NonZero)


def _depth(region: CrossSection, outline: CrossSection) -> float:
    """Return the largest distance of a region's points from the outside of an outline [mm]."""
    x0, y0, x1, y1 = outline.bounds()
    least, most = 0.0, min(x1 - x0, y1 - y0) / 2.0
    for _ in range(HALVINGS):
        middle = (least + most) / 2.0
        if (outline.offset(-middle, JoinType.Round) ^ region).is_empty():
            most = middle
        else:
            least = middle
    return least


def snap_direction(part: Solid, other: Solid, tolerance: float) -> Undercut | None:
    """Return the direction in which one part leaves another with the smallest undercut, if any."""
    if _encloses(part, other) or _encloses(other, part):
        return None
    widths = {j: undercut(part, other, j, tolerance) for j in DIRECTIONS}
    direction = min(DIRECTIONS, key=widths.__getitem__)
    if widths[direction] > LARGEST * max(_size(part), _size(other)):
        return None
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
    if any(_encloses(other, part) for other in others):
        return []
    found = []
    for j in DIRECTIONS:
        widths = [
            0.0 if leaves else undercut(part, other, j, tolerance)
            for other, leaves in zip(others, free[j], strict=True)
        ]
        widest = max(range(len(others)), key=widths.__getitem__)
        found.append(Undercut(part.name, others[widest].name, j, widths[widest], "flexible"))
    least = min(one.width for one in found)
    most = min(ALIKE * least + tolerance, LARGEST * _size(part))
    return [one for one in found if one.width <= most]


def _size(solid: Solid) -> float:
    return float(np.max(solid.upper - solid.lower))


def _encloses(outer: Solid, inner: Solid) -> bool:
    """Return whether a part lies in a closed cavity of another: within an inward shell of it."""
    if np.any(inner.lower < outer.lower) or np.any(inner.upper > outer.upper):
        return False
    shells = trimesh.Trimesh(outer.vertices, outer.faces, process=False).split(
        only_watertight=False
    )
    return any(
        shell.volume < 0.0
        and bool(np.all(inner.lower >= shell.bounds[0]) and np.all(inner.upper <= shell.bounds[1]))
        for shell in shells
    )
