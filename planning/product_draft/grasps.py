"""The grasps of a product's parts, with what stands around where they are taken and put."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import fcl
import numpy as np
import trimesh
from pydrake.math import RigidTransform, RotationMatrix

from cell.cad.nests import Nest
from cell.cad.screwdriver import (
    HOUSING_RADIUS,
    NOSE_LENGTH,
    NOSE_RADIUS,
    SHAFT_LENGTH,
    SHAFT_RADIUS,
)
from cell.cad.shapes import joined
from cell.products.product import Grasp, Part
from planning.product_draft.grasp_sampling import RankedGrasp, sample_grasps
from planning.product_draft.guess import Guess
from planning.product_draft.hand_shape import HandShape, surface
from planning.product_draft.joint_guesses import ScrewGuess
from planning.product_draft.no_grasp import why_no_grasp

# The bed reaches this far up a narrow part that is pressed in [m] [M]; where that leaves the hand
# no room, or only poor grasps, as far as the planner's imprint says, and its error more.
BED_RISE, IMPRINT_ERROR = 0.016, 0.002
POOR = 0.0  # [A] Score of a grasp that is too far from the mass centre for what it touches.
BED_SIDE = 0.3  # Of the plane that stands for it [m].
NOSE_HEIGHT = 1.8e-3  # [D] 0.3 mm between the nose and what the head rests on [m].
SCREW_FORCE = 5.0  # [A] [N].
HOUSING_SHOWN = 0.05  # Of the driver's housing: no hand is higher [m].


def part_grasps(
    part: Part,
    hand: HandShape,
    up: np.ndarray,
    *,
    base: trimesh.Trimesh,
    earlier: Mapping[str, trimesh.Trimesh],
    nest: Nest,
    imprint: float = BED_RISE,
    screws: Sequence[ScrewGuess] = (),
    beside: Mapping[str, trimesh.Trimesh] = MappingProxyType({}),
    apart: float = 0.0,
    wanted: float = 0.0,
) -> tuple[list[Grasp], list[Guess]]:
    """Return the grasps of a part, from above and, if it is held while screwed, from the side.

    Args:
        part: With its place in the tray; its frame is the product frame A.
        hand: The gripper.
        up: (3,) direction that points up.
        base: The part that the fixture holds, in A [m].
        earlier: By name, what is there when it is put, in A [m].
        nest: Its place in the tray.
        imprint: How far the bed reaches up the base by the planner's imprint [m].
        screws: It is held from the side, beside the driver, while they are driven: those that clamp
            it, or go into it.
        beside: By name, what is there then, in A [m].
        apart: Distance kept between the arms [m].
        wanted: Grip force per pad from above, as far as pads and gripper bear it [N].
    """
    assert part.X_TrayP is not None
    rises = sorted({BED_RISE, min(BED_RISE, imprint + IMPRINT_ERROR)}, reverse=True)

    def sampled(
        around: Mapping[str, fcl.BVHModel], *, from_side: bool = False
    ) -> list[RankedGrasp]:
        found: list[RankedGrasp] = []
        for rise in rises:
            obstacles = [surface(_bed(base, up, rise)), *around.values()]
            force = 0.0 if from_side else wanted
            lower = sample_grasps(
                part.mesh, part.mass, hand, up, obstacles, from_side=from_side, wanted=force
            )
            found = max(found, lower, key=lambda ranked: ranked[0].score if ranked else -np.inf)
            if found and (from_side or found[0].score > POOR):
                break
        return found

    around = {f"'{name}'": surface(mesh) for name, mesh in earlier.items()}
    around["its nest"] = surface(_nest_in_part(nest, part.X_TrayP))
    above = sampled(around)
    bed = {"the bed": surface(_bed(base, up, rises[-1]))}
    why = "" if above else why_no_grasp(part.mesh, part.mass, hand, up, {**bed, **around})
    guesses = [_guess(part.name, above, "from above", why)]
    side: list[RankedGrasp] = []
    if screws:
        there = {f"'{name}'": surface(mesh) for name, mesh in beside.items()}
        there["the driver"] = surface(joined([_driver_over(screw, apart) for screw in screws]))
        side = sampled(there, from_side=True)
        # No more is said of why there is none: the fixture alone holds it then.
        how = "from the side, while screws are driven"
        guesses.append(_guess(part.name, side, how, "nothing fits between what is around"))
    return [ranked.grasp for ranked in (*above, *side)], guesses


def screw_grasp(screw: ScrewGuess) -> Grasp:
    """Return the grasp of a screw's head with the noses; it can be turned about the axis."""
    R = RotationMatrix(np.column_stack([[1, 0, 0], [0, -1, 0], [0, 0, -1]]).astype(float))
    at = RigidTransform(R, [0.0, 0.0, NOSE_HEIGHT])
    return Grasp("head", "nose", at, screw.head_size[0], SCREW_FORCE)


def _driver_over(screw: ScrewGuess, apart: float) -> trimesh.Trimesh:
    """Return head and driver of a screw that is being driven, thicker by a distance, in A."""
    diameter, height = screw.head_size
    nose, housing = SHAFT_LENGTH - apart, SHAFT_LENGTH + NOSE_LENGTH - apart
    lengths = [
        (diameter / 2, 0.0, height),
        (SHAFT_RADIUS + apart, height, nose),
        (NOSE_RADIUS + apart, nose, housing),
        (HOUSING_RADIUS + apart, housing, housing + HOUSING_SHOWN),
    ]
    cylinders = []
    for radius, low, high in lengths:
        cylinder = trimesh.creation.cylinder(radius, high - low, sections=16)
        cylinder.apply_translation([0.0, 0.0, (low + high) / 2])
        cylinders.append(cylinder)
    column = joined(cylinders)
    X = trimesh.geometry.align_vectors([0, 0, 1], screw.axis)
    column.apply_transform(X)
    column.apply_translation(screw.p_AoP)
    return column


def _guess(part: str, found: Sequence[RankedGrasp], how: str, why: str) -> Guess:
    if not found:
        return Guess(part, f"no grasp {how}", why, 0.9)
    best = found[0]
    what = f"{len(found)} grasps {how}, the best {1e3 * best.grasp.width:.3g} mm wide"
    reason = (
        f"jaw {best.grasp.jaw}, {1e6 * best.area:.0f} mm2 of contact, "
        f"{1e3 * best.lever:.1f} mm from the mass centre"
    )
    return Guess(part, what, reason, 0.8)


def _bed(base: trimesh.Trimesh, up: np.ndarray, rise: float) -> trimesh.Trimesh:
    """Return a slab whose upper face is where the bed reaches up the fixed part."""
    top = float((base.vertices @ up).min()) + rise
    size = np.where(np.abs(up) > 0.5, 0.02, BED_SIDE)
    centre = base.vertices.mean(axis=0)
    centre = centre - up * (centre @ up) + up * (top - 0.01)
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(centre))


def _nest_in_part(nest: Nest, X_TrayP: RigidTransform) -> trimesh.Trimesh:
    """Return the boxes of a nest in the frame of the part in it [m]."""
    boxes = []
    for piece in nest.pieces:
        if isinstance(piece.shape, trimesh.Trimesh):
            raise TypeError("a nest is made of boxes")
        size = np.asarray(piece.shape.size())
        X_PS = X_TrayP.inverse() @ piece.X_PS
        boxes.append(trimesh.creation.box(size, X_PS.GetAsMatrix4()))
    return joined(boxes)
