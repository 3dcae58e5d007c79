"""Waiting ends when a reading has come to rest, not before and not long after."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cell.machines.gripper import GripperReading
from cell.simulation.conditions import Steady
from cell.simulation.phase import Condition, Sensed
from planning.operations.waiting import QUIET_TIME, at_rest, steady_jaws, steady_wrist

STEP = 1e-3


def ends(condition: Condition, value, finished_at: float = 0.0) -> float:
    """Return when a condition first holds, or infinity; ``value`` of the time is read."""
    for step in range(1, 1000):
        t = step * STEP
        sensed = Sensed(
            time=t,
            step=step,
            wrench={"left": np.array([0.0, 0.0, 0.0, 0.0, 0.0, value(t)])},
            grippers={"hand": GripperReading(value(t), 0.0)},
            drivers={},
            finished=t >= finished_at,
            X_WF=lambda frame: RigidTransform(),
        )
        if condition(sensed):
            return t
    return np.inf


def test_reading_that_stays_is_steady_after_the_quiet_time() -> None:
    assert abs(ends(steady_wrist("left"), lambda t: 5.0) - QUIET_TIME) < 2 * STEP


def test_reading_that_settles_is_waited_for() -> None:
    """A force that dies away with 50 ms is within its band after 161 ms."""
    end = ends(steady_wrist("left"), lambda t: 5.0 * np.exp(-t / 0.05))
    assert 0.1 < end < 0.161 + QUIET_TIME


def test_slow_drift_is_no_rest() -> None:
    drift = Steady(lambda sensed: sensed.wrench["left"][5:], band=1e-3, duration=0.25)
    assert ends(drift, lambda t: 0.01 * t) == np.inf
    assert ends(drift, lambda t: 0.001 * t) < 0.3


def test_jaws_that_close_on_a_part_are_waited_for() -> None:
    end = ends(steady_jaws("hand"), lambda t: max(0.04 - 0.15 * t, 0.034))
    assert 0.04 < end < 0.04 + 2 * QUIET_TIME


def test_arm_rests_when_its_motion_has_ended_and_its_wrist_is_quiet() -> None:
    def braking(t: float) -> float:
        return 4.0 if t < 0.3 else 4.0 * np.exp(-(t - 0.3) / 0.01)

    end = ends(at_rest("left"), braking, finished_at=0.3)
    assert 0.3 + QUIET_TIME < end < 0.3 + 3 * QUIET_TIME
