"""The holding map: which wrench a fixture bears in each direction, from its contacts alone.

The part is rigid and rests on the fixture's contact springs (`cell.fixtures.contacts`): six unknown
displacements. From rest under its weight it is loaded in small increments along each direction:

    sum over the patches of (p n + q) A  -  suction  +  weight  +  F w  =  0
    p = clip(k (depth - yielded), 0, limit)          what exceeds the limit has given way for good
    |q| <= mu p                                      elastic up to there, then it slides (Coulomb)

Depth and slip follow from the displacement; forces turn with the part, and the weight moves with
its centre of mass. Yield, slip and lost suction are
remembered along the path, so that, unlike limit analysis over friction cones, the map cannot invent
clamping between opposite walls. A small viscosity carries the solution over the load at which the
part gives way; the load waits until the part has come to rest.

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
from cell.vectors import cross

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
# Friction is rigid in the simulation until it slides: springs that are this much stiffer than the
# normal ones slip at a twentieth of the way [A].
SHEAR = 5.0
# Viscosity of the pseudo-time [N per m and step], and the lever by which it holds turning [m].
VISCOSITY, LEVER = 2.0e3, 0.02
# A load begins with this force [N] and grows by this share of itself. It waits until the forces are
# in balance within half of what it grew by, but no more than some steps.
FIRST, GROWTH, PATIENCE = 0.02, 0.015, 100
LARGEST = 1e-4  # Displacement in an iteration [m].
ITERATIONS, SETTLING, MOST_STEPS = 3, 200, 5000


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
    most: float = 100.0,
) -> list[Bearing]:
    """Return what a fixture bears along each direction.

    Args:
        contacts: In the jig frame J.
        p_JG: (3,) centre of mass of the part [m].
        weight: Of the part [N].
        directions: (d, 6) wrenches about the centre of mass in J, moment [N m] first, then force
            [N]; each is applied as a growing multiple of itself.
        steady: (6,) wrench about the centre of mass that acts throughout, besides the weight.
        most: Multiple at which a ramp ends.
    """
    always = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -weight])
    always = always if steady is None else always + steady
    # Matrices are small: with threads of its own BLAS takes fifty times as long [M].
    with threadpool_limits(1, user_api="blas"):
        body = _Body(contacts, p_JG)
        rest = body.rest(always)
        return _ramp(body, rest, always, np.asarray(directions, dtype=float), most)


def _ramp(
    body: _Body, rest: _State, always: Array, directions: Array, most: float
) -> list[Bearing]:
    """Load a part at rest along all directions, each until it has moved or bears the most."""
    count = len(directions)
    state, moving = rest.repeated(count), np.arange(count)
    size = (
        np.linalg.norm(directions[:, 3:], axis=1)
        + np.linalg.norm(directions[:, :3], axis=1) / LEVER
    )
    load, grew, waited = np.zeros(count), FIRST / size, np.zeros(count)
    rows: list[list[Array]] = [[] for _ in range(count)]
    whole = max(float(body.suction.forces @ rest.intact[0]), 1e-9)
    for _ in range(MOST_STEPS):
        if not len(moving):
            break
        now, unbalanced = body.step(
            state.at(moving), always + load[moving, None] * directions[moving]
        )
        state.put(moving, now)
        motion = now.moved - rest.moved
        yielded = _over_area(now.yielded - rest.yielded, body.springs.areas)
        lost = (
            1.0 - now.intact @ body.suction.forces / whole
            if len(body.suction.forces)
            else 0.0 * yielded
        )
        for k, row in zip(
            moving, np.column_stack([load[moving], motion, yielded, lost]), strict=True
        ):
            rows[k].append(row)
        held = np.linalg.norm(motion[:, 3:], axis=1) < WAY
        held &= (np.linalg.norm(motion[:, :3], axis=1) < ANGLE) & (load[moving] < most)
        waited[moving] += 1
        balanced = (unbalanced < 0.5 * grew[moving] * size[moving]) | (waited[moving] > PATIENCE)
        grown = moving[held & balanced]
        waited[grown], grew[grown] = 0, GROWTH * load[grown] + FIRST / size[grown]
        load[grown] = np.minimum(load[grown] + grew[grown], most)
        moving = moving[held]
    tables = [np.array(own) for own in rows]
    height = -float(body.arms[:, 2].min(initial=0.0))
    return [Bearing.of(own[:, 0], own[:, 1:7], height, own[:, 7], own[:, 8]) for own in tables]


def _over_area(depths: Array, areas: Array) -> Array:
    """Return the depth (d,) that depths (d, n) of patches exceed over `YIELDED_AREA` [m]."""
    order = np.argsort(-depths, axis=1)
    reached = np.cumsum(areas[order], axis=1) >= YIELDED_AREA
    which = np.argmax(reached, axis=1)
    deepest = np.take_along_axis(depths, order, axis=1)[np.arange(len(depths)), which]
    return np.where(reached.any(axis=1), deepest, 0.0)


def _length(moved: Array) -> Array:
    """Return the size of displacements (d, 6): of a point at the lever `LEVER` [m]."""
    return np.linalg.norm(moved[:, 3:], axis=1) + LEVER * np.linalg.norm(moved[:, :3], axis=1)


@dataclass
class _State:
    """Displacement and memory of the contacts, for d loads at once.

    Attributes:
        moved: (d, 6) rotation [rad] and translation [m] since the part was put in.
        slip: (d, 2, n) from where the springs of friction are stretched [m].
        yielded: (d, n) [m].
        intact: (d, s) share of each suction patch that is left.
    """

    moved: Array
    slip: Array
    yielded: Array
    intact: Array

    def repeated(self, count: int) -> _State:
        """Return the first of the states, `count` times."""
        return self.at(np.zeros(count, dtype=np.int64))

    def at(self, which: NDArray[np.int64]) -> _State:
        """Return some of the states."""
        return _State(self.moved[which], self.slip[which], self.yielded[which], self.intact[which])

    def put(self, which: NDArray[np.int64], other: _State) -> None:
        """Replace some of the states."""
        self.moved[which], self.slip[which] = other.moved, other.slip
        self.yielded[which], self.intact[which] = other.yielded, other.intact


class _Body:
    """The equations of a part on contact springs, for many loads at once.

    The contact moves with the part, as that of a rigid part does in simulation: its normals turn
    with it. The displacement of a patch is that of the part over it, seen from the part.
    """

    def __init__(self, contacts: Contacts, p_JG: Array) -> None:
        self.springs, self.suction = springs, suction = contacts.springs, contacts.suction
        self.arms = arms = springs.points - p_JG
        lever = suction.points - p_JG
        level = np.abs(springs.normals[:, [2]]) > 0.9
        first = cross(springs.normals, np.where(level, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]]))
        first /= np.linalg.norm(first, axis=1)[:, None]
        axes = np.concatenate([springs.normals, first, cross(springs.normals, first)])
        levers = np.tile(arms, (3, 1))
        # What a turn R and a shift t of the part give along each axis b, at the arm r from its
        # centre of mass: b.(r - R'(r - t)), with R' the transpose.
        self.turned = _products(axes, levers)
        self.shifted = axes
        self.shear = SHEAR * springs.stiffness
        self.opening = _rows(suction.normals, lever)
        tiled = (np.tile(axis, (len(lever), 1)) for axis in np.eye(3))
        self.shifting = np.concatenate([_rows(axis, lever) for axis in tiled])
        along, one, two = _rows(axes, levers).reshape(3, -1, 6)
        pairs = ((along, along), (one, one), (one, two), (two, one), (two, two))
        self.products = np.concatenate([_products(a, b) for a, b in pairs])
        self.viscous = np.diag(VISCOSITY * np.array([LEVER, LEVER, LEVER, 1.0, 1.0, 1.0]) ** 2)

    def rest(self, load: Array) -> _State:
        """Return the one state in which the part rests under a load (6,)."""
        n, s = len(self.springs.areas), len(self.suction.forces)
        state = _State(np.zeros((1, 6)), np.zeros((1, 2, n)), np.zeros((1, n)), np.ones((1, s)))
        for _ in range(SETTLING):
            state, unbalanced = self.step(state, load[None])
            if unbalanced[0] < FIRST / 10:
                break
        return state

    def step(self, state: _State, load: Array) -> tuple[_State, Array]:
        """Return the state after a step of pseudo-time under loads (d, 6), and what is unbalanced.

        This is a force (d,) [N], moments by the lever `LEVER`.
        """
        moved = state.moved
        for _ in range(ITERATIONS):
            wrench, stiffness, _ = self._forces(state, moved)
            residual = wrench + load - (moved - state.moved) @ self.viscous
            change = np.linalg.solve(stiffness + self.viscous, residual[:, :, None])[:, :, 0]
            shorter = np.minimum(1.0, LARGEST / np.maximum(_length(change), 1e-12))
            moved = moved + change * shorter[:, None]
        wrench, _, after = self._forces(state, moved)
        left = wrench + load
        force = np.linalg.norm(left[:, 3:], axis=1) + np.linalg.norm(left[:, :3], axis=1) / LEVER
        return after, force

    def _forces(self, state: _State, moved: Array) -> tuple[Array, Array, _State]:
        """Return the contacts' wrench (d, 6), its stiffness (d, 6, 6), and what they remember."""
        springs, d = self.springs, len(moved)
        R = _rotations(moved[:, :3])
        shift = np.einsum("dji,dj->di", R, moved[:, 3:])
        back = np.eye(3) - R.transpose(0, 2, 1)
        way = (back.reshape(d, 9) @ self.turned.T + shift @ self.shifted.T).reshape(d, 3, -1)
        depth, place = springs.depths - way[:, 0], way[:, 1:]
        trial = springs.stiffness * (depth - state.yielded)
        pressure = np.clip(trial, 0.0, springs.limits)
        yielded = np.maximum(state.yielded, depth - springs.limits / springs.stiffness)
        traction = -self.shear * (place - state.slip)
        size = np.maximum(np.hypot(traction[:, 0], traction[:, 1]), 1e-9)
        share = np.minimum(1.0, springs.friction * pressure / size)
        traction *= share[:, None]
        slip = place + traction / self.shear
        local = np.concatenate([pressure[:, None], traction], axis=1) * springs.areas
        local = local.reshape(d, -1)
        force = np.einsum("dij,dj->di", R, local @ self.shifted)
        moments = R @ (local @ self.turned).reshape(d, 3, 3)  # Of each force, times each arm.
        torque = np.stack(
            [moments[:, k - 1, k - 2] - moments[:, k - 2, k - 1] for k in range(3)], axis=1
        )
        torque -= cross(moved[:, 3:], force)  # The centre of mass has moved.
        # A patch that yields or slides has no stiffness in that direction.
        touching = springs.areas * (trial > 0.0)
        normal = springs.stiffness * touching * (trial < springs.limits)
        sliding = traction * ((share < 1.0) / np.maximum(size * share, 1e-9))[:, None]
        one, two = sliding[:, 0], sliding[:, 1]
        shear = self.shear * touching * share
        both = -shear * one * two
        parts = [normal, shear * (1 - one**2), both, both, shear * (1 - two**2)]
        stiffness = (np.concatenate(parts, axis=1) @ self.products).reshape(d, 6, 6)
        pull, intact = self._pull(state.intact, moved)
        wrench = np.concatenate([torque, force], axis=1) + pull
        return wrench, stiffness, _State(moved, slip, yielded, intact)

    def _pull(self, intact: Array, moved: Array) -> tuple[Array, Array]:
        """Return the wrench of the suction (d, 6), and the share of each patch that is left."""
        suction, d = self.suction, len(moved)
        gap = moved @ self.opening.T
        way = (moved @ self.shifting.T).reshape(d, 3, -1) - gap[:, None] * suction.normals.T
        slid = np.sqrt(np.einsum("dks,dks->ds", way, way))
        open_share, slid_share = gap / suction.reach, slid / suction.slip
        closed = np.clip(1 - open_share, 0.0, 1.0) * np.clip(1 - slid_share, 0.0, 1.0)
        left = np.minimum(intact, closed)
        return -(left * suction.forces) @ self.opening, left


def _rows(axes: Array, arms: Array) -> Array:
    """Return the rows (n, 6) for unit vectors (n, 3) at arms (n, 3) from the centre of mass."""
    return np.column_stack([cross(arms, axes), axes])


def _products(a: Array, b: Array) -> Array:
    """Return the outer product of each row of a with that of b, flat (n, ...)."""
    return (a[:, :, None] * b[:, None, :]).reshape(len(a), -1)


def _rotations(turns: Array) -> Array:
    """Return the matrices (d, 3, 3) of small rotation vectors (d, 3), to first order.

    The second order would press each face of a prism deeper into its wall as the prism turns about
    its axis, where in truth the next face takes over.
    """
    skew = np.zeros((len(turns), 3, 3))
    for k in range(3):
        skew[:, k - 1, k - 2], skew[:, k - 2, k - 1] = turns[:, k], -turns[:, k]
    return np.eye(3) + skew
