"""Screw threads with real flanks: a bolt that leaves its nut by turning, and in no other way.

No name and no dimension is taken for granted. The axis comes from the normals of the surfaces that
the parts turn towards each other (``screw_axis``), the lead from how their sections in half-planes
through it shift from one to the next. What counts is the motion: as the bolt turns and advances,
the two must not share material, in the first turn and all the way out; without turning, they must,
around more than half of the axis.

The motion is verified for the two parts alone. What keeps the bolt from turning elsewhere, such as
a third part that holds its head, is not seen.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import manifold3d
import numpy as np
from manifold3d import CrossSection, JoinType, OpType

from planning.feasibility.axial_sections import (
    COUNT,
    axial_sections,
    filled_widths,
    meeting,
    shrunk,
)
from planning.feasibility.cad_threads import CadThread
from planning.feasibility.screw_axis import THREAD_CLEARANCE, screw_axis
from planning.feasibility.solids import Solid, boxes_apart

# [A] Of the thread's height: flanks drawn without clearance, on facets, cross by less; an overlap
# of this depth or of the tolerance, whichever is more, does not stop the motion.
CROSSING = 0.15
TRACE = 0.1  # Of that depth: smaller areas are the rounding of polygons that touch.
LEADS = (0.01, 4.0)  # [A] Of the diameter: from the finest threads to screws that push, not turn.
FUNDAMENTAL = 0.1  # Of the strongest wave: less is leakage of a spectrum of few turns.
CANDIDATES = 4  # Of the lead, the strongest in the spectrum of the sections.
HARMONICS = 4  # Waves of the pitch, a half, a third, a fourth of it: the shape of a thread.
GRID, PADDED = 256, 2048  # Heights at which sections are compared, and length of the transform.
FIRST_TURN = (1, 2, 3, 5, 7, 10, 13, 17, 20, 24)  # Steps of 15 degrees.
WAY_OUT = 32  # Further places of the bolt on its way out, spread over all angles.
GOLDEN = 0.618  # Its multiples, less whole numbers, are spread evenly.
ALIGNED = 1e-3  # Sine of 0.06 degrees to an axis of A: what facets do to a fit, 3e-4 [M].
OPEN = 0.9  # [A] Of a bore's radius: where it is open within this, it goes on.
FILM = 1e-6  # [m] Above the rounding of mesh files, below any tolerance.
ROUND = 96  # Facets of what is cut out of a nut.


def find_helical_thread(a: Solid, b: Solid, tolerance: float) -> CadThread | None:
    """Return the helical thread by which two interlocking parts are joined, or None.

    Args:
        a: One part.
        b: The other; either may be the bolt.
        tolerance: Depth of overlap that does not count [m].

    It takes 0.2 s for a pair of 25,000 faces and 1 s for 300,000. Call it for parts that are near
    each other and blocked in all six directions. Only these two parts are looked at: whether others
    keep the bolt from turning, such as a pocket for its head, is not.
    """
    found = screw_axis(a, b)
    if found is None or not min(found.outward) < 0.0 < max(found.outward):
        return None
    bolt, nut = (a, b) if found.outward[0] > 0.0 else (b, a)
    pair = _sectioned(bolt, nut, found.axis, found.p_AoC, tolerance)
    if pair is None:
        return None
    for lead, starts in pair.leads():
        if not pair.held(lead / starts):
            continue
        ways = {sign: pair.leaves(sign, lead) for sign in (1, -1)}
        if any(ways.values()):
            break
    else:
        return None
    # The bolt leaves on the side on which it protrudes further from the nut, if it can.
    bolt_along, nut_along = bolt.vertices @ found.axis, nut.vertices @ found.axis
    ahead, behind = bolt_along.max() - nut_along.max(), nut_along.min() - bolt_along.min()
    sign = 1 if ways[1] and (ahead >= behind or not ways[-1]) else -1
    axis = np.where(np.abs(found.axis) < ALIGNED, 0.0, found.axis)
    axis = sign * axis / np.linalg.norm(axis)
    middle = found.p_AoC + found.axis * 1e-3 * (pair.low + pair.high) / 2.0
    # Corners of the crests lie on the nominal diameter; what interlocks is a little less.
    corners = bolt.vertices - middle
    along = np.abs(corners @ found.axis) <= 0.5e-3 * (pair.high - pair.low)
    radii = np.linalg.norm(np.cross(corners[along], found.axis), axis=1)
    inner, outer = 1e-3 * pair.inner, 1e-3 * pair.outer
    outer = float(radii[radii < outer + CROSSING * (outer - inner)].max(initial=outer))
    x, y, z = (float(value) + 0.0 for value in axis)
    px, py, pz = (float(value) for value in middle)
    return CadThread(
        bolt=bolt.name,
        nut=nut.name,
        axis=(x, y, z),
        p_AoT=(px, py, pz),
        diameter=2.0 * outer,
        height=outer - inner,
        length=1e-3 * (pair.high - pair.low),
        pitch=1e-3 * lead / starts,
        starts=starts,
        both_ways=all(ways.values()),
    )


def helical_threads(
    pairs: Iterable[tuple[Solid, Solid]], tolerance: float
) -> tuple[CadThread, ...]:
    """Return the helical threads among pairs of parts that are near enough to have one.

    Args:
        pairs: Parts of which neither leaves the other along the six directions.
        tolerance: Depth of overlap that does not count [m].
    """
    near = [(a, b) for a, b in pairs if not boxes_apart(a, b, THREAD_CLEARANCE)]
    found = [find_helical_thread(a, b, tolerance) for a, b in near]
    return tuple(thread for thread in found if thread is not None)


def unthreaded(nut: Solid, bolts: Sequence[tuple[Solid, CadThread]]) -> Solid:
    """Return what of a nut still blocks the bolts that leave it by turning.

    Args:
        nut: Part with the inner threads.
        bolts: Parts with the outer ones, each with the thread found between it and the nut.

    Returns:
        The nut without the turns of its threads, from the engaged ones on in the direction in which
        a bolt turns out, or all of them if it turns out both ways. What lies further in or further
        out than a thread stays, and so do steps and caps on the other side. Of a thread drawn as
        overlapping cylinders, the overlap is cut, and the rest of its bore is widened as if it were
        tapped from end to end: a set screw lies deep in its hole.
    """
    turns = [_turns(nut, bolt, thread) for bolt, thread in bolts if thread.pitch is not None]
    if turns:
        nut = nut.shaped(nut.manifold - manifold3d.Manifold.batch_boolean(turns, OpType.Add))
    for bolt, thread in bolts:
        if thread.pitch is None:
            nut = _tapped(nut.without(bolt), bolt, thread)
    return nut


def _turns(nut: Solid, bolt: Solid, thread: CadThread) -> manifold3d.Manifold:
    """Return the space that the turns of a helical thread take, as far as the bolt turns out."""
    axis, middle = np.array(thread.axis), np.array(thread.p_AoT)
    far = _reach(nut, bolt)
    start = -far if thread.both_ways else -thread.length / 2.0
    # Half a height wider than the teeth, so that no slivers of them are left.
    outer = (thread.diameter + thread.height) / 2.0 / np.cos(np.pi / ROUND)
    inner = max((thread.diameter - 3.0 * thread.height) / 2.0, thread.diameter / 8.0)
    tube, bore = (manifold3d.Manifold.cylinder(far - start, r, r, ROUND) for r in (outer, inner))
    return (tube - bore).translate([0.0, 0.0, start]).transform(np.c_[_frame(axis), middle])


def _reach(nut: Solid, bolt: Solid) -> float:
    """Return a length beyond both parts [m]."""
    low, high = np.minimum(nut.lower, bolt.lower), np.maximum(nut.upper, bolt.upper)
    return float(np.linalg.norm(high - low))


def _tapped(nut: Solid, bolt: Solid, thread: CadThread) -> Solid:
    """Return a nut whose bore has the thread's outer diameter as far as it is open.

    That matters on the sides on which the bolt ends in the bore, unless its head keeps it from
    leaving there.
    """
    axis, middle = np.array(thread.axis), np.array(thread.p_AoT)
    corners = bolt.vertices - middle
    along, radii = corners @ axis, np.linalg.norm(np.cross(corners, axis), axis=1)
    wide = radii > 1.02 * thread.diameter / 2.0
    end = thread.length / 2.0 + FILM
    ends_inside = [
        sign
        for sign in (1.0, -1.0)
        if not (sign * along > end).any() and not (wide & (-sign * along > end)).any()
    ]
    if not ends_inside:
        return nut
    outer = thread.diameter / 2.0 / np.cos(np.pi / ROUND)
    inner, far = OPEN * (thread.diameter / 2.0 - thread.height), _reach(nut, bolt)
    shape = nut.manifold
    for sign in ends_inside:
        frame = np.c_[_frame(sign * axis), middle]
        bore = manifold3d.Manifold.cylinder(far, inner, inner, ROUND).transform(frame)
        inside = np.array((shape ^ bore).to_mesh64().vert_properties)[:, :3]
        depth = sign * (inside - middle) @ axis
        # A film of rounding at the end of the engaged thread does not close the bore.
        open_to = float(depth[depth > end].min(initial=far))
        shape -= manifold3d.Manifold.cylinder(open_to, outer, outer, ROUND).transform(frame)
    return nut.shaped(shape)


def _frame(axis: np.ndarray) -> np.ndarray:
    """Return R_AS (3, 3) of a frame S whose z is the axis."""
    x = np.linalg.svd(axis[None])[2][1]
    return np.array([x, np.cross(axis, x), axis]).T


def _sectioned(
    bolt: Solid, nut: Solid, axis: np.ndarray, centre: np.ndarray, tolerance: float
) -> _Pair | None:
    """Return the sections of two parts, or None if they do not interlock as they turn in place."""
    # Of the nut, what the bolt can reach: sections of a large plate with many holes take long.
    radii = np.linalg.norm(np.cross(bolt.vertices - centre, axis), axis=1)
    radius, far = float(radii.max()) + THREAD_CLEARANCE, _reach(nut, bolt)
    reached = manifold3d.Manifold.cube([2.0 * radius, 2.0 * radius, 2.0 * far], True)
    reached = reached.transform(np.c_[_frame(axis), centre])
    bolt_sections = axial_sections(bolt.manifold, axis, centre)
    nut_sections = axial_sections(nut.manifold ^ reached, axis, centre)
    # What the two share if either is turned on the spot: the heights of the thread, all around.
    shared = CrossSection.batch_boolean(bolt_sections, OpType.Add)
    shared ^= CrossSection.batch_boolean(nut_sections, OpType.Add)
    thin = 1e3 * tolerance / 4.0
    thick = shared.offset(-thin, JoinType.Miter, 2.0)
    if thick.is_empty():
        return None
    inner, low, outer, high = max(thick.decompose(), key=CrossSection.area).bounds()
    inner, low, outer, high = inner - thin, low - thin, outer + thin, high + thin
    depth = max(1e3 * tolerance, CROSSING * (outer - inner))
    pair = _Pair(shrunk(bolt_sections, depth), nut_sections, inner, outer, low, high, depth)
    # As it is drawn, the overlap must not be deeper either: as that of two plain cylinders is.
    drawn = meeting(pair.bolt, pair.nut, 0, 0.0).max()
    return pair if drawn <= pair.trace else None


@dataclass(frozen=True, eq=False)
class _Pair:
    """Sections of a bolt and a nut about their axis, and the band in which they interlock.

    Attributes:
        bolt: Sections of the bolt, smaller by the depth of overlap that does not count.
        nut: Sections of the nut.
        inner, outer: Radii of the band [mm].
        low, high: Its ends along the axis [mm].
        depth: Of overlap that does not count [mm].
    """

    bolt: list[CrossSection]
    nut: list[CrossSection]
    inner: float
    outer: float
    low: float
    high: float
    depth: float

    def leads(self) -> list[tuple[float, int]]:
        """Return likely (lead, number of starts), likeliest first; negative if left-handed [mm].

        In the spectrum of the sections over angle and height, a thread of m starts and pitch p
        shows at m waves a turn and 1 / p waves along the axis: roughly, since few turns are
        engaged. The lead itself is the one by which the sections must be shifted back, each by its
        angle, to lie on each other.
        """
        heights = np.linspace(self.low, self.high, GRID + 2)[1:-1]
        bolt, nut = (
            filled_widths(sections, self.inner, self.outer, heights)
            for sections in (self.bolt, self.nut)
        )
        widths = [width - width.mean(axis=0) for width in (bolt, nut)]
        power = sum(
            np.abs(np.fft.fft(np.fft.rfft(np.hanning(GRID) * w, PADDED, axis=1), axis=0)) ** 2
            for w in widths
        )
        spectrum, frequencies = np.asarray(power), np.fft.rfftfreq(PADDED, heights[1] - heights[0])
        found: list[tuple[float, float, int]] = []
        for waves in range(1, COUNT // 2):
            for hand in (1, -1):
                leads = waves / np.maximum(frequencies, 1e-9)
                low, high = (share * 2.0 * self.outer for share in LEADS)
                own = np.where((leads > low) & (leads < high), spectrum[-hand * waves], 0.0)
                found.append((float(own.max()), hand * float(leads[own.argmax()]), waves))
        refined = []
        every = np.arange(1, COUNT // 2)
        for _, rough, waves in sorted(found, reverse=True)[:CANDIDATES]:
            agreement, lead = _refined(rough, waves, widths, heights)
            # The fundamental counts the starts; its harmonics shift by the same lead.
            places = np.abs(frequencies[:, None] - every / abs(lead)).argmin(axis=0)
            strength = spectrum[(-1 if lead > 0.0 else 1) * every, places]
            starts = 1 + int(np.argmax(strength > FUNDAMENTAL * strength.max()))
            refined.append((agreement, lead, starts))
        return [(lead, starts) for _, lead, starts in sorted(refined, reverse=True)]

    def held(self, pitch: float) -> bool:
        """Return whether the thread keeps the bolt from moving along its axis without turning."""
        band = CrossSection.square([self.outer - self.inner, self.high - self.low])
        band = band.translate([self.inner, self.low])
        bolt, nut = ([section ^ band for section in own] for own in (self.bolt, self.nut))
        for sign in (1, -1):
            shifts = [sign * pitch * share for share in (0.25, 0.5, 0.75)]
            blocked = np.any([meeting(bolt, nut, 0, s) > self.trace for s in shifts], axis=0)
            around = np.flatnonzero(np.r_[blocked, blocked])
            if not len(around) or np.diff(around).max(initial=0) >= COUNT // 2:
                return False
        return True

    def leaves(self, sign: int, lead: float) -> bool:
        """Return whether the bolt turns out along the axis, or against it, without hitting."""
        bolt_low, bolt_high = _ends(self.bolt)
        nut_low, nut_high = _ends(self.nut)
        travel = nut_high - bolt_low if sign > 0 else bolt_high - nut_low
        last = int(np.ceil(travel / abs(lead) * COUNT))
        later = GOLDEN * np.arange(1, WAY_OUT + 1) % 1.0 * (last - COUNT) + COUNT
        places = [*FIRST_TURN, *sorted(later.astype(int))] if last > COUNT else [*FIRST_TURN]
        hand = sign if lead > 0.0 else -sign
        return all(
            meeting(self.bolt, self.nut, hand * n, hand * n * lead / COUNT).max() <= self.trace
            for n in places
        )

    @property
    def trace(self) -> float:
        """Area of common material that is rounding [mm2]."""
        return (TRACE * self.depth) ** 2


def _ends(sections: list[CrossSection]) -> tuple[float, float]:
    """Return the lowest and the highest point of sections along the axis [mm]."""
    boxes = np.array([section.bounds() for section in sections if not section.is_empty()])
    return float(boxes[:, 1].min()), float(boxes[:, 3].max())


def _refined(
    lead: float, waves: int, widths: list[np.ndarray], heights: np.ndarray
) -> tuple[float, float]:
    """Return how well sections lie on each other, 0 to 1, and the lead near a rough one [mm].

    What they have in common, once shifted back, is a sum of a few waves of the thread's pitch.
    """
    orders = waves * np.arange(1, HARMONICS + 1)
    back = np.exp(-2j * np.pi * np.outer(orders, np.arange(COUNT)) / COUNT)
    turned = np.concatenate([back @ width for width in widths])
    total = widths[0].size * sum((width**2).sum() for width in widths)

    def agreement(tried: float) -> float:
        along = np.exp(2j * np.pi * np.outer(orders, heights) / tried)
        common = (turned * np.tile(along, (len(widths), 1))).sum(axis=1)
        return float(2.0 * (np.abs(common) ** 2).sum() / total)

    reach = min(0.35, abs(lead) / waves / (heights[-1] - heights[0]))
    best = lead
    for step in (reach / 30.0, reach / 450.0):
        tried = best * (1.0 + step * np.arange(-30, 31))
        best = float(tried[np.argmax([agreement(value) for value in tried])])
    return agreement(best), best
