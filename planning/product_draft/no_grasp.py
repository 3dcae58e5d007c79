"""Why a part has no grasp: what is too wide, too little, or in the way."""

from __future__ import annotations

from collections.abc import Mapping

import fcl
import numpy as np
import trimesh

from cell.machines.grippers import too_wide
from planning.product_draft.grasp_sampling import closing_directions, sample_grasps
from planning.product_draft.hand_shape import HandShape


def why_no_grasp(
    mesh: trimesh.Trimesh,
    mass: float,
    hand: HandShape,
    up: np.ndarray,
    around: Mapping[str, fcl.BVHModel],
) -> str:
    """Return in words why `sample_grasps` finds nothing from above; "" if it finds something.

    Args:
        mesh: The part in A [m].
        mass: [kg].
        hand: The gripper.
        up: (3,) direction that points up on the jig and in the tray.
        around: By name, surfaces that the hand keeps clear of.
    """
    widths = [float(np.ptp(mesh.vertices @ closing)) for closing in closing_directions(mesh, up)]
    if widths and min(widths) > hand.gripper.stroke:
        return too_wide(hand.gripper, min(widths))

    def has_grasp(*obstacles: fcl.BVHModel) -> bool:
        return bool(sample_grasps(mesh, mass, hand, up, obstacles))

    if not has_grasp():
        return "it has no two opposite faces, upright and level, that are large enough for jaws"
    if not around:
        return ""
    alone = [name for name, obstacle in around.items() if not has_grasp(obstacle)]
    if alone:
        return f"{' and '.join(alone)} alone would leave the jaws no room"
    return f"nothing fits between {', '.join(around)}"
