"""Which of the drafted grasps the arms can carry out, where each part is taken and where it is put.

Each step of the plan is foreseen with one grasp at a time, as `soft-jig check` does with all.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

from cell.machines.arm import Unreachable
from cell.products.product import Grasp, Part, Product
from planning.motion.paths import NoPath
from planning.operations.operation import NoOperation, Role, Step
from planning.operations.station import Station


def reached_grasps(station: Station, todo: Sequence[Step]) -> dict[str, tuple[Grasp, ...]]:
    """Return the grasps with which a step can be done, by name of the part that is gripped.

    A part whose step cannot be done is left out, and so is what comes after it.

    Args:
        station: Of a cell in which nothing has happened yet; it is used up.
        todo: The steps of the plan.
    """
    reached: dict[str, tuple[Grasp, ...]] = {}
    station.look()
    for step in todo:
        name = _gripped(station.cell.product, step)
        if name is not None:
            found = tuple(g for g in station.part(name).grasps if _does(station, step, name, g))
            reached[name] = (*reached.get(name, ()), *found)
        try:
            step.operation.foresee(station, step)
        except (Unreachable, NoPath, NoOperation):
            return reached
        station.fixed = step.fixed_after(station.cell.product, station.fixed)
    return reached


def _gripped(product: Product, step: Step) -> str | None:
    """Return the part with several grasps that the hand grips in a step."""
    bolts = [name for name in step.parts if name in product.screws]
    if step.operation.role is Role.FINISH and bolts:
        return product.screws[bolts[0]].clamps
    return step.parts[0] if len(step.parts) == 1 and not bolts else None


def _does(station: Station, step: Step, name: str, grasp: Grasp) -> bool:
    """Return whether a step can be done, without a remark, if a part has this grasp only."""
    trial = copy(station)
    only = replace(station.part(name), grasps=(grasp,))
    trial.cell = replace(station.cell, product=_with(station.cell.product, only))
    trial.belief = copy(station.belief)
    trial.belief.estimates = dict(station.belief.estimates)
    trial.origins = dict(station.origins)
    try:
        return not step.operation.foresee(trial, step)
    except (Unreachable, NoPath, NoOperation):
        return False


def _with(product: Product, part: Part) -> Product:
    return replace(product, parts={**product.parts, part.name: part})
