"""Looks through the camera on the hand, and none: what is believed then, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from enum import Enum
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from teleport import carry_out

from cell.configuration.config import CellConfig
from cell.errors import UnknownName
from cell.machines.cameras.rendering import rendering_problem  # noqa: F401
from cell.products.loading import load_product
from cell.simulation.phase import Phase, PhaseFailed
from experiments.assembly.prepare import RunningCell
from experiments.cli.main import main
from planning.operations.look import SIDES, look
from planning.operations.pick_place.phases import can_place
from planning.perception.belief import NEVER, CarriedSource, Estimate
from planning.perception.hand_eye import HandEye
from planning.perception.layout import Blind, parts_in_tray, tray_expected

needs_rendering = pytest.mark.skipif("rendering_problem() is not None", reason="no rendering here")
PRODUCT = load_product("motor_unit")
DISTURBED = {"disturbance.tray_position_sigma": 2e-3, "disturbance.tray_yaw_sigma_deg": 3.0}
SEEING = {"sensor.source": "camera", **DISTURBED}


class Kind(Enum):
    """Phases of the tests."""

    LOOK = "look"


def config(**changes: object) -> CellConfig:
    return CellConfig.load(overrides=changes)


def carried_out(running: RunningCell, phases: Iterator[Phase]) -> list[Phase]:
    """Carry phases out by putting the arms where they go; return them."""
    done = []
    for phase in phases:
        carry_out(running, phase)
        done.append(phase)
    return done


def errors(running: RunningCell, part: str) -> tuple[float, float]:
    """Return how far the belief about a part is from the truth [m, rad]."""
    station, cell = running.station, running.simulation.cell
    off = cell.parts[part].X_WP(station.context).InvertAndCompose(station.pose_of(part))
    return float(np.linalg.norm(off.translation())), off.rotation().ToAngleAxis().angle()


# What is expected.


def test_what_is_expected_of_a_part_spreads_as_its_tray_does() -> None:
    """Drawn trays move a part as its covariance says: mostly by the tray's turn, far from there."""
    layout = config(**DISTURBED)
    rng, X_WT = np.random.default_rng(0), layout.workcell.X_WT
    X_TP = PRODUCT.parts["bolt_1"].X_TrayP
    assert X_TP is not None
    expected = parts_in_tray(PRODUCT, tray_expected(layout))["bolt_1"]
    assert expected.X_WP.IsNearlyEqualTo(X_WT @ X_TP, 1e-12)
    assert expected.time == NEVER
    moved = []
    for dx, dy, yaw in rng.normal(scale=[2e-3, 2e-3, np.deg2rad(3.0)], size=(4000, 3)):
        shift = RigidTransform(X_WT.translation() + [dx, dy, 0.0])
        turned = shift @ RigidTransform(RollPitchYaw(0.0, 0.0, yaw), np.zeros(3))
        moved.append((turned @ RigidTransform(X_WT.rotation(), np.zeros(3)) @ X_TP).translation())
    spread = np.cov(np.array(moved).T)
    np.testing.assert_allclose(expected.covariance[3:, 3:], spread, atol=1.5e-6)
    assert spread[0, 0] > 1.5 * (2e-3) ** 2


def test_blind_source_sees_nothing() -> None:
    known = {"motor": Estimate(RigidTransform(), np.eye(6), NEVER)}
    assert Blind().look(["motor"], known) == {}
    assert not isinstance(Blind(), CarriedSource)


def test_blind_run_takes_the_layout_for_the_truth() -> None:
    running = RunningCell(PRODUCT, config(**{"sensor.source": "blind"}, **DISTURBED), 0)
    station = running.station
    assert carried_out(running, look(station, Kind.LOOK, "motor", closely=("motor",))) == []
    X_WT, X_TP = station.config.workcell.X_WT, PRODUCT.parts["motor"].X_TrayP
    assert X_TP is not None
    assert station.pose_of("motor").IsNearlyEqualTo(X_WT @ X_TP, 1e-12)
    assert errors(running, "motor")[0] > 1e-3


def test_sensor_that_does_not_exist_is_bad_input(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert main(["assemble", "--sensor", "lidar", "--out", str(tmp_path / "out")]) == 2
    complaint = capsys.readouterr().err
    assert "lidar" in complaint and "camera" in complaint and complaint.count("\n") == 1
    assert not (tmp_path / "out").exists()
    with pytest.raises(UnknownName):
        RunningCell(PRODUCT, config(**{"sensor.source": "lidar"}), 0)


# What the camera sees.


@pytest.fixture(scope="module")
def running() -> RunningCell:
    return RunningCell(PRODUCT, config(**SEEING), 0)


@pytest.fixture
def fresh(running: RunningCell) -> Iterator[RunningCell]:
    """The cell before the first look; put back afterwards."""
    state = running.save()
    yield running
    running.resume(state)


@needs_rendering
def test_look_at_the_tray_tells_where_everything_in_it_is(fresh: RunningCell) -> None:
    """A tray off by 2 mm and 2.4 degrees; what is too small to be seen is where its rack is."""
    station = fresh.station
    assert errors(fresh, "bolt_1")[0] > 2e-3
    phases = carried_out(fresh, look(station, Kind.LOOK, "motor", closely=("motor",)))
    assert len(phases) == len(SIDES)
    assert len({phase.name for phase in phases}) == len(SIDES)
    for part in PRODUCT.parts:
        off, turned = errors(fresh, part)
        assert off < 2e-4, part
        assert turned < np.deg2rad(1.0), part
    seen = station.belief.estimates["motor"]
    assert seen.time == fresh.simulation.time
    assert 0.0 < np.sqrt(seen.covariance[3:, 3:].diagonal()).max() < 2e-4


@needs_rendering
def test_tray_does_not_slide_along_itself(fresh: RunningCell) -> None:
    """Its places are known to 0.2 mm, whatever the noise of the images."""
    source, state = fresh.station.source, fresh.save()
    assert isinstance(source, HandEye)
    for seed in (3, 4, 5):
        source.rng = np.random.default_rng(seed)
        carried_out(fresh, look(fresh.station, Kind.LOOK, "motor", closely=("motor",)))
        assert errors(fresh, "bolt_1")[0] < 2e-4, seed
        fresh.resume(state)


@needs_rendering
def test_what_nobody_goes_to_see_is_not_seen(fresh: RunningCell) -> None:
    station = fresh.station
    before = station.pose_of("motor")
    assert carried_out(fresh, look(station, Kind.LOOK, "motor")) == []
    assert station.pose_of("motor").IsExactlyEqualTo(before)


@needs_rendering
def test_part_that_is_not_there_fails_the_look(fresh: RunningCell) -> None:
    """The truth does not take the place of what is not seen."""
    station, cell = fresh.station, fresh.simulation.cell
    away = RigidTransform([0.0, -0.6, 0.1])
    cell.plant.SetFreeBodyPose(fresh.simulation.context, cell.parts["motor"].body, away)
    with pytest.raises(PhaseFailed, match="does not see motor"):
        carried_out(fresh, look(station, Kind.LOOK, "motor", closely=("motor",)))
    X_WT = station.config.workcell.X_WT
    assert np.linalg.norm(station.pose_of("motor").translation() - X_WT.translation()) < 0.15


@needs_rendering
def test_look_that_is_repeated_sees_the_same(fresh: RunningCell) -> None:
    source, state = fresh.station.source, fresh.station.source.save()
    assert isinstance(source, HandEye)
    first, again = [], []
    for taken in (first, again):
        source.restore(state)
        source.take()
        taken.append(source.pictures[-1].depth)
    np.testing.assert_array_equal(first[0], again[0])


def test_planner_does_not_press_the_camera_into_the_table() -> None:
    """Below the hand it would meet the force plate when the motor is pressed in; above not."""
    motor = PRODUCT.parts["motor"]
    across = tuple(grasp for grasp in motor.grasps if grasp.name == "can_90")
    product = replace(PRODUCT, parts={**PRODUCT.parts, "motor": replace(motor, grasps=across)})
    for side, possible in ((-0.075, False), (0.075, True)):
        mounted = {"camera.mounted": True, "camera.p_MC": [0.0, side, 0.035]}
        station = RunningCell(product, config(**mounted), 0).station
        station.look()
        assert can_place(station, "motor") is possible
