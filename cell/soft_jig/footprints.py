"""Which cells of the bed each part is over, and how high its underside is there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cell.soft_jig.samples import SurfaceSamples, Underside

Array = NDArray[np.float64]

# Rotation after which the visible underside of a part is selected anew [rad]: the selection only
# decides which points stand for the surface, one per cell, so a fraction of a cell does not matter.
RESELECT_ANGLE = 0.01
# Share of a cell by which a part moves on before its points change cells; above one half.
STAY = 0.8


class Footprints:
    """The undersides of parts on a grid of cells; what is remembered is kept by the part's name.

    Args:
        axis: (n,) coordinates of the cells' centres along x and y of J [m].
        cell: Edge of a cell [m].
        active: (n, n) bool, cells that a part can touch.
    """

    def __init__(self, axis: Array, cell: float, active: NDArray[np.bool_]) -> None:
        self._axis, self._cell, self._active = axis, cell, active
        self._reference: dict[str, Array] = {}  # Orientation at which an underside was selected.
        self._shifts: dict[str, Array] = {}  # Of its points, in cells.
        self._undersides: dict[str, Underside] = {}

    def under(
        self, X_JP: tuple[Array, Array], samples: SurfaceSamples
    ) -> tuple[Array, Array, Array, NDArray[np.int64]]:
        """Return what of a part is over the grid, one point per cell.

        Args:
            X_JP: Rotation matrix (3, 3) and position (3,) [m] of the part.
            samples: The part's surface.

        Returns:
            Arms (m, 3) in J from the part's origin [m], heights (m,) of the underside over the
            cells' centres [m], projected areas (m,) [m2] and numbers (m,) of the cells.
        """
        R_JP, p_JP = X_JP
        underside = self._underside(R_JP, samples)
        p_PQ_J = underside.points @ R_JP.T
        n = len(self._axis)
        shift = self._shift_of(samples.name, p_JP[:2])
        # The grid's border lies outside the aperture: clipping drops points, it does not move them.
        column = np.clip(underside.bins + shift, 0, n - 1).astype(np.int64)
        flat = column[:, 0] * n + column[:, 1]
        keep = np.flatnonzero(self._active.reshape(-1)[flat])
        to_center = self._axis[0] + column * self._cell - p_JP[:2] - p_PQ_J[:, :2]
        z = p_PQ_J[:, 2] + p_JP[2] + np.einsum("ij,ij->i", underside.slopes, to_center)
        return p_PQ_J[keep], z[keep], underside.areas[keep], flat[keep]

    def _shift_of(self, name: str, p_JP: Array) -> Array:
        """Return by how many cells (2,) a part is shifted.

        One whole-cell shift for the part: its bins then cover the cells without gap or overlap. It
        is kept until the part is clearly in the next cell: a border that jumps into the wall and
        back as the part rocks would keep it rocking.
        """
        exact = (p_JP - self._axis[0]) / self._cell
        shift = self._shifts.get(name)
        if shift is None or np.abs(exact - shift).max() > STAY:
            shift = self._shifts[name] = np.rint(exact)
        return shift

    def _underside(self, R_JP: Array, samples: SurfaceSamples) -> Underside:
        name = samples.name
        reference = self._reference.get(name)
        if reference is None or np.sum(reference * R_JP) < 1 + 2 * np.cos(RESELECT_ANGLE):
            self._reference[name] = reference = R_JP.copy()
            self._undersides.pop(name, None)
        if name not in self._undersides:
            self._undersides[name] = samples.underside(reference, self._cell)
        return self._undersides[name]

    def state(self) -> dict[str, dict[str, Array]]:
        """Return a copy of what is remembered; the undersides follow from it."""
        return {
            "reference": {name: R_JP.copy() for name, R_JP in self._reference.items()},
            "shifts": {name: shift.copy() for name, shift in self._shifts.items()},
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Return to a saved state."""
        self._undersides.clear()
        self._reference = {name: R_JP.copy() for name, R_JP in state.get("reference", {}).items()}
        self._shifts = {name: shift.copy() for name, shift in state.get("shifts", {}).items()}
