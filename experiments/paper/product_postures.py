"""Postures of any product's parts, with the grasp by which the rig's hand can place them.

Those of the motor unit are the paper's. Of others it is each part that is no screw, with each of
the six axes up, as far as one of its grasps brings it in that posture: from above or from the side,
with jaws that close level.
"""

from __future__ import annotations

from cell.errors import UnknownName
from cell.products.product import Grasp, Part, Product
from cell.vectors import rotation_with_up
from experiments.paper.postures import POSTURES, Posture
from planning.feasibility.directions import DIRECTIONS

LEVEL = 0.05  # Sine up to which jaws close level, and sine above which a hand points up [A].


def postures_of(product: Product) -> list[Posture]:
    """Return the postures of the parts of a product in which they can be placed.

    Parts that are turned in the product are left out: their axes are not the product's.
    """
    if set(product.parts) >= {posture.part for posture in POSTURES.values()}:
        return list(POSTURES.values())
    loose = [part for name, part in product.parts.items() if name not in product.screws]
    upright = [p for p in loose if p.X_AP.rotation().IsNearlyIdentity(1e-9)]
    found = ((part, up, _grasp(part, up)) for part in upright for up in DIRECTIONS)
    return [
        Posture(part.name, up, up, f"its {up} up", grasp)
        for part, up, grasp in found
        if grasp is not None
    ]


def posture_named(product: Product, label: str) -> Posture:
    """Return the posture of a product's part with a label, for example "motor/P2" or "post/+z".

    Raises:
        UnknownName: None of its parts can be placed in one of this label.
    """
    known = {posture.label: posture for posture in postures_of(product)}
    if label not in known:
        raise UnknownName(f"posture of '{product.name}'", label, known)
    return known[label]


def _grasp(part: Part, up: str) -> Grasp | None:
    """Return the grasp that comes most from above with an axis up; None if none brings it."""
    R_JP, best, steepest = rotation_with_up(up).matrix(), None, LEVEL
    for grasp in part.grasps:
        R_JJaw = R_JP @ grasp.X_PJaw.rotation().matrix()
        if abs(R_JJaw[2, 0]) < LEVEL and R_JJaw[2, 2] < steepest - 1e-6:
            best, steepest = grasp, float(R_JJaw[2, 2])
    return best
