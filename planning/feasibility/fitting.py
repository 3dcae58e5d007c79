"""Motions of parts that overlap as they are meant to: threads, declared overlaps, coarse facets.

Before it is decided how they come apart, their common volume is cut out of one of them. A part that
holds several others, as a base does its screws, is cut for all of them, and decided against them at
once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from planning.feasibility.cad_threads import CadThread
from planning.feasibility.directions import DIRECTIONS, opposite, unit_vector
from planning.feasibility.helical_threads import unthreaded
from planning.feasibility.interference import Blocker, Interference, interference
from planning.feasibility.overlaps import Overlaps, fitted_pair
from planning.feasibility.solids import Solid
from planning.feasibility.tolerance import Tolerances

SAME_WAY = 0.9998  # Cosine of 1 degree.


def fitted_solids(
    solids: Mapping[str, Solid], overlaps: Overlaps, tolerances: Tolerances
) -> tuple[dict[str, Solid], list[tuple[str, str]]]:
    """Return the parts as what leaves them sees them, without overlaps that are meant.

    Args:
        solids: Parts by name.
        overlaps: Of the product.
        tolerances: Of the product.

    Returns:
        The parts, and the pairs that have been fitted to each other; of a thread, (bolt, nut).
    """
    fitted = dict(solids)
    pairs = [(thread.bolt, thread.nut) for thread in overlaps.threads]
    for name in dict.fromkeys(nut for _, nut in pairs):
        bolts = [(solids[one.bolt], one) for one in overlaps.threads if one.nut == name]
        fitted[name] = unthreaded(solids[name], bolts)
    for bolt, nut in overlaps.screws:
        fitted[nut] = fitted[nut].without(solids[bolt])
        pairs.append((bolt, nut))
    for one in overlaps.others:
        if one.kind:
            tolerance = tolerances.overlap_of(one.part, one.other)
            pair = fitted_pair(fitted[one.part], fitted[one.other], tolerance)
            fitted |= {solid.name: solid for solid in pair}
            pairs.append((one.part, one.other))
    return fitted, pairs


def refitted(
    leaving: Interference,
    fitted: Mapping[str, Solid],
    pairs: Sequence[tuple[str, str]],
    threads: Sequence[CadThread],
    tolerances: Tolerances,
) -> Interference:
    """Decide the entries of parts anew that have been fitted to each other.

    Against the axis of a thread that turns out one way only, they stay as they were.

    Args:
        leaving: M_j of the parts as they are drawn.
        fitted: The n parts, by name in matrix order, as ``fitted_solids`` returns them.
        pairs: Those that have been fitted to each other.
        threads: That were recognised.
        tolerances: Of the product.
    """
    if not pairs:
        return leaving
    involved = {name for pair in pairs for name in pair}
    own = [name for name in fitted if name in involved]
    place = {name: number for number, name in enumerate(own)}
    wanted = np.zeros((len(own), len(own)), bool)
    for part, other in pairs:
        wanted[place[part], place[other]] = wanted[place[other], place[part]] = True
    anew = interference([fitted[name] for name in own], tolerances.overlaps(own), wanted=wanted)
    decided = _decided(pairs, threads)
    free = {j: matrix.copy() for j, matrix in leaving.free.items()}
    margin = {j: matrix.copy() for j, matrix in leaving.margin.items()}
    numbers = {name: number for number, name in enumerate(fitted)}
    for moving, staying, j in decided:
        at, was = (numbers[moving], numbers[staying]), (place[moving], place[staying])
        free[j][at], margin[j][at] = anew.free[j][was], anew.margin[j][was]

    def is_decided(blocker: Blocker) -> bool:
        return (blocker.moving, blocker.staying, blocker.direction) in decided

    rest = [blocker for blocker in leaving.blockers if not is_decided(blocker)]
    return Interference(free, (*rest, *filter(is_decided, anew.blockers)), margin)


def _decided(
    pairs: Sequence[tuple[str, str]], threads: Sequence[CadThread]
) -> set[tuple[str, str, str]]:
    """Return (moving, staying, direction) of all motions that the fitted shapes decide."""
    found = {(part, other, j) for part, other in pairs for j in DIRECTIONS}
    for thread in threads:
        if not thread.both_ways:
            axis = np.array(thread.axis)
            found -= {
                (thread.bolt, thread.nut, j)
                for j in DIRECTIONS
                if unit_vector(j) @ axis < -SAME_WAY
            }
    return found | {(other, part, opposite(j)) for part, other, j in found}
