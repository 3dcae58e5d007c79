"""The phases that put a part with a hole onto a shaft, or a shaft into a hole."""

from __future__ import annotations

from collections.abc import Iterator

from cell.products.joints import Fit
from cell.products.product import Product
from cell.simulation.phase import Phase
from planning.feasibility.directions import unit_vector
from planning.operations.mating import Mating, foresee_mating, mate
from planning.operations.operation import Step
from planning.operations.station import Station


def carry_out(station: Station, step: Step) -> Iterator[Phase]:
    """Yield the phases of a step."""
    yield from mate(station, mating_of(station.cell.product, step), step.riders)


def foresee(station: Station, step: Step) -> tuple[str, ...]:
    """Choose the grasp of a step, and believe the part to be seated."""
    foresee_mating(station, mating_of(station.cell.product, step))
    return ()


def mating_of(product: Product, step: Step) -> Mating:
    """Return what a step brings to what.

    The compliance centre is where the part in the hand meets the other one first: at the mouth of
    its hole, or at the tip of its shaft.
    """
    fit, up = step.joint, unit_vector(product.up)
    assert isinstance(fit, Fit)
    if step.parts == (fit.hole,):
        return Mating(fit.hole, fit.shaft, fit.p_AoF, fit.depth, up)
    return Mating(fit.shaft, fit.hole, fit.p_AoF - fit.depth * up, fit.depth, up)
