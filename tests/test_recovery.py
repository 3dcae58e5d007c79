"""A part that does not lie as planned: the plan follows it, or it is placed again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from teleport import carry_out

from cell.configuration.config import CellConfig
from cell.products.loading import load_product
from cell.simulation.phase import Phase
from experiments.assembly.prepare import RunningCell
from experiments.assembly.run import Run
from planning.operations.insert_shaft import INSERT_SHAFT
from planning.operations.operation import Step
from planning.operations.pick_place import PICK_PLACE
from planning.operations.pick_place.phases import PlacePhase
from planning.operations.pick_place.recovery import MOST_AGAIN
from planning.operations.soft_hand import MatePhase
from planning.perception.belief import Estimate, Source

PRODUCT = load_product("motor_unit")
PLACE = Step("place motor", PICK_PLACE, ("motor",))
INSERT = Step("insert plate", INSERT_SHAFT, ("plate",), PRODUCT.fits[0])
KNOCK = RigidTransform([4e-3, 3e-3, 0.0])  # 5 mm, in W.
LEAN = RotationMatrix.MakeXRotation(np.deg2rad(6.0))  # In W.

Disturb = Callable[[RigidTransform, int], RigidTransform]  # Of X_WP, at each time it settles.


def knocked(X_WP: RigidTransform, time: int) -> RigidTransform:
    return KNOCK @ X_WP if time == 0 else X_WP


def leaning(times: int) -> Disturb:
    def disturb(X_WP: RigidTransform, time: int) -> RigidTransform:
        return RigidTransform(LEAN @ X_WP.rotation(), X_WP.translation()) if time < times else X_WP

    return disturb


@pytest.fixture
def running() -> RunningCell:
    return RunningCell(PRODUCT, CellConfig(), 0)


def carried_out(running: RunningCell, step: Step, disturb: Disturb) -> list[Phase]:
    """Carry a step out without physics; the motor is disturbed whenever it has settled."""
    pending, outcome, done = cast(Any, step.phases(running.station)), None, []
    motor, cell = running.simulation.cell.parts["motor"], running.simulation.cell
    settled = 0
    while True:
        try:
            phase = pending.send(outcome)
        except StopIteration:
            return done
        done.append(phase)
        outcome = carry_out(running, phase)
        if phase.kind is PlacePhase.SETTLE:
            context = running.simulation.context
            cell.plant.SetFreeBodyPose(context, motor.body, disturb(motor.X_WP(context), settled))
            settled += 1


def kinds(phases: Sequence[Phase], kind: PlacePhase) -> int:
    return sum(phase.kind is kind for phase in phases)


def test_part_that_lies_as_planned_is_left_alone(running: RunningCell) -> None:
    phases = carried_out(running, PLACE, lambda X_WP, time: X_WP)
    assert kinds(phases, PlacePhase.FREE) == 0
    assert running.station.recoveries == ()


def test_plan_follows_a_part_that_was_knocked_by_5_mm(running: RunningCell) -> None:
    """Same posture, new pose: the plate is brought to where the motor is now."""
    station = running.station
    phases = carried_out(running, PLACE, knocked)
    assert kinds(phases, PlacePhase.FREE) == 0
    (said,) = station.recoveries
    assert "5.0 mm" in said and "follows" in said
    middle = station.placements["motor"].X_WP @ station.part("motor").mesh.center_mass
    np.testing.assert_allclose(
        middle[:2] - station.cell.X_WJ.translation()[:2], [4e-3, 3e-3], atol=2e-5
    )
    inserted = carried_out(running, INSERT, knocked)
    (soft,) = [phase for phase in inserted if phase.kind is MatePhase.INSERT]
    X_WSeat = cast(Any, soft.commands[station.holder.name]).X_WD.X_WSeat
    X_WA = station.pose_of("motor") @ station.part("motor").X_AP.inverse()
    hole = X_WA @ PRODUCT.fits[0].p_AoF
    np.testing.assert_allclose(X_WSeat.translation(), hole, atol=1e-9)


@pytest.mark.parametrize("times", [1, 2])
def test_part_that_leans_by_6_degrees_is_placed_again(running: RunningCell, times: int) -> None:
    phases = carried_out(running, PLACE, leaning(times))
    assert kinds(phases, PlacePhase.FREE) == kinds(phases, PlacePhase.READY) == times
    assert kinds(phases, PlacePhase.FIX) == times + 1
    assert len(running.station.recoveries) == times
    assert all("6.0 deg" in said and "leaning" in said for said in running.station.recoveries)
    X_WP = running.station.pose_of("motor")
    up = X_WP.rotation() @ PRODUCT.parts["motor"].X_AP.rotation().inverse().matrix()[:, 2]
    assert up[2] == pytest.approx(1.0, abs=1e-6)


def test_part_that_goes_on_leaning_is_placed_again_twice(running: RunningCell) -> None:
    phases = carried_out(running, PLACE, leaning(9))
    assert kinds(phases, PlacePhase.FREE) == MOST_AGAIN == 2
    assert "stays so" in running.station.recoveries[-1]


def test_recoveries_outlive_a_saved_state(running: RunningCell) -> None:
    carried_out(running, PLACE, knocked)
    state, said = running.save(), running.station.recoveries
    running.station.recoveries = ()
    running.resume(state)
    assert running.station.recoveries == said


# Simulated.


@dataclass
class Misled:
    """The truth, but for how the motor lies in the hand, as long as it has not been put down.

    Attributes:
        truth: Else.
        running: Whose hand that is.
        X_WError: By which it is seen turned about its middle and shifted, in W.
        duration: See `planning.perception.belief.Source`.
    """

    truth: Source
    running: RunningCell
    X_WError: RigidTransform
    misled: bool = True
    duration: float = 0.0

    def look(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> dict[str, Estimate]:
        seen = dict(self.truth.look(parts, known))
        held = self.running.station.held == "motor"
        if held and self.misled:
            one, about = seen["motor"], PRODUCT.parts["motor"].mesh.center_mass
            middle = one.X_WP @ about
            turned = RigidTransform(middle) @ self.X_WError @ RigidTransform(-middle)
            seen["motor"] = replace(one, X_WP=turned @ one.X_WP)
        elif "motor" in known and "motor" in self.running.station.placements:
            self.misled = False
        return seen

    def save(self) -> np.ndarray:
        return self.truth.save()

    def restore(self, state: np.ndarray) -> None:
        self.truth.restore(state)


def placed(running: RunningCell, X_WError: RigidTransform) -> Run:
    """Return a run in which the motor is placed by a hand that is misled about it."""
    station, run = running.station, Run(running)
    station.belief.source = Misled(station.source, running, X_WError)
    run.run([PLACE])
    return run


@pytest.mark.slow
def test_simulated_part_5_mm_off_is_kept(running: RunningCell) -> None:
    run = placed(running, KNOCK.inverse())
    assert run.verdict == "success", run.failure or run.steps
    (said,) = running.station.recoveries
    assert "follows" in said
    assert run.steps[0].measured["position_error_m"] < 1e-4


@pytest.mark.slow
def test_simulated_part_that_leans_by_6_degrees_is_placed_again(running: RunningCell) -> None:
    """The jig is vented under it, inflated anew and jammed again; the part stands upright then."""
    lean = RigidTransform(RollPitchYaw(np.deg2rad(6.0), 0.0, 0.0), np.zeros(3))
    run = placed(running, lean)
    assert run.verdict == "success", run.failure or run.steps
    (said,) = running.station.recoveries
    assert "leaning" in said and "placed again" in said
    assert run.steps[0].measured["upright_tilt_rad"] < np.deg2rad(1.0)
