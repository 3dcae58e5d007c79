"""Motions of one arm beside those of another are planned around where that one will be."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from cell.configuration.config import CellConfig
from cell.machines.arm import Arm
from cell.products.loading import load_product
from experiments.assembly.prepare import RunningCell
from planning.motion.paths import NoPath
from planning.motion.timing import JointMotion
from planning.motion.together import keep_apart
from planning.operations.grasping import CLEAR, HandPhase, let_go
from planning.operations.station import Station

DOWN = RollPitchYaw(np.pi, 0.0, 0.0)


@pytest.fixture(scope="module")
def station() -> Station:
    return RunningCell(load_product("motor_unit"), CellConfig(), 0).station


def over_jig(station: Station, arm: str, height: float) -> np.ndarray:
    """Return joint angles with the tool over the jig, the other arm being where it is."""
    moving = station.cell.arms[arm]
    frame = moving.frame("tip" if moving is station.holder else "tool_tip")
    x, y, _ = station.cell.X_WJ.translation()
    pose = RigidTransform(DOWN, [x, y, height])
    return station.configuration(moving, frame, pose, moving.home)


def test_driver_does_not_come_where_the_hand_will_be(station: Station) -> None:
    """Both places are free now: the hand is on its way to one of them."""
    holder, driver = station.holder, station.driver
    motion = station.move(holder, over_jig(station, holder.name, 0.40))
    q_above = over_jig(station, driver.name, 0.42)
    with pytest.raises(NoPath, match=f"the goal collides .*{holder.name}_tool"):
        station.move(driver, q_above, beside={holder.name: motion})


def test_driver_that_moves_beside_the_hand_keeps_clear_of_it(station: Station) -> None:
    holder, driver = station.holder, station.driver
    motion = station.move(holder, over_jig(station, holder.name, 0.40))
    goal = driver.home + [0.3, 0.0, 0.0, 0.0, 0.0, 0.5]
    beside = station.move(driver, goal, beside={holder.name: motion})
    np.testing.assert_allclose(beside.q[-1], goal)
    assert keep_apart(station.model, {holder.name: motion, driver.name: beside})


def test_jaws_that_are_about_to_open_count_as_open(station: Station) -> None:
    jaws = np.array([0.02, 0.02])
    arranged = station.surroundings(elsewhere={station.hand: jaws})
    np.testing.assert_array_equal(arranged.tools[station.hand], jaws)
    np.testing.assert_array_equal(arranged.arms[station.driver.name], station.driver.home)


def test_straight_lines_are_checked_against_the_other_arm_only() -> None:
    """Into the jig's base it goes, for a line ends at what it is about; not into the driver."""
    station = RunningCell(load_product("motor_unit"), CellConfig(), 0).station
    holder, driver, tip = station.holder, station.driver, station.holder.frame("tip")
    x, y, z = station.cell.X_WJ.translation()
    station.cell.plant.SetPositions(
        station.context, holder.instance, over_jig(station, holder.name, z + 0.2)
    )
    down = station.line(holder, tip, RigidTransform(DOWN, [x, y, z]))
    assert station.clear_of_arms(holder, down)
    q_near = station.configuration(
        driver, driver.frame("tool_tip"), RigidTransform(DOWN, [x + 0.12, y, z + 0.1]), driver.home
    )
    station.cell.plant.SetPositions(station.context, driver.instance, q_near)
    across = station.line(holder, tip, RigidTransform(DOWN, [x + 0.12, y, z + 0.2]))
    assert not station.clear_of_arms(holder, across)


@pytest.mark.parametrize(("free", "end"), [(1.0, 0.08), (0.05, 0.04), (0.0, CLEAR)])
def test_hand_backs_off_as_far_as_the_other_arm_lets_it(
    station: Station, monkeypatch: pytest.MonkeyPatch, free: float, end: float
) -> None:
    """In any case it gets clear of the part."""
    holder, tip = station.holder, station.holder.frame("tip")

    def height(q: np.ndarray) -> float:
        return float(holder.tool_pose(station.context, tip, q).translation()[2])

    def clear(self: Station, arm: Arm, motion: JointMotion) -> bool:
        return height(motion.q[-1]) - height(motion.q[0]) < free

    monkeypatch.setattr(Station, "clear_of_arms", clear)
    grasp = next(grasp for grasp in station.part("motor").grasps if grasp.jaw == "tip")
    phases = {phase.kind: phase for phase in let_go(station, "motor", grasp, 0.08, frozenset())}
    back = phases[HandPhase.RETREAT].commands[holder.name]
    assert isinstance(back, JointMotion)
    assert height(back.q[-1]) - height(back.q[0]) == pytest.approx(end, abs=1e-6)
