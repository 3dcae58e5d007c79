"""The bed of beads while soft: a height field that yields under pressure and keeps its imprint.

An explicit plastic Winkler bed. Every cell carries an elastic spring in series with a plastic
slider: contact pressure p = k * penetration up to the yield pressure

    q_y = (p_membrane + p_gravity + p_vacuum) tan(phi) Nc + gamma Nq depth + T curvature,

a bearing capacity with the membrane's tension T, which grows with its stretch (Terzaghi's form).
Beyond q_y the surface sinks for good, and the displaced volume rises as a collar around the
contact (`cell.soft_jig.collar`). Stretch hardening matters: with constant q_y a punch runs away.

All quantities are in the jig frame J: z = 0 is the top of the base plate.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from cell.soft_jig.collar import Ledger, rise_weight, shoulder
from cell.soft_jig.footprints import Footprints
from cell.soft_jig.parameters import BagParameters, SoilParameters
from cell.soft_jig.samples import SurfaceSamples
from cell.soft_jig.stable import Carried, Springs, cross_matrix, largest_stiffness, normal_rows

Array = NDArray[np.float64]
Ceiling = tuple[NDArray[np.int64], Array]  # Cells under a part and its height over them [m].

_SCALARS = ("vacuum", "stretch", "tension", "_since_settled")


class Bed:
    """Height field over the aperture, with its plastic, elastic and frictional state.

    Attributes:
        heights: (n, n) plastic surface [m], 0 outside the aperture.
        active: (n, n) bool, cells inside the aperture.
        covered: (n, n) bool, cells under a part when the bed froze.
        axis: (n,) coordinates of the cell centres along x and y [m].
        vacuum: Confining pressure from the pump [Pa]; set by the owner.
    """

    def __init__(self, bag: BagParameters, soil: SoilParameters) -> None:
        self.bag, self.soil = bag, soil
        half = int(np.ceil(bag.aperture_radius / bag.cell))
        self.axis = np.arange(-half, half + 1, dtype=np.float64) * bag.cell
        self.x, self.y = np.meshgrid(self.axis, self.axis, indexing="ij")
        self._dome = self._cap(np.hypot(self.x, self.y))
        self.active = self._dome > 0
        self._rest_area = self._membrane_area(self._dome)
        self.vacuum = 0.0
        self.inflate()

    def _cap(self, radius: Array) -> Array:
        inside = np.maximum(self.bag.cap_radius**2 - radius**2, 0.0)
        return np.maximum(np.sqrt(inside) - (self.bag.cap_radius - self.bag.cap_height), 0.0)

    def inflate(self) -> None:
        """Blow the bag up: the bare cap again, every imprint gone."""
        self.heights = self._dome.copy()
        self.covered = np.zeros(self.heights.shape, dtype=bool)
        self._shrinkage = np.zeros_like(self.heights)
        self._settled = self.heights.copy()  # When the collar was raised last.
        self.ledger = Ledger()
        self._traction = np.zeros((self.heights.size, 2))
        self._pressure = np.zeros(self.heights.size)
        self._touched: dict[str, NDArray[np.int64]] = {}  # Cells under each part.
        self._carried: dict[str, Carried] = {}
        self._footprints = Footprints(self.axis, self.bag.cell, self.active)
        self._ceilings: dict[str, Ceiling] = {}  # Undersides over the bed in the latest step.
        self._step_done = False
        self._since_settled = 0.0
        self._update_yield()

    @property
    def volume(self) -> float:
        """Volume under the surface, with what is displaced but has not risen yet [m3]."""
        return float(self.heights.sum() * self.bag.cell**2 + self.ledger.waiting)

    @property
    def displaced(self) -> float:
        """Volume that waits to rise as a collar [m3]."""
        return self.ledger.waiting

    @property
    def contracted(self) -> float:
        """Volume by which the vacuum has drawn the surface in [m3]."""
        return float(self._shrinkage.sum() * self.bag.cell**2)

    @property
    def packing_fraction(self) -> float:
        """Share of the bag's volume that is beads; falls as they dilate, rises with the vacuum."""
        return self.bag.bead_volume / self.volume

    def _displace(self, before: float, heights: Array) -> None:
        """Book what the surface, whose heights summed up to `before`, has lost to a part."""
        self.ledger.displace(float(before - heights.sum()) * self.bag.cell**2, self.soil)

    def height_at(self, xy: Array) -> Array:
        """Return the surface height at (k, 2) points, bilinear [m]."""
        return self._interpolated(self.heights, xy)

    def height_beside(self, xy: Array) -> Array:
        """Return the height (k,) that the frozen bed has beside the parts in it [m].

        Cells that a part covered take the height of the nearest one beside it: a cell on a part's
        border is half in the imprint, and the part is up to `footprints.STAY` cells off the
        grid.
        """
        _, beside = map(
            np.asarray, ndimage.distance_transform_edt(self.covered, return_indices=True) or ()
        )
        return self._interpolated(self.heights[tuple(beside)], xy)

    def _interpolated(self, heights: Array, xy: Array) -> Array:
        index = (np.asarray(xy, dtype=float) - self.axis[0]) / self.bag.cell
        return ndimage.map_coordinates(heights, index.T, order=1, mode="nearest")

    # Pressing.

    def press(
        self,
        X_JP: tuple[Array, Array],
        V_JP: tuple[Array, Array],
        samples: SurfaceSamples,
        dt: float,
        inertia: Array | None = None,
    ) -> tuple[Array, Array]:
        """Push a part into the bed for one step.

        Args:
            X_JP: Rotation matrix (3, 3) and position (3,) [m] of the part.
            V_JP: Angular (3,) [rad/s] and linear (3,) [m/s] velocity of the part's origin.
            samples: The part's surface.
            dt: Step [s].
            inertia: (6, 6) spatial inertia about the part's origin in J, angular part first, of a
                part that moves under the returned force; None if its motion is prescribed. The
                force is then kept within what the step can carry (`cell.soft_jig.stable`).

        Returns:
            Force (3,) [N] on the part and torque (3,) [N m] about its origin, in J.
        """
        if self._step_done:
            self._ceilings.clear()
            self._step_done = False
        p_PQ_J, z, areas, cells = self._footprints.under(X_JP, samples)
        self._ceilings[samples.name] = (cells, z)
        touching = np.flatnonzero(z < self.heights.reshape(-1)[cells])
        V = np.concatenate(V_JP)
        carried = self._carried.setdefault(samples.name, Carried())
        if len(touching) == 0:
            self._carried[samples.name] = Carried(V, np.zeros(6), True)
            return np.zeros(3), np.zeros(3)
        arm, area, cells = p_PQ_J[touching], areas[touching], cells[touching]
        velocity = V_JP[1] + arm @ cross_matrix(V_JP[0]).T
        soften = 1.0
        if inertia is not None:
            # Of all that can touch: a modulus that followed the contact would do work on the part.
            most = largest_stiffness(inertia, p_PQ_J, areas, dt)
            soften = min(1.0, most / max(self.soil.stiffness, self.soil.shear_stiffness))
        springs = Springs(cells, z[touching], arm, area, soften * self.soil.stiffness)
        rising = velocity[:, 2]
        if inertia is not None:
            rising = self._rising(springs, carried, inertia, V, dt)
        pressure = self._sink(springs, rising, dt)
        sprung, traction = self._drag(springs, pressure, velocity[:, :2], dt)
        self._remember(samples.name, cells, pressure, sprung)
        force = np.column_stack([traction, pressure]) * area[:, None]
        moment = arm.T @ force
        torque = np.array([moment[k - 2, k - 1] - moment[k - 1, k - 2] for k in range(3)])
        total = force.sum(axis=0)
        self._carried[samples.name] = Carried(V, np.concatenate([torque, total]), True)
        return total, torque

    def _rising(
        self, springs: Springs, carried: Carried, inertia: Array, V: Array, dt: float
    ) -> Array:
        """Return how fast the points will rise after the step, those that rise now (m,) [m/s]."""
        rows = normal_rows(springs.arms)
        elastic = springs.modulus * (self.heights.reshape(-1)[springs.cells] - springs.z)
        limit = self.yield_pressure.reshape(-1)[springs.cells]
        damping = np.where(elastic < limit, springs.modulus * self.soil.recovery_time, 0.0)
        spring = np.minimum(elastic, limit) * springs.areas
        ahead = carried.ahead(inertia, rows, spring, damping * springs.areas, V, dt)
        # A point that has stopped rising is carried at once: no lag lets a heavy hand fall in.
        return np.minimum(rows @ ahead, rows @ V)

    def _sink(self, springs: Springs, rising: Array, dt: float) -> Array:
        """Return the contact pressure per point [Pa] and lower the cells that yield.

        A spring and a viscoplastic slider in series, by backward Euler: stable for any viscosity
        and step. Where the part rises, a damper takes away what the spring would throw back.
        """
        soil, cells, modulus = self.soil, springs.cells, springs.modulus
        heights, latest = self.heights.reshape(-1), self._pressure[cells]
        trial = heights[cells] - springs.z
        limit = self.yield_pressure.reshape(-1)[cells]
        relaxed = (trial + dt * limit / soil.viscosity) / (1 + dt * modulus / soil.viscosity)
        elastic = np.where(modulus * trial > limit, relaxed, trial)
        before = heights.sum()
        np.minimum.at(heights, cells, springs.z + elastic)
        self._displace(before, heights)
        # What the latest step has given too much is taken back, once.
        least = -max(float(latest @ springs.areas / springs.areas.sum()), 0.0)
        up, down = np.maximum(rising, 0.0), np.maximum(-rising, 0.0)
        damped = modulus * (elastic - soil.recovery_time * up) + soil.damping * down
        return np.maximum(damped, least)

    def _drag(
        self, springs: Springs, pressure: Array, slip: Array, dt: float
    ) -> tuple[Array, Array]:
        """Return the membrane's friction per point (m, 2) [Pa]: a spring that slips (Coulomb).

        First that of the spring alone, then with its damper.
        """
        soil, cells = self.soil, springs.cells
        stretched = springs.modulus * soil.shear_stiffness / soil.stiffness * dt * slip
        trial = self._traction[cells] - stretched
        size = np.sqrt(np.einsum("ij,ij->i", trial, trial))
        limit = soil.surface_friction * np.maximum(pressure, 0.0)
        trial *= np.minimum(1.0, limit / np.maximum(size, 1e-12))[:, None]
        return trial, trial - soil.damping * slip * (limit > 0)[:, None]

    def _remember(
        self, name: str, cells: NDArray[np.int64], pressure: Array, traction: Array
    ) -> None:
        """Keep what is under a part; a cell that it has left forgets."""
        before = self._touched.get(name, cells)
        self._traction[before], self._pressure[before] = 0.0, 0.0
        self._traction[cells], self._pressure[cells] = traction, pressure
        self._touched[name] = cells

    # The slow part: collar, stretch, yield pressure.

    def settle(self, dt: float) -> None:
        """Advance the clock; every `settle_period` raise the collar and the yield pressure."""
        self._step_done = True
        self._since_settled += dt
        if self._since_settled < self.soil.settle_period - dt / 2:
            return
        self._since_settled = 0.0
        if self.displaced > 0:
            self._raise_collar()
            self._settled = self.heights.copy()
        self._update_yield()

    def underside_over_bed(self, name: str) -> Array:
        """Return the height (n, n) of a part's underside in the latest step; infinite elsewhere."""
        return self._lowest([self._ceilings[name]] if name in self._ceilings else [])

    def _ceiling(self) -> Array:
        return self._lowest(self._ceilings.values())

    def _lowest(self, undersides: Iterable[Ceiling]) -> Array:
        lowest = np.full(self.heights.size, np.inf)
        for cells, z in undersides:
            np.minimum.at(lowest, cells, z)
        return lowest.reshape(self.heights.shape)

    def _raise_collar(self) -> None:
        """Spread the displaced volume around the contact, below whatever hangs over the bed."""
        ceiling = self._ceiling()
        touched = ceiling <= self.heights
        if not touched.any():
            return
        cell = self.bag.cell
        sunk = np.maximum(self._settled - self.heights, 0.0)
        drop = shoulder(touched, sunk, self.heights, cell, self.soil)
        drop = np.minimum(drop, np.maximum(self.heights - self.bag.floor, 0.0))
        self.heights = self.heights - drop
        self.ledger.waiting += float(drop.sum()) * cell**2
        weight = np.where(self._dome > self.bag.floor, rise_weight(touched, cell, self.soil), 0.0)
        for _ in range(4):
            if self.displaced <= 1e-15 or not weight.any():
                return
            rise = weight * (self.displaced / (weight.sum() * cell**2))
            raised = np.minimum(self.heights + rise, np.maximum(ceiling, self.heights))
            self.ledger.waiting -= float((raised - self.heights).sum()) * cell**2
            self.heights = raised
            weight = np.where(raised < ceiling, weight, 0.0)

    def _membrane_area(self, heights: Array) -> float:
        dx, dy = np.gradient(heights, self.bag.cell)
        return float(np.sqrt(1 + dx**2 + dy**2)[self.active].sum())

    def _update_yield(self) -> None:
        soil, cell = self.soil, self.bag.cell
        dx, dy = np.gradient(self.heights, cell)
        slope = np.sqrt(1 + dx**2 + dy**2)
        self.stretch = soil.initial_stretch * np.sqrt(slope[self.active].sum() / self._rest_area)
        self.tension = soil.membrane_modulus * (1 - self.stretch**-6)  # Neo-Hookean sheet [N/m].
        curvature = np.gradient(dx / slope, cell, axis=0) + np.gradient(dy / slope, cell, axis=1)
        cohesion = self.confinement * np.tan(soil.friction_angle)
        depth = np.maximum(self._dome - self.heights, 0.0)
        self.yield_pressure = (
            cohesion * soil.cohesion_factor
            + soil.bead_weight * soil.overburden_factor * depth
            + self.tension * np.maximum(curvature, 0.0)
        )

    @property
    def confinement(self) -> float:
        """Pressure that holds the beads together: membrane, their own weight and vacuum [Pa]."""
        membrane = 2 * self.tension / self.bag.cap_radius
        return float(membrane + self.soil.gravity_pressure + self.vacuum)

    # Freezing.

    def jam(self, contraction: float) -> None:
        """Freeze: grains settle at the held surface and the free surface shrinks a little.

        Args:
            contraction: Volumetric shrinkage; all of it appears as height, the base is rigid.
        """
        ceiling = self._ceiling()
        held = self.covered = ceiling <= self.heights
        conformed = np.where(held, np.maximum(ceiling, self.bag.floor), self.heights)
        self._displace(self.heights.sum(), conformed)
        self.heights = conformed
        self._shrinkage = np.where(held, 0.0, contraction * self.heights)
        self.heights = self.heights - self._shrinkage
        self._traction[:] = 0.0
        self._pressure[:] = 0.0
        self._carried.clear()

    def conform(self, X_JP: tuple[Array, Array], samples: SurfaceSamples) -> None:
        """Lower the surface to a part that has pushed the frozen bed aside.

        Args:
            X_JP: Rotation matrix and position of the part.
            samples: Its surface.
        """
        _, z, _, cells = self._footprints.under(X_JP, samples)
        heights = self.heights.reshape(-1)
        before = heights.copy()
        np.minimum.at(heights, cells, np.maximum(z, self.bag.floor))
        self._displace(before.sum(), heights)
        # What had shrunk there comes back beside the part, not under it.
        pushed = (heights < before).reshape(self.heights.shape)
        self.ledger.waiting += float(self._shrinkage[pushed].sum()) * self.bag.cell**2
        self._shrinkage[pushed] = 0.0

    def forget(self, name: str) -> None:
        """Forget what a part pressed on, by the name of its samples."""
        self._ceilings.pop(name, None)
        left = self._touched.pop(name, np.zeros(0, dtype=np.int64))
        self._traction[left], self._pressure[left] = 0.0, 0.0

    def unjam(self) -> None:
        """Let air in again: the shrinkage goes back, the imprint stays."""
        self.heights = self.heights + self._shrinkage
        self._shrinkage = np.zeros_like(self.heights)
        self.covered = np.zeros_like(self.covered)
        self._update_yield()

    # Saving.

    def state(self) -> dict[str, Any]:
        """Return a copy of everything that changes; `restore` continues bit for bit."""
        return {
            "heights": self.heights.copy(),
            "covered": self.covered.copy(),
            "traction": self._traction.copy(),
            "pressure": self._pressure.copy(),
            "touched": {name: cells.copy() for name, cells in self._touched.items()},
            "carried": {name: carried.row() for name, carried in self._carried.items()},
            "shrinkage": self._shrinkage.copy(),
            "yield_pressure": self.yield_pressure.copy(),
            "footprints": self._footprints.state(),
            "settled": self._settled.copy(),
            "ledger": self.ledger.array(),
            "scalars": np.array([getattr(self, name) for name in _SCALARS]),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Return to a saved state."""
        self.inflate()
        self.heights = state["heights"].copy()
        self.covered = state["covered"].copy()
        self._traction = state["traction"].copy()
        self._pressure = state["pressure"].copy()
        self._touched = {k: cells.copy() for k, cells in state.get("touched", {}).items()}
        self._carried = {k: Carried.from_row(row) for k, row in state.get("carried", {}).items()}
        self._shrinkage = state["shrinkage"].copy()
        self.yield_pressure = state["yield_pressure"].copy()
        self._footprints.restore(state.get("footprints", {}))
        self._settled = state["settled"].copy()
        self.ledger = Ledger(*map(float, state["ledger"]))
        for name, value in zip(_SCALARS, state["scalars"], strict=True):
            setattr(self, name, float(value))
