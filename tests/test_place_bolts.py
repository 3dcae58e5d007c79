"""Placing bolts: a tip beside its hole is felt, and the hole is felt for round there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, cast

import numpy as np
import pytest
from pydrake.math import RigidTransform
from teleport import carry_out

from cell.configuration.config import CellConfig
from cell.products.joints import Fit
from cell.products.loading import load_product
from cell.simulation.phase import Phase
from experiments.assembly.prepare import RunningCell
from planning.motion.timing import JointMotion
from planning.operations.bolts import mouth_pose, standing_pose
from planning.operations.grasping import HandPhase
from planning.operations.mating import mate
from planning.operations.place_bolts.phases import (
    PLACES,
    BoltPhase,
    place_bolt,
)
from planning.operations.placement import pose_on_jig
from planning.operations.soft_hand import Mating

PRODUCT = load_product("motor_unit")
LOWERED = (BoltPhase.LOWER, BoltPhase.LOWER_BESIDE)
ON_THE_FACE = 0.1  # Share of the way down after which a tip touches the face [D]: 1 of 6.2 mm.


@pytest.fixture
def running() -> RunningCell:
    """Return a cell with the plate on the motor, that on the jig."""
    running = RunningCell(PRODUCT, CellConfig(), 0)
    station, cell = running.station, running.simulation.cell
    X_WMotor = pose_on_jig(station, "motor", PRODUCT.up, 0.0, 0.03)
    X_WA = X_WMotor @ PRODUCT.parts["motor"].X_AP.inverse()
    for part in ("motor", "plate"):
        X_WP = X_WA @ PRODUCT.parts[part].X_AP
        cell.plant.SetFreeBodyPose(running.simulation.context, cell.parts[part].body, X_WP)
    station.fixed = ("motor", "plate")
    return running


def placed(running: RunningCell, blocked: int) -> list[Phase]:
    """Return the phases of a bolt whose tip meets the face so many times before its hole."""
    return carried_out(running, place_bolt(running.station, "bolt_1"), blocked)


def carried_out(running: RunningCell, phases: Iterator[Phase], blocked: int = 0) -> list[Phase]:
    """Carry out phases and return them; that many times a tip that is lowered meets the face."""
    done, outcome = [], None
    arm, pending = running.station.holder, cast(Any, phases)
    while True:
        try:
            phase = pending.send(outcome)
        except StopIteration:
            return done
        done.append(phase)
        outcome = carry_out(running, phase)
        if phase.kind in LOWERED and blocked > 0:
            blocked -= 1
            motion = phase.commands[arm.name]
            assert isinstance(motion, JointMotion)
            on_face = motion.at(ON_THE_FACE * motion.duration)[0]
            running.simulation.cell.plant.SetPositions(
                running.simulation.context, arm.instance, on_face
            )


def test_bolt_that_enters_its_hole_is_let_go(running: RunningCell) -> None:
    kinds = [phase.kind for phase in placed(running, 0)]
    assert kinds.count(BoltPhase.LOWER) == 1
    assert BoltPhase.LOWER_BESIDE not in kinds
    assert kinds.index(HandPhase.RELEASE) == kinds.index(BoltPhase.LOWER) + 1
    # It is known by what holds it.
    station = running.station
    assert station.pose_of("bolt_1").IsExactlyEqualTo(standing_pose(station, "bolt_1"))


def test_hole_is_felt_for_round_where_it_should_be(running: RunningCell) -> None:
    phases = placed(running, 3)
    beside = [phase for phase in phases if phase.kind is BoltPhase.LOWER_BESIDE]
    assert len(beside) == 3
    station, arm = running.station, running.station.holder
    jaw, X_WMouth = arm.frame("nose"), mouth_pose(station, "bolt_1")
    ends = []
    for phase in (next(p for p in phases if p.kind is BoltPhase.LOWER), *beside):
        motion = phase.commands[arm.name]
        assert isinstance(motion, JointMotion)
        ends.append(arm.tool_pose(station.context, jaw, motion.at(motion.duration)[0]))
    offsets = [(end.translation() - ends[0].translation()) for end in ends]
    np.testing.assert_allclose(offsets, PLACES[:4], atol=2e-5)
    assert len({tuple(np.round(1e4 * offset)) for offset in offsets}) == 4
    assert X_WMouth.translation()[2] > station.cell.X_WJ.translation()[2]


def test_bolts_that_ride_come_to_stand_on_their_threads() -> None:
    """Nobody looks after mating: where they rode in the hand they do not stay."""
    running = RunningCell(PRODUCT, CellConfig(), 0)
    station, cell = running.station, running.simulation.cell
    X_WMotor = pose_on_jig(station, "motor", PRODUCT.up, 0.0, 0.03)
    plate, context = cell.parts["plate"], running.simulation.context
    cell.plant.SetFreeBodyPose(context, cell.parts["motor"].body, X_WMotor)
    X_WA = plate.X_WP(context) @ PRODUCT.parts["plate"].X_AP.inverse()
    bolt = PRODUCT.parts["bolt_1"]
    cell.plant.SetFreeBodyPose(context, cell.parts["bolt_1"].body, X_WA @ bolt.X_AP)
    station.fixed = ("motor",)
    fit = next(joint for joint in PRODUCT.joints if isinstance(joint, Fit))
    up = np.array([0.0, 0.0, 1.0])
    mating = Mating("plate", "motor", fit.p_AoF, fit.depth, up)
    carried_out(running, mate(station, mating, ("bolt_1",)))
    X_AStanding = RigidTransform([0.0, 0.0, PRODUCT.screws["bolt_1"].thread_depth]) @ bolt.X_AP
    X_WA = station.pose_of("motor") @ PRODUCT.parts["motor"].X_AP.inverse()
    assert station.pose_of("bolt_1").IsNearlyEqualTo(X_WA @ X_AStanding, 1e-9)


def test_bolt_that_finds_no_hole_is_let_go_and_judged(running: RunningCell) -> None:
    """It falls: the verdict of the step says so, by the truth."""
    kinds = [phase.kind for phase in placed(running, 100)]
    assert kinds.count(BoltPhase.LOWER_BESIDE) == len(PLACES) - 1
    assert kinds[-1] is HandPhase.RETREAT
