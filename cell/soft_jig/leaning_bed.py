"""The frozen bed as a leaning part sees it: sheared until the part stands upright.

Under a part that leans, bodies side by side part or overlap in plan view, and its walls look down.
A horizontal shear that keeps every height undoes that: planes stay planes, the part's own axis
becomes vertical, and its facets tile the floor as they do when it stands straight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cell.soft_jig.bed import Bed
from cell.soft_jig.parameters import BagParameters

Array = NDArray[np.float64]

# Fixed-point steps to the bed's height under a sheared point: its slope times the lean is well
# below one, so each gains a digit or two.
STEPS = 4


@dataclass(frozen=True)
class LeaningBed:
    """A bed in coordinates sheared by `lean` about the height `level`.

    Attributes:
        bed: The frozen bed in J.
        lean: (2,) horizontal shift per height of the part's upright axis.
        level: Height at which both coordinates agree [m].
    """

    bed: Bed
    lean: Array = field(default_factory=lambda: np.zeros(2))
    level: float = 0.0

    @property
    def bag(self) -> BagParameters:
        """Return the bag's dimensions."""
        return self.bed.bag

    @property
    def middle(self) -> Array:
        """Return where the middle of the base plate is (2,) [m]."""
        return self.lean * self.level

    def upright(self, points: Array) -> Array:
        """Return (n, 3) points in J in sheared coordinates."""
        return self._sheared(points, -self.lean)

    def leaning(self, points: Array) -> Array:
        """Return (n, 3) sheared points in J."""
        return self._sheared(points, self.lean)

    def surface(self) -> Array:
        """Return the bed's surface points (n, 3)."""
        bed = self.bed
        columns = [bed.x[bed.active], bed.y[bed.active], bed.heights[bed.active]]
        return self.upright(np.stack(columns, axis=1).astype(float))

    def height_at(self, xy: Array) -> Array:
        """Return the surface height at (k, 2) points [m]."""
        return self._followed(self.bed.height_at, xy)

    def height_beside(self, xy: Array) -> Array:
        """Return the height (k,) of the bed beside the parts in it, `Bed.height_beside` [m]."""
        return self._followed(self.bed.height_beside, xy)

    def _followed(self, height_at: Callable[[Array], Array], xy: Array) -> Array:
        height = height_at(xy)
        if self.lean.any():
            for _ in range(STEPS):
                height = height_at(xy + np.multiply.outer(height - self.level, self.lean))
        return height

    def _sheared(self, points: Array, lean: Array) -> Array:
        shift = np.multiply.outer(points[:, 2] - self.level, lean)
        return np.column_stack([points[:, :2] + shift, points[:, 2]])
