"""The phases that put a part with a hole onto a shaft, or a shaft into a hole."""

from __future__ import annotations

from collections.abc import Iterator

from cell.products.joints import Fit
from cell.products.product import Product
from cell.simulation.phase import Phase
from planning.operations.mating import foresee_mating, mate, mating_at_hole
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
    """Return what a step brings to what."""
    assert isinstance(step.joint, Fit)
    return mating_at_hole(product, step.joint, step.parts[0])
