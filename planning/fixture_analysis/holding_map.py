"""The holding map: which wrench a fixture bears in each direction, from its contacts alone.

The part is rigid and rests on the fixture's contact springs (`cell.fixtures.contacts`): six unknown
displacements, see `sprung_body`. From rest under its weight it is loaded in small increments along
each direction. Yield, slip and lost suction are remembered along the path, so that, unlike limit
analysis over friction cones, the map cannot invent clamping between opposite walls. The load waits
until the part has come to rest.

A direction ends when the part has moved by 1 mm or 2 degrees. What fails first is one of
`CRITERIA`: each has a measure, and an amount at which it has failed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from cell.fixtures.contacts import Contacts
from planning.fixture_analysis.sprung_body import SprungBody, State, wrench_size

Array = NDArray[np.float64]

WAY, ANGLE = 1e-3, float(np.deg2rad(2.0))  # [m], [rad] At which a part no longer counts as held.
CRITERIA: Mapping[str, str] = {
    "slides": "its foot moves sideways by 1 mm",
    "lifts": "it rises by 1 mm",
    "sinks": "it goes down by 1 mm",
    "tips": "it turns about a level axis by 2 degrees",
    "turns": "it turns about the vertical by 2 degrees",
    "yields": "25 mm2 of the beads give way by 0.2 mm for good",
    "seal lost": "half of the suction is gone",
}
"""What can fail first, and when it has failed."""

YIELDED, YIELDED_AREA, SEAL_LOST = 2e-4, 2.5e-5, 0.5
# A load begins with this force [N] and grows by this share of itself. Once the part has moved by
# `EARLY` of what ends the ramp, the last growth is taken back, and it goes on by the smaller share.
# It waits until the forces are in balance within half of what it grew by, but no more than some
# steps.
FIRST, GROWTH, CAREFUL, PATIENCE = 0.05, 0.06, 0.01, 40
EARLY = 0.1
MOST_STEPS = 5000


@dataclass(frozen=True)
class Bearing:
    """What is borne in one direction.

    Attributes:
        load: In multiples of the direction, when the part has moved by 1 mm or 2 degrees.
        moved: Whether it has; else it bears more than that.
        criterion: What has failed first; "" if nothing has.
        margin: How much nearer to failing it then is than the next criterion: the ratio of their
            measures, each over the amount at which it has failed, minus 1.
        rotation, translation: (3,) of the part at that load [rad], [m].
    """

    load: float
    moved: bool
    criterion: str
    margin: float
    rotation: Array
    translation: Array

    @staticmethod
    def of(loads: Array, motion: Array, height: float, yielded: Array, lost: Array) -> Bearing:
        """Return what a ramp has shown, until it ended.

        Args:
            loads: (k,) in multiples of the direction, never falling.
            motion: (k, 6) rotation [rad] and translation [m] of the centre of mass.
            height: Of the centre of mass over the foot of the part [m].
            yielded: (k,) depth by which beads gave way over `YIELDED_AREA` [m].
            lost: (k,) share of the suction that is gone.
        """
        used = _used(motion, height, yielded, lost)
        way, angle = np.linalg.norm(motion[:, 3:], axis=1), np.linalg.norm(motion[:, :3], axis=1)
        moved = np.maximum(way / WAY, angle / ANGLE)
        end = _crossing(moved)
        first = _crossing(np.maximum(used.max(axis=1), moved))
        then = _between(used, first)
        ranked = np.sort(then)
        failed = max(float(moved[-1]), float(used.max())) >= 1.0
        criterion = list(CRITERIA)[int(np.argmax(then))] if failed else ""
        margin = float(ranked[-1] / max(ranked[-2], 1e-9)) - 1.0
        last = _between(motion, end)
        return Bearing(
            float(_between(loads, end)),
            bool(moved[-1] >= 1.0),
            criterion,
            margin,
            last[:3],
            last[3:],
        )


def _used(motion: Array, height: float, yielded: Array, lost: Array) -> Array:
    """Return the measure of each criterion over the amount at which it has failed (k, 7)."""
    foot = motion[:, 3:5] + height * np.column_stack([-motion[:, 1], motion[:, 0]])
    return np.column_stack(
        [
            np.linalg.norm(foot, axis=1) / WAY,
            motion[:, 5] / WAY,
            -motion[:, 5] / WAY,
            np.linalg.norm(motion[:, :2], axis=1) / ANGLE,
            np.abs(motion[:, 2]) / ANGLE,
            yielded / YIELDED,
            lost / SEAL_LOST,
        ]
    )


def _crossing(measure: Array) -> float:
    """Return the row, with its fraction, at which a measure (k,) first reaches 1; else the last."""
    above = np.flatnonzero(measure >= 1.0)
    if not len(above) or above[0] == 0:
        return float(above[0]) if len(above) else len(measure) - 1.0
    k = int(above[0])
    return k - 1 + float((1.0 - measure[k - 1]) / (measure[k] - measure[k - 1]))


def _between(rows: Array, at: float) -> Array:
    """Return a row at a fractional place."""
    k = min(int(at), len(rows) - 2) if len(rows) > 1 else 0
    return rows[k] + (at - k) * (rows[min(k + 1, len(rows) - 1)] - rows[k])


def sphere_of_forces(count: int) -> Array:
    """Return directions (count, 6) of a force of 1 N, spread evenly over the sphere."""
    k = np.arange(count) + 0.5
    height, angle = 1 - 2 * k / count, np.pi * (1 + np.sqrt(5)) * k
    level = np.sqrt(1 - height**2)
    force = np.column_stack([level * np.cos(angle), level * np.sin(angle), height])
    return np.column_stack([np.zeros((count, 3)), force])


def holding_map(
    contacts: Contacts,
    p_JG: Array,
    weight: float,
    directions: Array,
    *,
    steady: Array | None = None,
    most: float | Array = 100.0,
) -> list[Bearing]:
    """Return what a fixture bears along each direction.

    Args:
        contacts: In the jig frame J.
        p_JG: (3,) centre of mass of the part [m].
        weight: Of the part [N].
        directions: (d, 6) wrenches about the centre of mass in J, moment [N m] first, then force
            [N]; each is applied as a growing multiple of itself.
        steady: (6,) wrench about the centre of mass that acts throughout, besides the weight.
        most: Multiple at which a ramp ends, of all directions or (d,) of each.
    """
    always = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -weight])
    always = always if steady is None else always + steady
    # Matrices are small: with threads of its own BLAS takes fifty times as long [M].
    with threadpool_limits(1, user_api="blas"):
        body = SprungBody(contacts, p_JG)
        rest = body.rest(always)
        directions = np.asarray(directions, dtype=float)
        return _ramp(body, rest, always, directions, np.broadcast_to(most, len(directions)))


def _ramp(
    body: SprungBody, rest: State, always: Array, directions: Array, most: Array
) -> list[Bearing]:
    """Load a part at rest along all directions, each until it has moved or bears the most."""
    count = len(directions)
    state, moving, size = rest.repeated(count), np.arange(count), wrench_size(directions)
    load, grew, waited = np.zeros(count), FIRST / size, np.zeros(count)
    rows: list[list[Array]] = [[] for _ in range(count)]
    # What a growth is taken back to: state, load and rows before it.
    before, before_load, before_rows = rest.repeated(count), load.copy(), np.zeros(count, int)
    careful = np.zeros(count, dtype=bool)
    whole = max(float(body.suction.forces @ rest.intact[0]), 1e-9)
    for _ in range(MOST_STEPS):
        if not len(moving):
            break
        now, unbalanced = body.step(
            state.at(moving), always + load[moving, None] * directions[moving]
        )
        state.put(moving, now)
        motion = now.moved - rest.moved
        yielded = depth_over_area(now.yielded - rest.yielded, body.areas)
        lost = (
            1.0 - now.intact @ body.suction.forces / whole
            if len(body.suction.forces)
            else 0.0 * yielded
        )
        for k, row in zip(
            moving, np.column_stack([load[moving], motion, yielded, lost]), strict=True
        ):
            rows[k].append(row)
        way, angle = (np.linalg.norm(motion[:, k : k + 3], axis=1) for k in (3, 0))
        moved = np.maximum(way / WAY, angle / ANGLE)
        back = moving[(moved > EARLY) & ~careful[moving]]
        state.put(back, before.at(back))
        load[back], careful[back], waited[back] = before_load[back], True, 0
        for k in back:
            del rows[k][before_rows[k] :]
        held = (moved < 1.0) & (load[moving] < most[moving])
        held |= np.isin(moving, back)
        waited[moving] += 1
        balanced = (unbalanced < 0.5 * grew[moving] * size[moving]) | (waited[moving] > PATIENCE)
        grown = moving[held & (balanced | np.isin(moving, back))]
        early = grown[~careful[grown]]
        before.put(early, state.at(early))
        before_load[early], before_rows[early] = load[early], [len(rows[k]) for k in early]
        share, first = np.where(careful[grown], [[CAREFUL], [0.1]], [[GROWTH], [1.0]])
        waited[grown], grew[grown] = 0, share * load[grown] + first * FIRST / size[grown]
        load[grown] = np.minimum(load[grown] + grew[grown], most[grown])
        moving = moving[held]
    tables = [np.array(own) for own in rows]
    return [Bearing.of(own[:, 0], own[:, 1:7], body.height, own[:, 7], own[:, 8]) for own in tables]


def depth_over_area(depths: Array, areas: Array) -> Array:
    """Return the depth (d,) that depths (d, n) of patches exceed over `YIELDED_AREA` [m].

    Args:
        depths: By which each patch has given way [m].
        areas: (n,) of the patches [m2].
    """
    order = np.argsort(-depths, axis=1)
    reached = np.cumsum(areas[order], axis=1) >= YIELDED_AREA
    which = np.argmax(reached, axis=1)
    deepest = np.take_along_axis(depths, order, axis=1)[np.arange(len(depths)), which]
    return np.where(reached.any(axis=1), deepest, 0.0)
