"""Whether the parallel gripper can grip a part in a posture, and at which width."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cell.products.product import Product
from planning.feasibility.solids import Solid
from planning.fixture_analysis.footprint import footprint

BELOW = "the hand would have to come from below, through the jig"
FROM_BELOW = 0.1  # Rise of an approach per length above which it comes from below, from the jig.


@dataclass(frozen=True, eq=False)
class GripAnalysis:
    """Grip widths of a product's parts.

    Attributes:
        product: For declared grasps.
        solids: Parts by name.
        stroke: Largest opening of the gripper [m].
        widths: Cache: width and obstacle of each part in each posture.
    """

    product: Product
    solids: Mapping[str, Solid]
    stroke: float
    widths: dict[tuple[str, bytes], tuple[float, str]] = field(default_factory=dict)

    def width(self, parts: Sequence[str], R_JA: np.ndarray) -> tuple[float, str]:
        """Return the smallest grip width of any of the parts [m], and the obstacle or "".

        A part with declared grasps is gripped by one of them, also by one with jaws made for more
        than the stroke, unless it comes from below in this posture. A part without grasps is
        gripped from above, across the narrowest place of its outline.
        """
        key = R_JA.tobytes()
        for name in (name for name in parts if (name, key) not in self.widths):
            self.widths[name, key] = self._width(name, R_JA)
        found = [self.widths[name, key] for name in parts]
        return min(found, key=lambda width: (bool(width[1]), width[0]))

    def _width(self, name: str, R_JA: np.ndarray) -> tuple[float, str]:
        part = self.product.parts[name]
        if part.grasps:
            R_JP = R_JA @ part.X_AP.rotation().matrix()
            usable = [
                grasp.width
                for grasp in part.grasps
                if R_JP[2] @ grasp.X_PJaw.rotation().matrix()[:, 2] < FROM_BELOW
            ]
            if usable:
                return min(usable), ""
            return min(grasp.width for grasp in part.grasps), BELOW
        outline = footprint((self.solids[name].vertices @ R_JA.T)[:, :2])
        width = 0.0 if outline is None else outline.narrowest
        if width <= self.stroke:
            return width, ""
        return width, f"{1e3 * width:.0f} mm across, the gripper opens {1e3 * self.stroke:.0f} mm"
