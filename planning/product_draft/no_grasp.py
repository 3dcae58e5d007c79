"""Why a part has no grasp: what is too wide, too little, or in the way."""

from __future__ import annotations

from collections.abc import Mapping

import fcl
import numpy as np
import trimesh

from planning.product_draft.grasp_sampling import closing_directions, sample_grasps
from planning.product_draft.hand_shape import JAWS, HandShape


def why_no_grasp(
    mesh: trimesh.Trimesh,
    mass: float,
    hand: HandShape,
    up: np.ndarray,
    around: Mapping[str, fcl.BVHModel],
    *,
    from_side: bool = False,
) -> str:
    """Return in words why `sample_grasps` finds nothing.

    Args:
        mesh, mass, hand, up, from_side: As of `sample_grasps`.
        around: By name, surfaces that the hand keeps clear of.
    """

    def has_grasp(*obstacles: fcl.BVHModel) -> bool:
        return bool(sample_grasps(mesh, mass, hand, up, obstacles, from_side=from_side))

    if not has_grasp():
        return _why_not_alone(mesh, hand, up)
    alone = [name for name, obstacle in around.items() if not has_grasp(obstacle)]
    if alone:
        return f"{' and '.join(alone)} alone would leave the jaws no room"
    return f"nothing fits between {', '.join(around)}"


def _why_not_alone(mesh: trimesh.Trimesh, hand: HandShape, up: np.ndarray) -> str:
    """Return why not even a part with nothing around it is gripped."""
    most = max(hand.widths(jaw)[1] for jaw in JAWS)
    widths = [float(np.ptp(mesh.vertices @ closing)) for closing in closing_directions(mesh, up)]
    if widths and min(widths) > most:
        return f"it is {1e3 * min(widths):.3g} mm wide, and the jaws open to {1e3 * most:.3g} mm"
    return "it has no two opposite faces, upright and level, that are large enough for the jaws"
