"""A part pressed into the jig by the rig, for pictures: its pose, its imprint, what is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from experiments.paper.rig_hand import RigBench
from experiments.paper.trial import TrialDisturbance
from planning.operations.pick_place.phases import SETTLE_TIME

PRESS_FORCES = 15.0, 30.0  # [N] The plausible range of placement.press_force: shallow and deep.


@dataclass(frozen=True, eq=False)
class Placed:
    """A part on the jig.

    Attributes:
        X_JP: Where it is: the truth.
        X_JPlanned: Where it is by the plan, lowered by as much as the hand went down.
        fixture: State of the fixture, as `Fixture.save` says.
        press_force: With which it was pressed in [N].
    """

    X_JP: RigidTransform
    X_JPlanned: RigidTransform
    fixture: Mapping[str, Any]
    press_force: float


def press_in(bench: RigBench, rng: np.random.Generator) -> Placed:
    """Place a part as in the placing experiment, with a random force and random grasp errors.

    Raises:
        PhaseFailed: It cannot be pressed in, or it falls off.
    """
    force = float(rng.uniform(*PRESS_FORCES))
    config = bench.rig.config.with_changes({"placement.press_force": force})
    bench = replace(bench, rig=replace(bench.rig, config=config))
    hand = bench.begin(TrialDisturbance.draw(config, rng))
    start = hand.simulation.pose.p_WT
    hand.press()
    lowered = start - hand.simulation.pose.p_WT
    hand.let_go()
    hand.wait_for_rest("settle", SETTLE_TIME)
    planned = RigidTransform(hand.planned.rotation(), hand.planned.translation() - lowered)
    state = bench.rig.fixture.save(hand.simulation.root)
    return Placed(hand.observer.X_JP, planned, state, force)
