"""The phases that put a part onto or into another one, where no shaft holds it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cell.products.joints import Rest
from cell.products.product import Product
from cell.simulation.phase import Phase
from planning.feasibility.directions import unit_vector
from planning.operations.mating import foresee_mating, mate
from planning.operations.operation import Step
from planning.operations.soft_hand import Mating
from planning.operations.station import Station


def carry_out(station: Station, step: Step) -> Iterator[Phase]:
    """Yield the phases of a step."""
    yield from mate(station, mating_of(station.cell.product, step), step.riders)


def foresee(station: Station, step: Step) -> tuple[str, ...]:
    """Choose the grasp of a step, and believe the part to be seated."""
    foresee_mating(station, mating_of(station.cell.product, step))
    return ()


def mating_of(product: Product, step: Step) -> Mating:
    """Return what a step brings to what; it complies about the middle of the part's underside."""
    joint, up = step.joint, unit_vector(product.up)
    assert isinstance(joint, Rest)
    part = product.parts[joint.part]
    corners = part.X_AP.multiply(np.array(part.mesh.vertices, float).T).T
    p_AoG = part.X_AP @ np.asarray(part.mesh.center_mass, float)
    p_AoC = p_AoG + up * float((corners @ up).min() - up @ p_AoG)
    return Mating(joint.part, joint.on, p_AoC, joint.depth, up)
