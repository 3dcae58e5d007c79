"""Fastening: the order in which bolts are tightened, and how the driver comes to them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from cell.configuration.config import CellConfig
from cell.machines.arm import Unreachable
from cell.machines.driver import DriverReading
from cell.products.loading import load_product
from cell.simulation.phase import Sensed
from experiments.assembly.prepare import RunningCell
from planning.motion.timing import JointMotion
from planning.operations import counter_hold
from planning.operations.counter_hold import Coming, parking
from planning.operations.grasping import backed_off
from planning.operations.operation import Step
from planning.operations.station import FINE_CLEARANCE, Station
from planning.operations.tighten_bolts.over_bolt import (
    BIT_HOVER,
    come_beside,
    is_reached,
    socket_pose,
)
from planning.operations.tighten_bolts.phases import (
    DRIVEN,
    FIRST,
    ONLY,
    SECOND,
    foresee,
    star_order,
)
from planning.operations.tighten_bolts.servos import CLUTCH_TIME, Clutch


def bolts_on_a_circle(count: int) -> tuple[Station, dict[str, np.ndarray]]:
    """Return what `star_order` sees of a station with bolts on a circle, and their places."""
    angles = 2 * np.pi * np.arange(count) / count
    places = {f"bolt_{k}": np.array([np.cos(a), np.sin(a), 0.0]) for k, a in enumerate(angles)}
    parts = {name: SimpleNamespace(X_AP=RigidTransform(p)) for name, p in places.items()}
    return cast(Station, SimpleNamespace(part=parts.__getitem__)), places


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6, 8])
def test_every_bolt_comes_once_and_the_first_stays_first(count: int) -> None:
    station, places = bolts_on_a_circle(count)
    order = star_order(station, list(places))
    assert sorted(order) == sorted(places)
    assert order[0] == "bolt_0"


def test_six_bolts_are_tightened_crosswise() -> None:
    """Each bolt is opposite the one before, or two places on: never its neighbour."""
    station, places = bolts_on_a_circle(6)
    order = star_order(station, list(places))
    ways = [
        float(np.linalg.norm(places[a] - places[b])) for a, b in zip(order, order[1:], strict=False)
    ]
    opposite, two_on = 2.0, np.sqrt(3.0)
    assert min(ways) >= two_on - 1e-9
    assert ways[::2] == pytest.approx([opposite] * 3)


def test_order_follows_the_bolts_as_they_are_listed() -> None:
    station, places = bolts_on_a_circle(6)
    assert star_order(station, list(reversed(places)))[0] == "bolt_5"


def test_what_is_recorded_of_two_passes_has_names_of_its_own() -> None:
    """A record holds each kind of phase once per bolt; the last pass ends like an only one."""
    kinds = [
        {value for value in vars(each).values() if not isinstance(value, bool | float)}
        for each in (FIRST, SECOND)
    ]
    assert len(kinds[0]) == len(kinds[1]) == 7
    assert not kinds[0] & kinds[1]
    assert ONLY.tighten is SECOND.tighten is DRIVEN[-1]
    assert (FIRST.share, SECOND.share) == (0.5, 1.0)


def trip_time(torques: list[float], dt: float) -> float | None:
    """Return when a clutch set to 0.5 N m trips, with one torque per step; None: never."""
    clutch = Clutch("spindle", 0.5)
    for step, torque in enumerate(torques, start=1):
        drivers = {"spindle": DriverReading(push=0.0, torque=torque, speed=0.0)}
        if clutch(cast(Sensed, SimpleNamespace(time=step * dt, drivers=drivers))):
            return step * dt
    return None


@pytest.mark.parametrize("dt", [1e-3, 5e-4])
def test_clutch_trips_on_torque_that_lasts_and_not_on_a_shock(dt: float) -> None:
    shock, steps = 0.8, round(CLUTCH_TIME / dt)
    assert trip_time([0.0, shock] * 20, dt) is None
    assert trip_time([0.0, *[0.5] * (steps + 1)], dt) == pytest.approx(2 * dt + CLUTCH_TIME)


@pytest.fixture(scope="module")
def station_with_bolt() -> Station:
    """A bolt stands over the jig, both arms wait at home."""
    station = RunningCell(load_product("motor_unit"), CellConfig(), 0).station
    x, y, z = station.cell.X_WJ.translation()
    body = station.cell.parts["bolt_1"].body
    X_WBolt = RigidTransform([x, y, z + 0.1])
    station.cell.plant.SetFreeBodyPose(station.context, body, X_WBolt)
    station.look()
    return station


def coming(station: Station, q_then: np.ndarray) -> Coming:
    """The hand stays at home for a second, then goes somewhere."""
    home = station.holder.home
    motion = JointMotion(np.array([0.0, 1.0]), np.array([home, home]), np.zeros((2, len(home))))
    return Coming(motion, q_then, np.array([0.02, 0.02]))


def test_driver_comes_over_the_bolt_while_the_hand_moves(station_with_bolt: Station) -> None:
    station, driver = station_with_bolt, station_with_bolt.driver
    commands = come_beside(station, "bolt_1", coming(station, station.holder.home))
    motion = commands[driver.name]
    assert isinstance(motion, JointMotion)
    p_WE = driver.tool_pose(station.context, driver.frame("tool_tip"), motion.q[-1]).translation()
    p_WBolt = station.pose_of("bolt_1").translation()
    np.testing.assert_allclose(p_WE[:2], p_WBolt[:2], atol=1e-6)
    assert p_WE[2] > p_WBolt[2]


def test_planner_knows_the_end_of_the_bit(station_with_bolt: Station) -> None:
    """Only the last millimetres of the bit are in the bolt's head here."""
    station, driver = station_with_bolt, station_with_bolt.driver
    tip, near = driver.frame("tool_tip"), driver.positions(station.context)
    station.model.arrange(station.surroundings(clearance=FINE_CLEARANCE))

    def met(height: float) -> tuple[str, ...]:
        X_WE = backed_off(socket_pose(station, "bolt_1"), height)
        q = driver.configurations(station.context, tip, X_WE, near)[0]
        return station.model.collisions(driver.name, q)

    assert any("right_tool bit - bolt_1" in pair for pair in met(0.0))
    assert not met(BIT_HOVER)


def test_driver_stays_where_the_hand_would_meet_it(station_with_bolt: Station) -> None:
    station, holder = station_with_bolt, station_with_bolt.holder
    above = RigidTransform(
        RollPitchYaw(np.pi, 0.0, 0.0), station.pose_of("bolt_1").translation() + [0.0, 0.0, 0.03]
    )
    q_hand = station.configuration(
        holder, holder.frame("tip"), above, holder.home, [(station.hand, "bolt_1")]
    )
    assert come_beside(station, "bolt_1", coming(station, q_hand)) == {}


@pytest.fixture
def station_with_far_bolt() -> Station:
    """A bolt stands on the holder's side of the jig: from home, its palm is beside the driver."""
    station = RunningCell(load_product("motor_unit"), CellConfig(), 0).station
    body = station.cell.parts["bolt_1"].body
    p_WBolt = station.cell.X_WJ.translation() * [1, 1, 0] + [-0.0204, -0.0183, 0.272]
    station.cell.plant.SetFreeBodyPose(station.context, body, RigidTransform(p_WBolt))
    station.look()
    return station


def test_the_hand_waits_where_the_driver_has_room(station_with_far_bolt: Station) -> None:
    station, holder = station_with_far_bolt, station_with_far_bolt.holder

    def clear_at(q: np.ndarray) -> bool:
        return is_reached(station, "bolt_1", {holder.name: q})

    assert not clear_at(holder.home)
    q = parking(station, clear_at)
    assert clear_at(q)
    assert np.array_equal(q[1:], holder.home[1:])
    assert np.array_equal(parking(station, lambda q: True), holder.home)


def test_what_the_driver_would_meet_is_named(
    station_with_far_bolt: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The hand has nowhere else to wait."""
    station = station_with_far_bolt
    monkeypatch.setattr(counter_hold, "PARK_TURNS", [0.0])
    step = cast(Step, SimpleNamespace(parts=("bolt_1",)))
    with pytest.raises(Unreachable, match=r"keeps clear: left_\w+ \w+ - right_\w+ \w+ \(.* mm\)"):
        foresee(station, step)
