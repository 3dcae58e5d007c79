"""For an assembly on a fixture made for one part: what it is made for, and how it is turned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cell.configuration.config import CellConfig
from cell.errors import InputError
from cell.fixtures import fixture_class
from cell.products.product import Product
from experiments.assembly.prepare import RunningCell
from planning.operations.operation import Role, Step
from planning.operations.pick_place.phases import can_place, yaws_to_place


def with_fixture_for(
    config: CellConfig, product: Product, seed: int, todo: Sequence[Step]
) -> CellConfig:
    """Return a configuration with its custom fixture, if it has one, made for what the steps fix.

    It is turned on its base to the first yaw at which the planner can place the part and bring what
    comes later, unless the configuration states a yaw. If there is none it is not turned, and the
    run fails with the planner's evidence.

    Args:
        config: Of the cell.
        product: That is assembled.
        seed: Of the run.
        todo: Its steps.

    Raises:
        InputError: The steps fix several parts: such a fixture holds one.
        FixtureError: No such fixture holds the part.
    """
    name = config.workcell.fixture
    fixed = list(dict.fromkeys(s.parts[0] for s in todo if s.operation.role is Role.FIX))
    if not fixture_class(name).custom or not fixed:
        return config
    if len(fixed) > 1:
        raise InputError(
            f"The plan fixes {', then '.join(fixed)}, and a {name} holds one part in one posture: "
            "choose another --order, or --fixture soft_jig."
        )
    part = fixed[0]
    config = config.with_changes({"custom.held.part": part, "custom.held.up": product.up})
    if config.custom.held.yaw_deg != 0.0:
        return config
    looking = RunningCell(product, config, seed).station
    looking.look()
    for yaw in dict.fromkeys(yaws_to_place(looking, part)):
        turned = config.with_changes({"custom.held.yaw_deg": float(np.rad2deg(yaw))})
        station = RunningCell(product, turned, seed).station
        station.look()
        if can_place(station, part):
            return turned
    return config
