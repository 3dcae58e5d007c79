"""A rigid part on the contact springs of a fixture: its equations, for many loads at once.

    sum over the polygons of (p n + q) A  -  suction  +  weight  +  F w  =  0
    p = min(mean of k (depth - yielded), limit)      over the patches of a polygon that touch
    |q| <= mu p                                      elastic up to there, then it slides (Coulomb)

p and q act at the middle of what touches of a polygon, as in simulation. Depth and slip follow from
the displacement; forces turn with the part, and the weight moves with its centre of mass. Yield,
slip and lost suction are remembered. A small viscosity carries the solution over the load at which
the part gives way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cell.fixtures.contacts import STRONG, Contacts
from cell.vectors import cross

Array = NDArray[np.float64]

# Friction is rigid in the simulation until it slides: springs that are this much stiffer than the
# normal ones slip at a twentieth of the way [A].
SHEAR = 5.0
# Viscosity of the pseudo-time [N per m and step], and the lever by which it holds turning [m].
VISCOSITY, LEVER = 1.0e3, 0.02
# Displacement in an iteration [m]: a part that ran a tenth of a millimetre into a wall that does
# not yield would be thrown off in the next one.
LARGEST, LARGEST_RIGID = 1e-4, 1e-5
ITERATIONS, SETTLING = 3, 200
AT_REST = 2e-3  # What may be unbalanced at rest [N].


@dataclass
class State:
    """Displacement and memory of the contacts, for d loads at once.

    Attributes:
        moved: (d, 6) rotation [rad] and translation [m] since the part was put in.
        slip: (d, 2, polygons) from where the springs of friction are stretched [m].
        yielded: (d, patches) [m].
        intact: (d, s) share of each suction patch that is left.
    """

    moved: Array
    slip: Array
    yielded: Array
    intact: Array

    def repeated(self, count: int) -> State:
        """Return the first of the states, `count` times."""
        return self.at(np.zeros(count, dtype=np.int64))

    def at(self, which: NDArray[np.int64]) -> State:
        """Return some of the states."""
        return State(self.moved[which], self.slip[which], self.yielded[which], self.intact[which])

    def put(self, which: NDArray[np.int64], other: State) -> None:
        """Replace some of the states."""
        self.moved[which], self.slip[which] = other.moved, other.slip
        self.yielded[which], self.intact[which] = other.yielded, other.intact


class SprungBody:
    """The equations of a part on contact springs.

    The contact moves with the part, as that of a rigid part does in simulation: its normals turn
    with it. The displacement of a patch is that of the part over it, seen from the part.

    Args:
        contacts: In the jig frame J.
        p_JG: (3,) centre of mass of the part [m].

    Attributes:
        areas: (n,) of the patches [m2].
        height: Of the centre of mass over the lowest patch [m].
        suction: As given.
    """

    def __init__(self, contacts: Contacts, p_JG: Array) -> None:
        springs, self.suction = contacts.springs.sorted(), contacts.suction
        self._springs, self.areas, self._polygons = springs, springs.areas, springs.polygons
        self._arms = springs.points - p_JG
        self.height = -float(self._arms[:, 2].min(initial=0.0))
        self._first = np.flatnonzero(np.diff(self._polygons, prepend=-1))
        self._limits, self._friction = springs.limits[self._first], springs.friction[self._first]
        # What a turn R and a shift t of the part give along an axis b, at the arm r from its centre
        # of mass: b.(r - R'(r - t)), with R' the transpose.
        self._turned = _products(springs.normals, self._arms)
        self._bounded = np.flatnonzero(np.isfinite(springs.bounds))
        self._bound_normals = springs.bound_normals[self._bounded]
        self._turned_bounds = _products(self._bound_normals, self._arms[self._bounded])
        along = _rows(springs.normals, self._arms)
        self._along = _products(along, along)
        # Friction acts by polygon: its two axes, at the middle of all of the polygon.
        share = springs.areas / self._total(springs.areas)[self._polygons]
        middles = self._total(share * self._arms.T).T
        self._normals = springs.normals[self._first]
        level = np.abs(self._normals[:, [2]]) > 0.9
        one = cross(self._normals, np.where(level, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]]))
        one /= np.linalg.norm(one, axis=1)[:, None]
        two = cross(self._normals, one)
        self._axes = np.stack([self._normals, one, two])
        self._across = np.concatenate([one, two])
        self._turned_across = _products(self._across, np.tile(middles, (2, 1)))
        self._soft = self._total(share * springs.stiffness)
        self._shear = SHEAR * self._soft
        rows = _rows(one, middles), _rows(two, middles)
        self._sliding = np.concatenate([_products(a, b) for a in rows for b in rows])
        lever = self.suction.points - p_JG
        self._opening = _rows(self.suction.normals, lever)
        tiled = (np.tile(axis, (len(lever), 1)) for axis in np.eye(3))
        self._shifting = np.concatenate([_rows(axis, lever) for axis in tiled])
        rigid = bool(np.any(springs.limits >= STRONG))
        self._largest = LARGEST_RIGID if rigid else LARGEST
        self._viscous = np.diag(VISCOSITY * np.array([LEVER, LEVER, LEVER, 1.0, 1.0, 1.0]) ** 2)

    def rest(self, load: Array) -> State:
        """Return the one state in which the part rests under a load (6,)."""
        n, g, s = len(self.areas), len(self._first), len(self.suction.forces)
        state = State(np.zeros((1, 6)), np.zeros((1, 2, g)), np.zeros((1, n)), np.ones((1, s)))
        for _ in range(SETTLING):
            state, unbalanced = self.step(state, load[None])
            if unbalanced[0] < AT_REST:
                break
        return state

    def step(self, state: State, load: Array) -> tuple[State, Array]:
        """Return the state after a step of pseudo-time under loads (d, 6), and what is unbalanced.

        This is a force (d,) [N], moments by the lever `LEVER`.
        """
        moved = state.moved
        for _ in range(ITERATIONS):
            wrench, stiffness, _ = self._forces(state, moved)
            residual = wrench + load - (moved - state.moved) @ self._viscous
            change = np.linalg.solve(stiffness + self._viscous, residual[:, :, None])[:, :, 0]
            shorter = np.minimum(1.0, self._largest / np.maximum(_length(change), 1e-12))
            moved = moved + change * shorter[:, None]
        wrench, _, after = self._forces(state, moved)
        return after, wrench_size(wrench + load)

    def _forces(self, state: State, moved: Array) -> tuple[Array, Array, State]:
        """Return the contacts' wrench (d, 6), its stiffness (d, 6, 6), and what they remember."""
        springs, d = self._springs, len(moved)
        R = _rotations(moved[:, :3])
        shift = np.einsum("dji,dj->di", R, moved[:, 3:])
        back = (np.eye(3) - R.transpose(0, 2, 1)).reshape(d, 9)
        depth = springs.depths - back @ self._turned.T - shift @ springs.normals.T
        away = back @ self._turned_bounds.T + shift @ self._bound_normals.T
        pressed = np.maximum(springs.stiffness * (depth - state.yielded), 0.0)
        pressed[:, self._bounded] *= depth[:, self._bounded] <= springs.bounds[self._bounded] - away
        touching = springs.areas * (pressed > 0.0)
        area = self._total(touching)
        some = np.maximum(area, 1e-12)
        middles = [self._total(touching * arm) / some for arm in self._arms.T]
        mean = self._total(springs.areas * pressed) / some
        pressure = np.minimum(mean, self._limits)
        over = ((mean - pressure) / self._soft)[:, self._polygons]
        yielded = state.yielded + over * (pressed > 0.0)
        place = (back @ self._turned_across.T + shift @ self._across.T).reshape(d, 2, -1)
        dragged = -self._shear * (place - state.slip)
        size = np.maximum(np.hypot(dragged[:, 0], dragged[:, 1]), 1e-9)
        share = np.minimum(1.0, self._friction * pressure / size)
        traction = dragged * share[:, None]
        slip = place + traction / self._shear
        acting = np.concatenate([pressure[:, None], traction], axis=1) * area[:, None]
        force = np.einsum("dij,dag,agj->dgi", R, acting, self._axes)
        middles = np.stack(middles, axis=2) - moved[:, None, 3:]  # The centre of mass has moved.
        torque = cross(middles.reshape(-1, 3), force.reshape(-1, 3)).reshape(force.shape)
        # A polygon that yields or slides has no stiffness in that direction.
        normal = springs.stiffness * touching * (mean < self._limits)[:, self._polygons]
        sliding = dragged * ((share < 1.0) / size)[:, None]
        shear = self._shear * area * share
        both = -shear * sliding[:, 0] * sliding[:, 1]
        first, second = (shear * (1.0 - sliding[:, k] ** 2) for k in range(2))
        stiffness = np.concatenate([first, both, both, second], axis=1) @ self._sliding
        stiffness = (stiffness + normal @ self._along).reshape(d, 6, 6)
        pull, intact = self._pull(state.intact, moved)
        wrench = np.concatenate([torque.sum(axis=1), force.sum(axis=1)], axis=1) + pull
        return wrench, stiffness, State(moved, slip, yielded, intact)

    def _total(self, of_patches: Array) -> Array:
        """Return the sums (..., polygons) over the patches of each polygon of values (..., n)."""
        return np.add.reduceat(of_patches, self._first, axis=-1)

    def _pull(self, intact: Array, moved: Array) -> tuple[Array, Array]:
        """Return the wrench of the suction (d, 6), and the share of each patch that is left."""
        suction, d = self.suction, len(moved)
        gap = moved @ self._opening.T
        way = (moved @ self._shifting.T).reshape(d, 3, -1) - gap[:, None] * suction.normals.T
        slid = np.sqrt(np.einsum("dks,dks->ds", way, way))
        open_share, slid_share = gap / suction.reach, slid / suction.slip
        closed = np.clip(1 - open_share, 0.0, 1.0) * np.clip(1 - slid_share, 0.0, 1.0)
        left = np.minimum(intact, closed)
        return -(left * suction.forces) @ self._opening, left


def wrench_size(wrenches: Array) -> Array:
    """Return the size (d,) of wrenches (d, 6) [N], moments by the lever `LEVER`."""
    return np.linalg.norm(wrenches[:, 3:], axis=1) + np.linalg.norm(wrenches[:, :3], axis=1) / LEVER


def _length(moved: Array) -> Array:
    """Return the size of displacements (d, 6): of a point at the lever `LEVER` [m]."""
    return np.linalg.norm(moved[:, 3:], axis=1) + LEVER * np.linalg.norm(moved[:, :3], axis=1)


def _rows(axes: Array, arms: Array) -> Array:
    """Return the rows (n, 6) for unit vectors (n, 3) at arms (n, 3) from the centre of mass."""
    return np.column_stack([cross(arms, axes), axes])


def _products(a: Array, b: Array) -> Array:
    """Return the outer product of each row of a with that of b, flat (n, ...)."""
    return (a[:, :, None] * b[:, None, :]).reshape(len(a), a.shape[1] * b.shape[1])


def _rotations(turns: Array) -> Array:
    """Return the matrices (d, 3, 3) of small rotation vectors (d, 3), to first order.

    The second order would press each face of a prism deeper into its wall as the prism turns about
    its axis, where in truth the next face takes over.
    """
    skew = np.zeros((len(turns), 3, 3))
    for k in range(3):
        skew[:, k - 1, k - 2], skew[:, k - 2, k - 1] = turns[:, k], -turns[:, k]
    return np.eye(3) + skew
