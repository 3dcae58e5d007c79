"""The driver feels for a socket: where it comes down, what it takes for what, and when it gives up.

What the bit meets is a head of the bolt's shape, without a simulation; that a bit beside its socket
stands on the head is tested in `test_bit_end`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from pydrake.math import RigidTransform
from teleport import carry_out, sensed_in

from cell.configuration.config import CellConfig
from cell.machines.driver import FLOAT_STIFFNESS, DriverReading
from cell.products.loading import load_product
from cell.simulation.conditions import BitPushedIn
from cell.simulation.phase import Outcome, Phase, PhaseFailed, after
from cell.workpieces.thread import BIT_GATE
from experiments.assembly.prepare import RunningCell
from experiments.assembly.run import Run
from experiments.assembly.urscript_conditions import Dialect, ends
from planning.operations.operation import Operation, Step
from planning.operations.station import Station
from planning.operations.tighten_bolts.over_bolt import ways_above
from planning.operations.tighten_bolts.search import (
    PITCH,
    SearchPhase,
    find_socket,
    places,
    search_radius,
    stands_on_something,
)

BOLT = "bolt_3"
BESIDE_HEAD = 4e-3  # Farther from the socket the bit goes past the head [m].


@pytest.fixture(scope="module")
def running() -> RunningCell:
    """A bolt is believed to stand over the jig, the driver is over it."""
    running = RunningCell(load_product("motor_unit"), CellConfig(), 0)
    station = running.station
    x, y, z = station.cell.X_WJ.translation()
    body = station.cell.parts[BOLT].body
    station.cell.plant.SetFreeBodyPose(
        running.simulation.context, body, RigidTransform([x, y, z + 0.1])
    )
    station.look()
    q = next(iter(ways_above(station, BOLT)))
    station.cell.plant.SetPositions(running.simulation.context, station.driver.instance, q)
    return running


def feel(running: RunningCell, phase: Phase, p_FBolt: np.ndarray | None) -> Outcome:
    """Put the bit where a phase brings it, and feel what is there.

    Args:
        running: The cell.
        phase: Moves the driver.
        p_FBolt: Where the bolt stands, from where it was believed to [m]; None: nowhere.
    """
    carry_out(running, phase)
    return felt(running, p_FBolt)


def felt(running: RunningCell, p_FBolt: np.ndarray | None) -> Outcome:
    """Return what bit holder and arm measure; the bolt was believed to stand over the jig."""
    station, driver = running.station, running.station.driver
    screw = station.cell.product.screws[BOLT]
    X_WE = station.tool_pose(driver, "tool_tip")
    height = float(X_WE.translation()[2])
    if p_FBolt is not None:
        p_WF = station.cell.X_WJ.translation() + [0.0, 0.0, 0.1] + p_FBolt
        off = float(np.hypot(*(X_WE.translation() - p_WF)[:2]))
        top = float(station.part(BOLT).mesh.bounds[1][2])
        if off < BESIDE_HEAD:
            rests = screw.bit_seat if off <= BIT_GATE.lateral else top
            height = max(height, float(p_WF[2]) + rests)
    push = FLOAT_STIFFNESS[2] * (height - float(X_WE.translation()[2]))
    p_WE = [*X_WE.translation()[:2], height]
    sensed = sensed_in(
        running,
        drivers={driver.tool.name: DriverReading(push, 0.0, 0.0)},
        X_WF=lambda frame: RigidTransform(X_WE.rotation(), p_WE),
    )
    return Outcome(sensed, {})


def searched(running: RunningCell, p_FBolt: np.ndarray | None) -> list[Phase]:
    """Return the phases of a search; it ends in the socket, or raises."""
    station, driver, done = running.station, running.station.driver, []
    station.look(BOLT)
    station.recoveries = ()
    seat = station.cell.product.screws[BOLT].bit_seat
    X_WE = RigidTransform(
        station.tool_pose(driver, "tool_tip").rotation(), station.pose_of(BOLT) @ [0.0, 0.0, seat]
    )
    q = driver.configurations(
        station.context, driver.frame("tool_tip"), X_WE, driver.positions(station.context)
    )[0]
    station.cell.plant.SetPositions(running.simulation.context, driver.instance, q)
    outcome = felt(running, p_FBolt)
    pending = cast(Any, find_socket(station, BOLT, outcome, frozenset([BOLT])))
    outcome = None
    while True:
        try:
            phase = pending.send(outcome)
        except StopIteration:
            return done
        done.append(phase)
        outcome = feel(running, phase, p_FBolt)


def count(phases: list[Phase], kind: SearchPhase) -> int:
    return sum(phase.kind is kind for phase in phases)


@pytest.mark.parametrize("radius", [3e-4, 1e-3, 1.5e-3, 2.75e-3])
def test_every_point_within_the_radius_is_near_a_place(radius: float) -> None:
    rng = np.random.default_rng(0)
    angle, way = rng.uniform(0.0, 2 * np.pi, 2000), radius * np.sqrt(rng.uniform(0.0, 1.0, 2000))
    points = np.stack([way * np.cos(angle), way * np.sin(angle)], axis=1)
    found = places(radius)
    nearest = np.min(np.linalg.norm(points[:, None] - found[None, :, :2], axis=2), axis=1)
    assert nearest.max() <= PITCH / np.sqrt(3) < BIT_GATE.lateral
    ways = np.hypot(found[:, 0], found[:, 1])
    assert ways[0] == 0.0
    assert np.all(np.diff(ways) > -1e-9)
    assert ways[-1] <= radius + PITCH / np.sqrt(3)
    assert np.all(found[:, 2] == 0.0)


def test_without_a_radius_there_is_one_place() -> None:
    assert len(places(0.0)) == 1


@pytest.mark.parametrize("sigma, radius", [(0.0, 1.5e-3), (4e-4, 1.5e-3), (7e-4, 2.1e-3)])
def test_radius_follows_what_the_belief_is_uncertain_about(
    running: RunningCell, sigma: float, radius: float
) -> None:
    station = running.station
    station.look(BOLT)
    known = station.belief.estimates
    spread = np.diag([0.0, 0.0, 0.0, 1e-4, sigma, 5e-3]) ** 2
    known[BOLT] = replace(known[BOLT], covariance=spread)
    assert search_radius(station, BOLT) == pytest.approx(radius)
    known[BOLT] = replace(known[BOLT], covariance=100.0 * np.eye(6))
    assert search_radius(station, BOLT) == pytest.approx(2.75e-3, abs=1e-5)  # The head's own.


@pytest.mark.parametrize("off", [6e-4, 1e-3, 1.5e-3])
@pytest.mark.parametrize("direction", np.deg2rad([0.0, 40.0, 205.0]))
def test_bolt_that_stands_off_is_found(running: RunningCell, off: float, direction: float) -> None:
    p_FBolt = off * np.array([np.cos(direction), np.sin(direction), 0.0])
    p_WBelieved = running.station.cell.X_WJ.translation() + [0.0, 0.0, 0.1]
    phases = searched(running, p_FBolt)
    tries = count(phases, SearchPhase.DOWN)
    assert 0 < tries < len(places(1.5e-3))
    assert phases[-1].kind is SearchPhase.PRESS
    aside = running.station.pose_of(BOLT).translation() - p_WBelieved
    np.testing.assert_allclose(aside, p_FBolt, atol=BIT_GATE.lateral + 1e-5)
    (said,) = running.station.recoveries
    assert said.startswith(f"{BOLT}: ")
    assert said.endswith(f"at place {tries + 1}.")


def test_nothing_is_dragged_over_the_head(running: RunningCell) -> None:
    """The bit goes up, aside over the top, and straight down."""
    station, driver = running.station, running.station.driver
    tip = driver.frame("tool_tip")
    for phase in searched(running, np.array([0.0, 1e-3, 0.0])):
        motion = cast(Any, phase.commands[driver.name])
        ways = [
            driver.tool_pose(station.context, tip, q).translation()
            for q in (motion.q[0], motion.q[-1])
        ]
        way = ways[1] - ways[0]
        if phase.kind is SearchPhase.ASIDE:
            assert abs(way[2]) < 1e-5
            top = station.cell.X_WJ.translation()[2] + 0.1 + station.part(BOLT).mesh.bounds[1][2]
            assert ways[0][2] > top + 4e-4
        else:
            assert np.hypot(way[0], way[1]) < 1e-5
            assert (way[2] > 0) == (phase.kind is SearchPhase.LIFT)


def test_bolt_that_stands_higher_is_found_where_it_is(running: RunningCell) -> None:
    """Its top is felt beside the socket; then the believed place is tried again, less deep."""
    searched(running, np.array([5e-4, 0.0, 8e-4]))
    height = running.station.pose_of(BOLT).translation()[2]
    believed = running.station.cell.X_WJ.translation()[2] + 0.1
    assert height - believed == pytest.approx(8e-4, abs=1e-5)


@pytest.mark.parametrize("p_FBolt", [np.array([3e-3, 0.0, 0.0]), None])
def test_bolt_beyond_the_radius_is_not_found_and_that_is_said(
    running: RunningCell, p_FBolt: np.ndarray | None
) -> None:
    with pytest.raises(PhaseFailed) as failed:
        searched(running, p_FBolt)
    assert failed.value.phase == f"{BOLT}: search for the socket"
    words = f"no socket found within 1.5 mm of where {BOLT} is believed to stand, at 43 places"
    assert failed.value.evidence.startswith(words)
    assert failed.value.evidence.endswith("no head is felt there") == (p_FBolt is None)
    assert running.station.recoveries == ()


def test_what_bears_the_bit_is_felt_by_its_spring(running: RunningCell) -> None:
    driver = running.station.driver.tool.name
    for push, holds in ((1.9, False), (2.1, True)):
        sensed = sensed_in(running, drivers={driver: DriverReading(push, 0.0, 0.0)})
        assert BitPushedIn(driver, 2.0)(sensed) == holds


def test_phases_that_come_again_are_counted(running: RunningCell) -> None:
    def again(station: Station, step: Step) -> Iterator[Phase]:
        for kind in (SearchPhase.LIFT, SearchPhase.DOWN, SearchPhase.DOWN):
            yield Phase(kind, after(0.002), timeout=1.0, subject=BOLT)

    run = Run(RunningCell(running.simulation.cell.product, CellConfig(), 0))
    run.run([Step("search", Operation("search", again, lambda cell, record, log: {}), (BOLT,))])
    (lift,), (down,) = (run.records[0].of(BOLT, k) for k in (SearchPhase.LIFT, SearchPhase.DOWN))
    assert (lift.times, down.times) == (1, 2)


def test_robots_script_has_words_for_what_is_felt(running: RunningCell) -> None:
    dialect = Dialect(running.simulation.cell, running.station.driver)
    assert ends(dialect, stands_on_something(running.station)) == "spindle_push() >= 2.000"
