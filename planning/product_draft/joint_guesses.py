"""Joints between parts, recognised from round features that are coaxial: screws and fits.

All in the product frame A, lengths in metres. A screw is a head and a shank of a standard size in a
hole that it is as thick as, or thicker; the hole is as wide as the shank where threads are drawn
line to line, and narrower where it is drawn as drilled. A fit is a shaft in a hole that is a little
wider.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cell.cad.round_features import Cylinder
from cell.products.screw_table import (
    HEAD_MISFIT,
    SIZE_MISFIT,
    SIZES,
    Head,
    ScrewSize,
    head_of,
    size_of,
)
from planning.product_draft.guess import Guess

Features = Mapping[str, Sequence[Cylinder]]  # By name of the part.

HEAD_WIDER = 1.3  # [A] Than the shank: the smallest of any standard is 1.5.
COAXIAL = 0.1  # [A] Of the radius: parts are drawn where they belong.
THREAD = 1.02  # [A] Hole over shank up to which it is threaded: clearance holes begin at 1.06.
TAPPED = 0.75  # [D] Of the diameter; tap drills, d - P, are 0.8 (M2) to 0.84 (M5) of it.
CLEARANCE_HOLE = 1.5  # [A] Hole over shank from which nothing guides it.
LOOSEST_FIT, LOOSEST = 0.12, 3e-4  # [M] Clearance of a fit: share of the radius, and [m] on top.
LINE_TO_LINE = 5e-6  # [A] Clearance below which a fit is drawn without one [m].
# [A] Radially, where none is drawn: near the wide end of H7/g6, 5 to 28 um in diameter at 10 mm and
# 7 to 41 um at 25 mm [R machinecalcs.com, ISO 286 fit table] [m].
SLIDING = 2e-5
TIGHTEST_PRESS = 0.02  # [A] Interference of a press fit, of the radius.


@dataclass(frozen=True)
class ScrewGuess:
    """A screw, where it is driven in and what it clamps.

    Attributes:
        part: Its name.
        size: Nominal size.
        head: The kind of head that it has.
        head_size: Diameter and height of the head as drawn [m].
        length: Of the shank [m].
        axis: (3,) from the shank to the head.
        p_AoP: (3,) centre of the underside of the head.
        into: Name of the part with the thread.
        clamps: Name of the part under the head.
        thread_depth: Engaged length [m].
        thread_hole, clamped_hole: Numbers of the holes in those parts.
    """

    part: str
    size: ScrewSize
    head: Head
    head_size: tuple[float, float]
    length: float
    axis: np.ndarray
    p_AoP: np.ndarray
    into: str
    clamps: str
    thread_depth: float
    thread_hole: int
    clamped_hole: int


@dataclass(frozen=True)
class FitGuess:
    """A shaft of one part in a hole of another.

    Attributes:
        shaft, hole: Names of the parts.
        shaft_number, hole_number: Numbers of their cylinders.
        clearance: Radial [m], negative for a press fit.
        depth: Overlap along the axis [m].
        diameter: Of the hole [m].
    """

    shaft: str
    hole: str
    shaft_number: int
    hole_number: int
    clearance: float
    depth: float
    diameter: float


def guess_screws(features: Features) -> tuple[list[ScrewGuess], list[Guess]]:
    """Return the screws among the parts, with the guesses, and of what only looks like one."""
    screws, guesses = [], []
    for part, cylinders in features.items():
        shape = _screw_shape(cylinders)
        if shape is None:
            continue
        shank, head, size = shape
        holes = _holes_around(part, shank, features)
        threaded = [h for h in holes if TAPPED <= h.ratio <= THREAD]
        passed = [h for h in holes if THREAD < h.ratio <= CLEARANCE_HOLE]
        looks = f"shank of {2e3 * shank.radius:.3g} mm, head of {2e3 * head.radius:.3g} mm"
        if size is None:
            if threaded and passed:
                known = f"sizes and bits are known from {SIZES[0].name} to {SIZES[-1].name}"
                guesses.append(Guess(part, f"not taken for a screw: {known}", looks, 0.7))
            continue
        # A chamfer or a dome belongs to the head.
        head_height = head.flare_high[1] - head.flare_low[1]
        kind, misfit = head_of(size, 2e3 * head.radius, 1e3 * head_height)
        if misfit > 2.0 * HEAD_MISFIT:
            continue
        if not threaded or not passed:
            lacks = "nothing under its head" if threaded else "no threaded hole around its shank"
            if misfit < HEAD_MISFIT:
                guesses.append(Guess(part, f"not taken for a screw: {lacks}", looks, 0.7))
            continue
        into = max(threaded, key=lambda h: h.overlap)
        # The underside of the head, and the clamped part that is nearest to it.
        under = shank.high
        clamped = min(passed, key=lambda h: abs(h.high - under))
        screws.append(
            ScrewGuess(
                part=part,
                size=size,
                head=kind,
                head_size=(2.0 * head.radius, head_height),
                length=shank.high - shank.flare_low[1],
                axis=shank.axis,
                p_AoP=shank.point + under * shank.axis,
                into=into.part,
                clamps=clamped.part,
                thread_depth=into.overlap,
                thread_hole=into.number,
                clamped_hole=clamped.number,
            )
        )
        drawn = "line to line" if into.ratio > 0.98 else f"at {100 * into.ratio:.0f} % of it"
        reason = f"{looks}; hole of '{into.part}' drawn {drawn}"
        what = f"{size.name} {kind.kind} screw into {into.part}, clamps {clamped.part}"
        guesses.append(Guess(part, what, reason, 0.95 if misfit < HEAD_MISFIT else 0.7))
    return screws, guesses


def guess_fits(
    features: Features, screws: Sequence[ScrewGuess]
) -> tuple[list[FitGuess], list[Guess]]:
    """Return the fits between parts that are no screws, one per pair, the deepest of each."""
    no_screws = [part for part in features if part not in {screw.part for screw in screws}]
    fits: dict[tuple[str, str], FitGuess] = {}
    more: dict[tuple[str, str], int] = {}
    for part in no_screws:
        for number, shaft in enumerate(features[part]):
            if shaft.hole:
                continue
            for around in _holes_around(part, shaft, features):
                hole = features[around.part][around.number]
                clearance = hole.mean_radius - shaft.mean_radius
                loosest = LOOSEST_FIT * hole.radius + LOOSEST
                if around.part not in no_screws or not (
                    -TIGHTEST_PRESS * hole.radius <= clearance <= loosest
                ):
                    continue
                pair = (part, around.part)
                more[pair] = more.get(pair, 0) + 1
                fit = FitGuess(
                    *pair, number, around.number, clearance, around.overlap, 2.0 * hole.radius
                )
                if pair not in fits or fit.depth > fits[pair].depth:
                    fits[pair] = fit
    return list(fits.values()), [_fit_guess(fit, more[pair]) for pair, fit in fits.items()]


def _fit_guess(fit: FitGuess, count: int) -> Guess:
    size = f"{1e3 * fit.diameter:.4g} mm, {1e3 * fit.depth:.3g} mm deep"
    several = f"; the deepest of {count} between them" if count > 1 else ""
    subject = f"{fit.shaft}, {fit.hole}"
    if abs(fit.clearance) < LINE_TO_LINE:
        what = f"sliding fit, {size}, clearance taken as {1e6 * SLIDING:.0f} um"
        return Guess(subject, what, f"drawn line to line{several}", 0.5)
    if fit.clearance < 0.0:
        what = f"press fit, {size}, interference {-1e6 * fit.clearance:.0f} um"
        return Guess(subject, what, f"shaft drawn wider than its hole{several}", 0.8)
    what = f"fit, {size}, clearance {1e6 * fit.clearance:.0f} um"
    return Guess(subject, what, f"coaxial shaft and hole{several}", 0.9)


def shafts_of(part: str, features: Features) -> set[int]:
    """Return the numbers of the bosses of a part that holes of others are around."""
    bosses = [number for number, cylinder in enumerate(features[part]) if not cylinder.hole]
    return {n for n in bosses if _holes_around(part, features[part][n], features)}


@dataclass(frozen=True)
class _Around:
    """A hole around a shaft: whose, which, how much wider, how far they overlap, its upper end."""

    part: str
    number: int
    ratio: float
    overlap: float
    high: float


def _holes_around(part: str, shaft: Cylinder, features: Features) -> list[_Around]:
    """Return the holes of other parts that a shaft is in; heights are along the shaft's axis."""
    found = []
    for other, cylinders in features.items():
        for number, drawn in enumerate(cylinders) if other != part else ():
            hole = drawn if drawn.axis @ shaft.axis > 0.0 else drawn.reversed()
            if not hole.hole or not hole.coaxial(shaft, COAXIAL * shaft.radius):
                continue
            overlap = min(hole.high, shaft.high) - max(hole.low, shaft.low)
            if overlap > 0.0:
                ratio = hole.mean_radius / shaft.mean_radius
                found.append(_Around(other, number, ratio, overlap, hole.flare_high[1]))
    return found


def _screw_shape(
    cylinders: Sequence[Cylinder],
) -> tuple[Cylinder, Cylinder, ScrewSize | None] | None:
    """Return shank and head of a part, the head at the upper end of their axis, and the size.

    The size is None if it is none of the table; one of the table is looked for first.
    """
    bosses = [cylinder for cylinder in cylinders if not cylinder.hole]
    unknown = None
    for head in sorted(bosses, key=lambda boss: -boss.radius):
        for shank in bosses:
            if (
                head.radius < HEAD_WIDER * shank.radius
                or not shank.coaxial(head, COAXIAL * shank.radius)
                or shank.length < 2.0 * shank.radius * (1.0 - SIZE_MISFIT)
            ):
                continue
            upright = (head, shank)
            if head.low + head.high < shank.low + shank.high:
                upright = (head.reversed(), shank.reversed())
            head_up, shank_up = upright
            if abs(head_up.flare_low[1] - shank_up.flare_high[1]) < 0.3 * shank.radius:
                size = size_of(2e3 * shank.radius)
                if size is not None:
                    return shank_up, head_up, size
                unknown = unknown or (shank_up, head_up, None)
    return unknown
