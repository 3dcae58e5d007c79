"""A generated machine with as many triangles as exported CAD: gears, finned housings, screws.

Stations in rows on a base plate, nine parts each, all mated from above: a finned housing held by
four screws, whose threads are drawn as overlaps of nominal and tap drill diameter; in it a bearing,
a stepped shaft, a gear that meshes with its neighbours, and a knob. A cover on pillars lies over
all. Fits are line to line with facets that do not match, and curved surfaces are finer than any
tolerance needs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold, OpType

PITCH = 70.0  # [mm] Of the stations.
TEETH, ADDENDUM, RADIUS = 48, 1.8, 35.0  # Of a gear; lengths in mm.
BACKLASH = 0.3  # Of a tooth's height: leaves 0.17 mm between two gears [M].
CORNERS = [(x, y, 0.0) for x in (-24.0, 24.0) for y in (-24.0, 24.0)]  # Of a station's screws.


def gear_line(stations: int, fineness: float = 1.0, overlap: float = 0.0) -> dict[str, Manifold]:
    """Return the parts by name, in assembled pose [mm].

    Args:
        stations: Number of stations; the machine has 9 parts for each, and 4 more.
        fineness: Facets per turn grow with it, and triangles with its square.
        overlap: By how much the cover is driven into its pillars [mm].
    """
    side = int(np.ceil(np.sqrt(stations)))
    low, width = -PITCH / 2, side * PITCH
    parts: dict[str, Manifold] = {}
    drilled: list[Manifold] = []
    for number in range(stations):
        place = [PITCH * (number % side), PITCH * (number // side), 0]
        for name, shape in _station(fineness, (number % side + number // side) % 2).items():
            parts[f"{name}_{number + 1}"] = shape.translate(place)
        drilled += [_rod(2.1, -12, 1, 32).translate(place).translate(at) for at in CORNERS]
    base = Manifold.cube([width, width, 20]).translate([low, low, -20])
    cover = Manifold.cube([width, width, 6]).translate([low, low, 90 - overlap])
    pillars = {
        f"pillar_{k + 1}": _rod(2, 0, 90, 64).translate([x, low + 2.5, 0])
        for k, x in enumerate((low + 2.5, low + width - 2.5))
    }
    return {"base": base - _union(drilled), **parts, **pillars, "cover": cover}


def _station(fineness: float, gap: int) -> dict[str, Manifold]:
    """Return the parts of one station in the order in which they are assembled.

    The gear has a tooth towards its neighbours, or, where ``gap`` is 1, a gap.
    """
    seats = [_half(5, 9, 18), _half(7, 18, 34), _half(5, 34, 48), _half(4, 48, 60)]
    turn = round(100 * fineness)  # Facets.
    ring = CrossSection.square([5, 10]).translate([5, 8])
    head = _rounded(_half(4.25, 5, 10), 1.5, turn // 2)
    screw = _turned(_merged([_half(2.5, -10, 5.5), head]), round(64 * fineness)) - _rod(2, 7, 11, 6)
    return {
        "housing": _housing(fineness),
        **{f"screw_{k + 1}": screw.translate(at) for k, at in enumerate(CORNERS)},
        "bearing": _turned(_rounded(ring, 0.8, turn // 3), turn),
        "shaft": _turned(_rounded(_merged(seats), 0.4, turn // 3), turn + 40),
        "gear": _gear(fineness).rotate([0, 0, gap * 180 / TEETH]),
        "knob": _knob(turn),
    }


def _housing(fineness: float) -> Manifold:
    """A cup with cooling fins all around, a flange, a seat for the bearing, and a floor."""
    turn = round(100 * fineness)
    fins = [_half(26, z, z + 1.5) for z in np.arange(7.0, 28.0, 3.0)]
    outside = _rounded(_merged([_half(22, 0, 30), *fins]), 0.5, turn // 4)
    flange = Manifold.cube([60, 60, 5]).translate([-30, -30, 0])
    holes = [_rod(2.7, -1, 6, 48).translate(at) for at in CORNERS]
    holes += [_rod(10, 8, 40, turn + 12), _rod(5.5, -1, 9, turn)]
    return (_turned(outside, turn + 20) + flange) - _union(holes)


def _gear(fineness: float) -> Manifold:
    """A spur gear with a bore, which lies on the shaft's shoulder; its flanks are in layers."""
    points = round(18 * fineness)  # Of a tooth's outline.
    angles = np.linspace(0, 2 * np.pi, TEETH * points, endpoint=False)
    radii = RADIUS + ADDENDUM * np.clip(1.6 * np.cos(TEETH * angles) - BACKLASH, -1, 0.9)
    outline = CrossSection([np.c_[radii * np.cos(angles), radii * np.sin(angles)]])
    teeth = Manifold.extrude(outline, 14, round(6 * fineness)).translate([0, 0, 34])
    return teeth - _rod(5, 33, 49, round(110 * fineness))


def _knob(turn: int) -> Manifold:
    """A round knob with a blind hole, pushed on the end of the shaft."""
    body = _turned(_rounded(_half(12, 50, 74), 9, turn), turn)
    grips = [
        _rod(4, 49, 75, turn // 2).translate([14 * np.cos(angle), 14 * np.sin(angle), 0])
        for angle in 2 * np.pi * np.arange(8) / 8
    ]
    return body - _union([*grips, _rod(4, 49, 60, turn - 10)])


def _half(radius: float, low: float, high: float) -> CrossSection:
    """The outline of a cylinder about the vertical axis of the plane."""
    return CrossSection.square([2 * radius, high - low]).translate([-radius, low])


def _merged(outlines: Sequence[CrossSection]) -> CrossSection:
    return CrossSection.batch_boolean(list(outlines), OpType.Add)


def _rounded(outline: CrossSection, radius: float, segments: int) -> CrossSection:
    """Round the outer corners."""
    core = outline.offset(-radius, JoinType.Miter)
    return core.offset(radius, JoinType.Round, circular_segments=segments)


def _turned(outline: CrossSection, facets: int) -> Manifold:
    """Turn the right half of an outline about the vertical axis of its plane, which becomes z."""
    return Manifold.revolve(outline, facets)


def _rod(radius: float, low: float, high: float, facets: int) -> Manifold:
    return Manifold.cylinder(high - low, radius, radius, facets).translate([0, 0, low])


def _union(shapes: Sequence[Manifold]) -> Manifold:
    return Manifold.batch_boolean(list(shapes), OpType.Add)
