"""What an operation does to the body on the jig: forces, torque, and where they act."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cell.products.product import Product
from cell.vectors import rotation_with_up
from planning.feasibility.directions import unit_vector
from planning.feasibility.solids import Solid
from planning.fixture_analysis.candidate import FixtureSetup, Proposal

PUSH_DIRECTIONS = tuple(np.array(d, float) for d in ((1, 0), (-1, 0), (0, 1), (0, -1)))
FIT_FRICTION = 0.3  # [A] Of metal on metal, dry, 0.2-0.5: the share of an insertion's force that a
# part beside its hole exerts sideways.


@dataclass(frozen=True, eq=False)
class OperationLoad:
    """Forces of an operation on the body on the jig.

    Attributes:
        down: Force that presses it down [N].
        sideways: Horizontal force, in any of the directions [N].
        torque: About the vertical [N m].
        p_Q: (2,) point of application, in the imprint's plane [m].
        height: Of that point above the body's lowest point [m].
        directions: Directions that the sideways force may have, (2,) each.
        pressed: Share of ``down`` that presses a shaft into a hole that is narrower [N].
    """

    down: float
    sideways: float
    torque: float
    p_Q: np.ndarray
    height: float
    directions: tuple[np.ndarray, ...] = PUSH_DIRECTIONS
    pressed: float = 0.0


def operation_load(
    product: Product,
    solids: Mapping[str, Solid],
    setup: FixtureSetup,
    proposal: Proposal,
    piece: tuple[str, ...],
    p_middle: np.ndarray,
    low: float,
) -> OperationLoad:
    """Return the load on the body while one piece is brought to it.

    Args:
        product: For its fits, press fits and screws.
        solids: Parts by name.
        setup: Forces of the operations.
        proposal: What is on the jig, and in which posture.
        piece: Names of moved parts that are connected.
        p_middle: (2,) point of the body, turned, over the middle of the bag [m].
        low: Height of the body's lowest point, turned [m].
    """
    R_JA = rotation_with_up(proposal.up).matrix()
    screws = [product.screws[n] for n in piece if n in product.screws]
    driven = len(screws) == len(piece) and all(f.into in proposal.body for f in screws)
    force = setup.driver_force if driven else setup.insertion_force
    torque = max((f.torque for f in screws), default=0.0) if driven else 0.0
    p_JQ = R_JA @ mating_point(product, solids, proposal, piece)
    p_Q, height = p_JQ[:2] - p_middle, max(float(p_JQ[2]) - low, 1e-3)
    if proposal.steepest is not None:
        way = R_JA @ np.array(proposal.steepest)
        level = float(np.linalg.norm(way[:2]))
        push = -way[:2] / max(level, 1e-9)
        # Friction beside the hole acts on top of the force's own horizontal share, at worst along.
        sideways = force * (level + FIT_FRICTION * max(0.0, float(way[2])))
        down = force * max(0.0, float(way[2]))
        return OperationLoad(down, sideways, torque, p_Q, height, (push,))
    if proposal.approach == "above":
        pressed = max(
            (
                joint.force
                for joint in product.presses
                if set(joint.parts) & set(piece) and set(joint.parts) & set(proposal.body)
            ),
            default=0.0,
        )
        return OperationLoad(
            force + pressed, FIT_FRICTION * force, torque, p_Q, height, pressed=pressed
        )
    along = [-(R_JA @ unit_vector(j))[:2] for j in proposal.sideways]
    pushes = tuple(p for p in PUSH_DIRECTIONS if any(p @ a > 0.5 for a in along))
    return OperationLoad(0.0, force, torque, p_Q, height, pushes)


def mating_point(
    product: Product, solids: Mapping[str, Solid], proposal: Proposal, piece: tuple[str, ...]
) -> np.ndarray:
    """Return where a piece meets the body (3,) in A: the mouth of their fit, if there is one.

    Otherwise the middle of the piece, at the lower of the heights of their tops.
    """
    for fit in (*product.fits, *product.presses):
        sides = {fit.shaft, fit.hole}
        if sides & set(piece) and sides & set(proposal.body):
            return np.asarray(fit.p_AoF, float)
    axis = unit_vector(proposal.up)
    low = np.min([solids[name].lower for name in piece], axis=0)
    high = np.max([solids[name].upper for name in piece], axis=0)
    tops = [
        max(float((solids[name].vertices @ axis).max()) for name in names)
        for names in (piece, proposal.body)
    ]
    middle = (low + high) / 2
    return middle + (min(tops) - middle @ axis) * axis
