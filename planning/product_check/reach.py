"""Which of the drafted grasps the arms can carry out, where each part is taken and where it is put.

Each step of the plan is foreseen with one grasp at a time, as `soft-jig check` does with all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace

from cell.machines.arm import Unreachable
from cell.products.product import Grasp, Product
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
        names = _gripped(station.cell.product, step)
        for name in names:
            grasps = station.part(name).grasps
            found = tuple(g for g in grasps if _does(station, step, names, {name: (g,)}))
            reached[name] = (*reached.get(name, ()), *found)
        try:
            step.operation.foresee(station, step)
        except (Unreachable, NoPath, NoOperation):
            return reached
        station.fixed = step.fixed_after(station.cell.product, station.fixed)
    return reached


def _gripped(product: Product, step: Step) -> tuple[str, ...]:
    """Return the parts with several grasps, any of which the hand grips in a step."""
    bolts = [name for name in step.parts if name in product.screws]
    if step.operation.role is Role.FINISH and bolts:
        return product.screws[bolts[0]].clamps, product.screws[bolts[0]].into
    return step.parts if len(step.parts) == 1 and not bolts else ()


def _does(
    station: Station, step: Step, names: Sequence[str], grasps: Mapping[str, tuple[Grasp, ...]]
) -> bool:
    """Return whether a step can be done, without a remark, if parts have these grasps only."""
    parts = dict(station.cell.product.parts)
    for name in names:
        parts[name] = replace(parts[name], grasps=grasps.get(name, ()))
    trial = copy(station)
    trial.cell = replace(station.cell, product=replace(station.cell.product, parts=parts))
    trial.belief = copy(station.belief)
    trial.belief.estimates = dict(station.belief.estimates)
    trial.origins = dict(station.origins)
    try:
        return not step.operation.foresee(trial, step)
    except (Unreachable, NoPath, NoOperation):
        return False
