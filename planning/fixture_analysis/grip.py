"""Whether the parallel gripper can carry a body in a posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cell.cad.hand_e import STROKE as FINGER_STROKE
from cell.products.product import Product
from planning.feasibility.algorithm import Geometry
from planning.fixture_analysis.footprint import footprint

STROKE = 2.0 * FINGER_STROKE  # [m] Both fingers: 50 mm.
BELOW = "the hand would have to come from below, through the jig"
WIDE = f"{{:.0f}} mm across, the gripper opens {1e3 * STROKE:.0f} mm"
FROM_BELOW = 0.1  # Rise of an approach per length above which it comes from below, from the jig.


@dataclass(frozen=True, eq=False)
class Gripper:
    """The gripper before a product's parts.

    Attributes:
        product: For declared grasps.
        geometry: Shapes.
        widths: What has been found of each part in each posture.
    """

    product: Product
    geometry: Geometry
    widths: dict[tuple[str, bytes], tuple[float, str]] = field(default_factory=dict)

    def width(self, parts: Sequence[str], R_JA: np.ndarray) -> tuple[float, str]:
        """Return the smallest width to grip of any of the parts [m], and what is against it or "".

        A part's declared grasps say how, also those with jaws made for more than the stroke; only
        those that come from below in this posture do not count. A part without any is gripped
        across the narrowest place of its outline from above.
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
            rises = [R_JP[2] @ grasp.X_PJaw.rotation().matrix()[:, 2] for grasp in part.grasps]
            usable = [
                grasp.width
                for grasp, rise in zip(part.grasps, rises, strict=True)
                if rise < FROM_BELOW
            ]
            if usable:
                return min(usable), ""
            return min(grasp.width for grasp in part.grasps), BELOW
        outline = footprint((self.geometry.solids[name].vertices @ R_JA.T)[:, :2])
        width = 0.0 if outline is None else outline.narrowest
        return width, WIDE.format(1e3 * width) if width > STROKE else ""
