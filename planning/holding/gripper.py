"""Whether the parallel gripper can carry a body in a posture."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cell.cad.hand_e import STROKE as FINGER_STROKE
from cell.product import Product
from planning.fixing.algorithm import Geometry
from planning.holding.footprint import footprint

STROKE = 2.0 * FINGER_STROKE  # [m] Both fingers: 50 mm.
FROM_BELOW = 0.1  # Rise of an approach per length above which it comes from below, from the jig.


def grip_width(
    product: Product, geometry: Geometry, parts: Iterable[str], R_JA: np.ndarray
) -> tuple[float, bool]:
    """Return the smallest width to grip of any of the parts [m], and whether it can be gripped.

    A part's declared grasps say how, also those with jaws made for more than the stroke; only those
    that come from below in this posture do not count. A part without any is gripped across the
    narrowest place of its outline from above.
    """
    widths = [_width(product, geometry, name, R_JA) for name in parts]
    return min(widths, key=lambda width: (not width[1], width[0]))


def _width(product: Product, geometry: Geometry, name: str, R_JA: np.ndarray) -> tuple[float, bool]:
    part = product.parts[name]
    if part.grasps:
        R_JP = R_JA @ part.X_AP.rotation().matrix()
        rises = [R_JP[2] @ grasp.X_PJaw.rotation().matrix()[:, 2] for grasp in part.grasps]
        usable = [
            grasp.width for grasp, rise in zip(part.grasps, rises, strict=True) if rise < FROM_BELOW
        ]
        return min(usable, default=min(g.width for g in part.grasps)), bool(usable)
    outline = footprint((geometry.solids[name].vertices @ R_JA.T)[:, :2])
    width = 0.0 if outline is None else outline.narrowest
    return width, width <= STROKE
