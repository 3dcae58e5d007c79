"""Which parts block which others along one axis, with the margin of each decision.

Four rounds, each for the pairs that the previous one left undecided. Bounding boxes find parts
that pass each other. The widest faces, for all pairs of parts at once, settle most blocked pairs:
two large faces in each other's way suffice. Finely tessellated parts have no large faces: they are
looked at over a few probes, about which the outermost faces of both are compared. All faces that
can hit each other decide the rest; only regions made of slivers need their union.

A decision flips at some critical tolerance, below which the pair is blocked and above which it is
free. It is computed only where it matters: a pair blocked at 1.5 times the tolerance, or free at
half of it, is decided with a margin of at least half the tolerance (0.025 mm of 0.05).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planning.feasibility.clipping import Polygons, point_in_wide_union
from planning.feasibility.envelope import Envelope, Faces
from planning.feasibility.face_pairs import (
    DENSE,
    FacePairs,
    blocked_regions,
    crossing_faces,
    faces_about,
    heights_over,
    paired,
)

# Of the tolerance: a decision with less margin than this is reported. [D] Seen edge on, a layer of
# overlap as thick as the tolerance admits a disc of half the tolerance, and no larger.
FRAGILE = 0.5
ROUGHLY = 2  # [D] Halvings down to the eighth of a tolerance by which simplified surfaces are off.
HALVINGS = 5  # Bisects the 0.025 mm in which a fragile decision flips to 0.8 um, or to 6 um.

HEAD = 24  # Widest faces of each part that the second round uses, up and down.
TRIED = 6  # Widest common rectangles of two parts that the second round clips.
SHARE = 1_000_000  # Bounds the memory of the second round to some 10 MB.
FIRST = 32  # Widest pairs of faces of two parts that the third round clips first.
BATCH = 8192  # Pairs of faces clipped at once: bounds the memory to some MB.
GROUP = 50_000  # Pairs of faces held at once, of several pairs of parts.
PROBES = 12  # Faces of a finely tessellated part over which is looked before all are compared.
ABOUT = 2.0  # Tolerances about a probe within which a region must be wide enough.
SEEDS, NEAR = 4, 2.0  # Widest slivers, each merged with the slivers within this many tolerances.
WIDEST = 96  # Of those about the first, which suffice for most parts.


@dataclass(frozen=True, eq=False)
class Decision:
    """Whether one part hits another along the axis.

    Attributes:
        point: (2,) a point of the plane across the axis over which it is hit [m]; None if free.
        margin: Lower bound of the change of tolerance at which the decision flips [m].
    """

    point: np.ndarray | None
    margin: float


def decisions(
    views: Sequence[Envelope],
    tolerance: float,
    *,
    simplified: bool = False,
    wanted: np.ndarray | None = None,
    tell: Callable[[int], None] = lambda done: None,
) -> dict[tuple[int, int], Decision]:
    """Return a decision for each ordered pair (moving, stationary) whose boxes are in the way.

    Args:
        views: The n parts' envelopes along one axis.
        tolerance: Height of overlap and radius of the region that do not count [m].
        simplified: Whether faces are as large as the tolerance allows; then all of them are
            compared without probing.
        wanted: (n, n) bool: pairs to decide, none of them on the diagonal; None for all.
        tell: Is told how many ordered pairs have been decided.

    Pairs left out are free, by a margin of at least ``FRAGILE`` times the tolerance.
    """
    less, more = (1.0 - FRAGILE) * tolerance, (1.0 + FRAGILE) * tolerance
    pairs = _meeting_boxes(views, less)
    pairs = pairs if wanted is None else pairs[wanted[pairs[:, 0], pairs[:, 1]]]
    hits = _wide_hits(views, pairs, more)
    hits |= {} if simplified else _probed(views, pairs, hits, more)
    found = {pair: Decision(point, FRAGILE * tolerance) for pair, point in hits.items()}
    halvings = ROUGHLY if simplified else HALVINGS
    group: dict[tuple[int, int], FacePairs] = {}
    held = 0
    total = len(views) * (len(views) - 1) if wanted is None else np.count_nonzero(wanted)
    quick = int(total) - len(pairs)  # Decided by their boxes.
    for number, (i, k) in enumerate(((int(i), int(k)) for i, k in pairs)):
        if (i, k) in found:
            continue
        tell(quick + number)
        group[i, k] = crossing_faces(views[i].down, views[k].up, less)
        held += len(group[i, k])
        if held > GROUP:
            found |= _decided(group, tolerance, halvings)
            group, held = {}, 0
    return found | _decided(group, tolerance, halvings)


def _probed(
    views: Sequence[Envelope],
    pairs: np.ndarray,
    known: Mapping[tuple[int, int], np.ndarray],
    tolerance: float,
) -> dict[tuple[int, int], np.ndarray]:
    """Return a blocked point (2,) for finely tessellated parts that overlap about some probe."""
    hits: dict[tuple[int, int], np.ndarray] = {}
    for i, k in ((int(i), int(k)) for i, k in pairs):
        down, up = views[i].down, views[k].up
        if (i, k) in known or len(down.low) * len(up.low) <= DENSE:
            continue
        for probe in _deepest_probes(down, up, tolerance):
            around = blocked_regions([faces_about(down, up, probe, ABOUT * tolerance)], tolerance)
            point = point_in_wide_union([around.within(probe, ABOUT * tolerance)], tolerance)
            if point is not None:
                hits[i, k] = point
                break
    return hits


def _deepest_probes(down: Faces, up: Faces, tolerance: float) -> np.ndarray:
    """Return a few centres of faces (n, 2) over which the parts are in each other's way."""
    probes = np.concatenate(
        [
            faces.corners[np.linspace(0, len(faces.low) - 1, PROBES).astype(int)].mean(axis=1)
            for faces in (down, up)
        ]
    )
    low = np.maximum(down.lower[:2], up.lower[:2])
    high = np.minimum(down.upper[:2], up.upper[:2])
    probes = probes[((probes > low) & (probes < high)).all(axis=1)]
    if not len(probes):
        return probes
    bottoms = [h.min(initial=np.inf) for h in heights_over(down, probes)]
    tops = [h.max(initial=-np.inf) for h in heights_over(up, probes)]
    excess = np.array(tops) - np.array(bottoms)
    deepest = np.argsort(-excess)[:SEEDS]
    return probes[deepest[excess[deepest] > tolerance]]


def _meeting_boxes(views: Sequence[Envelope], tolerance: float) -> np.ndarray:
    """Return (p, 2) ordered pairs of parts whose boxes do not pass each other along the axis."""
    low, high = np.array([v.low for v in views]), np.array([v.high for v in views])
    meet = high[None, :, 2] > low[:, None, 2] + tolerance
    for axis in (0, 1):
        overlap = np.minimum(high[:, None, axis], high[None, :, axis])
        overlap -= np.maximum(low[:, None, axis], low[None, :, axis])
        meet &= overlap > 2.0 * tolerance
    np.fill_diagonal(meet, False)
    return np.argwhere(meet)


def _wide_hits(
    views: Sequence[Envelope], pairs: np.ndarray, tolerance: float
) -> dict[tuple[int, int], np.ndarray]:
    """Return a blocked point (2,) for each pair that two of their widest faces prove blocked."""
    down, up = _heads([v.down for v in views]), _heads([v.up for v in views])
    rows = max(1, SHARE // HEAD**2)
    hits: dict[tuple[int, int], np.ndarray] = {}
    for first in range(0, len(pairs), rows):
        chosen = pairs[first : first + rows]
        owner, d, u = _widest_rectangles(down, up, chosen, tolerance)
        regions = blocked_regions([paired(down, up, d, u)], tolerance)
        centres, radii = regions.discs()
        wide = np.flatnonzero(radii >= tolerance)
        for (i, k), centre in zip(chosen[owner[wide]], centres[wide], strict=True):
            hits.setdefault((int(i), int(k)), centre)
    return hits


def _heads(faces: Sequence[Faces]) -> Faces:
    """Return the widest faces of all parts in one, ``HEAD`` per part; padding has an empty box."""
    count = len(faces) * HEAD
    corners, planes = np.zeros((count, 3, 2)), np.zeros((count, 3))
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    for part, own in enumerate(faces):
        size = min(HEAD, len(own.low))
        place = slice(part * HEAD, part * HEAD + size)
        corners[place], planes[place] = own.corners[:size], own.planes[:size]
        low[place], high[place] = own.low[:size], own.high[:size]
    return Faces(0, corners, planes, low, high)


def _widest_rectangles(
    down: Faces, up: Faces, pairs: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (index into pairs, down-face, up-face) of the widest common rectangles."""
    d = pairs[:, :1] * HEAD + np.arange(HEAD)
    u = pairs[:, 1:] * HEAD + np.arange(HEAD)
    sizes = [
        np.minimum(down.high[d, axis][:, :, None], up.high[u, axis][:, None])
        - np.maximum(down.low[d, axis][:, :, None], up.low[u, axis][:, None])
        for axis in (0, 1)
    ]
    above = up.high[u, 2][:, None] > down.low[d, 2][:, :, None] + tolerance
    width = np.where(above, np.minimum(sizes[0], sizes[1]), 0.0)
    width = width.reshape(len(pairs), -1)
    widest = np.argpartition(-width, TRIED, axis=1)[:, :TRIED]
    owner, column = np.nonzero(np.take_along_axis(width, widest, axis=1) > 2.0 * tolerance)
    place = widest[owner, column]
    return owner, d[owner, place // HEAD], u[owner, place % HEAD]


def _decided(
    group: dict[tuple[int, int], FacePairs], tolerance: float, halvings: int
) -> dict[tuple[int, int], Decision]:
    """Decide pairs of parts from all their faces that can hit each other at the lower tolerance."""
    less, more = (1.0 - FRAGILE) * tolerance, (1.0 + FRAGILE) * tolerance
    group = {parts: pairs for parts, pairs in group.items() if len(pairs)}
    hits = _region_hits(group, more)
    found = {parts: Decision(point, FRAGILE * tolerance) for parts, point in hits.items()}
    for parts, pairs in group.items():
        if parts in found:
            continue
        ambiguous = _InBatches.of(pairs)
        if ambiguous.blocked_point(less) is None:
            found[parts] = Decision(None, FRAGILE * tolerance)
        elif (point := ambiguous.blocked_point(more)) is not None:
            found[parts] = Decision(point, FRAGILE * tolerance)
        else:
            found[parts] = _bisected(ambiguous, tolerance, halvings)
    return found


def _region_hits(
    group: Mapping[tuple[int, int], FacePairs], tolerance: float
) -> dict[tuple[int, int], np.ndarray]:
    """Return a blocked point (2,) where one region, or one with its neighbours, is wide enough."""
    hits: dict[tuple[int, int], np.ndarray] = {}
    seeds: dict[tuple[int, int], np.ndarray] = {}
    first = {parts: pairs.chosen(slice(FIRST)) for parts, pairs in group.items()}
    for parts, regions in _clipped(first, tolerance).items():
        widest = np.argsort(-regions.radii)[:SEEDS]
        centres = regions.centres[widest[regions.radii[widest] > 0.0]]
        if len(centres) and regions.radii[widest[0]] >= tolerance:
            hits[parts] = centres[0]
        else:
            seeds[parts] = centres
    for number, most in ((0, WIDEST), *((number, None) for number in range(SEEDS))):
        around = {
            parts: group[parts].near(centres[number], NEAR * tolerance).chosen(slice(most))
            for parts, centres in seeds.items()
            if parts not in hits and number < len(centres)
        }
        for parts, regions in _clipped(around, tolerance).items():
            point = _wide_point([regions], tolerance)
            if point is not None:
                hits[parts] = point
    return hits


@dataclass(frozen=True, eq=False)
class _Regions:
    """Blocked regions of one pair of parts with their areas, and a disc in each of them."""

    polygons: Polygons
    areas: np.ndarray
    centres: np.ndarray
    radii: np.ndarray


def _clipped(
    group: Mapping[tuple[int, int], FacePairs], tolerance: float
) -> dict[tuple[int, int], _Regions]:
    """Return the blocked regions of several pairs of parts, clipped and measured at once."""
    if not group:
        return {}
    polygons = blocked_regions(list(group.values()), tolerance)
    areas, (centres, radii) = polygons.areas(), polygons.discs()
    ends = np.cumsum([len(pairs) for pairs in group.values()])
    return {
        parts: _Regions(polygons.chosen(own), areas[own], centres[own], radii[own])
        for parts, own in (
            (parts, slice(end - len(pairs), end))
            for (parts, pairs), end in zip(group.items(), ends, strict=True)
        )
    }


def _bisected(ambiguous: _InBatches, tolerance: float, halvings: int) -> Decision:
    """Decide a pair of parts that is blocked at the lower tolerance and free at the higher."""
    point = ambiguous.blocked_point(tolerance)
    step = FRAGILE * tolerance * (1.0 if point is not None else -1.0)
    same, flipped = 0.0, 1.0  # [step] Where the decision is the same, and where it has flipped.
    for _ in range(halvings if len(ambiguous.pairs) < BATCH else halvings // 2):
        middle = (same + flipped) / 2
        changed = ambiguous.blocked_point(tolerance + middle * step)
        if (changed is None) == (point is None):
            same = middle
        else:
            flipped = middle
    return Decision(point, same * abs(step))


@dataclass(frozen=True, eq=False)
class _InBatches:
    """All faces of two parts that can hit each other, to be decided at several tolerances."""

    pairs: FacePairs
    batches: Sequence[FacePairs]

    @staticmethod
    def of(pairs: FacePairs) -> _InBatches:
        starts = range(0, len(pairs), BATCH)
        return _InBatches(pairs, [pairs.chosen(slice(start, start + BATCH)) for start in starts])

    def blocked_point(self, tolerance: float) -> np.ndarray | None:
        """Return a point (2,) of the plane over which the faces block, or None."""
        if len(self.batches) > 1 and (hits := _region_hits({(0, 1): self.pairs}, tolerance)):
            return hits[0, 1]
        slivers: list[_Regions] = []
        for batch in self.batches:
            regions = _clipped({(0, 1): batch}, tolerance)[0, 1]
            widest = int(regions.radii.argmax())
            if regions.radii[widest] >= tolerance:
                return regions.centres[widest]
            slivers.append(regions)
        return _wide_point(slivers, tolerance)


def _wide_point(slivers: Sequence[_Regions], tolerance: float) -> np.ndarray | None:
    """Return a point (2,) about which the slivers' union is wide enough, or None."""
    if sum(float(regions.areas.sum()) for regions in slivers) < np.pi * tolerance**2:
        return None
    filled = [regions.polygons.chosen(regions.areas > 0.0) for regions in slivers]
    return point_in_wide_union(filled, tolerance)
