"""What is in the hand is shown to the fixed camera: what is seen of it, and what comes of that."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from teleport import carry_out

from cell.configuration.config import CellConfig
from cell.machines.cameras.rendering import rendering_problem  # noqa: F401
from cell.products.loading import load_product
from cell.simulation.conditions import LostGrasp
from cell.simulation.phase import Phase, PhaseFailed
from experiments.assembly.prepare import RunningCell
from planning.operations.present import present
from planning.operations.station import Station
from planning.perception.belief import Estimate, gripped
from planning.perception.hand_eye import HandEye

needs_rendering = pytest.mark.skipif("rendering_problem() is not None", reason="no rendering here")
PRODUCT = load_product("motor_unit")
GUARD = LostGrasp("left_gripper", 0.0)
RIDERS = ("bolt_1", "bolt_4")
X_WP = RigidTransform(RollPitchYaw(0.0, 0.0, 0.4), [0.0, 0.15, 0.36])  # Lifted off the jig.


@pytest.fixture(scope="module")
def running() -> RunningCell:
    return RunningCell(PRODUCT, CellConfig.load(overrides={"sensor.source": "camera"}), 0)


@pytest.fixture
def holding(running: RunningCell) -> Iterator[RunningCell]:
    """The plate in the hand above the jig, seen before it was gripped; bolts ride on it."""
    state = running.save()
    station, cell = running.station, running.simulation.cell
    arm, context, plate = station.holder, running.simulation.context, PRODUCT.parts["plate"]
    grasp = next(grasp for grasp in plate.grasps if grasp.name == "edges_top_180")
    frame = arm.frame(grasp.jaw)
    q = arm.configurations(context, frame, X_WP @ grasp.X_PJaw, arm.positions(context))[0]
    cell.plant.SetPositions(context, arm.instance, q)
    opening = grasp.width - cell.gripper.model.setback[grasp.jaw]
    cell.plant.SetPositions(context, cell.gripper.instance, np.full(2, opening / 2.0))
    X_WA = X_WP @ plate.X_AP.inverse()
    for name in ("plate", *RIDERS):
        believed = X_WA @ PRODUCT.parts[name].X_AP
        station.belief.estimates[name] = Estimate(believed, 1e-8 * np.eye(6), 0.0)
        cell.plant.SetFreeBodyPose(context, cell.parts[name].body, believed)
    station.carry("plate", RIDERS)
    yield running
    running.resume(state)
    station.put_down()


def slip(running: RunningCell, X_HSlip: RigidTransform) -> None:
    """Move what is in the hand by a pose in H, unseen."""
    station, cell = running.station, running.simulation.cell
    X_WH = station.tool_pose(station.holder, "tip")
    for name in station.in_hand:
        pose = X_WH @ X_HSlip @ X_WH.inverse() @ cell.parts[name].X_WP(station.context)
        cell.plant.SetFreeBodyPose(running.simulation.context, cell.parts[name].body, pose)


def shown(running: RunningCell) -> list[Phase]:
    """Carry the phases of `present` out by putting the arm where they go; return them."""
    done = []
    for phase in present(running.station, "plate", guard=GUARD, awake=frozenset(["plate"])):
        carry_out(running, phase)
        done.append(phase)
    return done


def error(station: Station, part: str) -> tuple[float, float]:
    """Return how far the belief about a part is from the truth: of its middle [m], [rad]."""
    X_WTrue = station.cell.parts[part].X_WP(station.context)
    middle = station.part(part).mesh.bounds.mean(axis=0)
    off = X_WTrue @ middle - station.pose_of(part) @ middle
    turn = (X_WTrue.rotation().inverse() @ station.pose_of(part).rotation()).ToAngleAxis().angle()
    return float(np.linalg.norm(off)), float(turn)


ROLLED = RigidTransform(RollPitchYaw(np.deg2rad(4.0), 0.0, 0.0), [0.0, 0.0, 0.0])
SLID = RigidTransform(RollPitchYaw(np.deg2rad(-3.0), 0.0, 0.0), [0.0, 1.5e-3, -1e-3])


@needs_rendering
@pytest.mark.parametrize("X_HSlip", [ROLLED, SLID], ids=["rolled", "rolled and slid"])
def test_slip_in_the_grip_is_seen(holding: RunningCell, X_HSlip: RigidTransform) -> None:
    """A plate rolled by degrees about the pads; the bolts on it are known to have gone along."""
    station = holding.station
    slip(holding, X_HSlip)
    assert error(station, "plate")[1] > np.deg2rad(2.5)
    (phase,) = shown(holding)
    assert phase.subject == "plate"
    for part in station.in_hand:
        off, turned = error(station, part)
        assert off < 5e-4, part
        assert turned < np.deg2rad(1.0), part
    known = station.belief.estimates["plate"].covariance
    assert np.sqrt(known.diagonal()[:3]).max() < np.deg2rad(1.0)


@needs_rendering
def test_part_that_is_not_in_the_hand_fails(holding: RunningCell) -> None:
    cell, context = holding.simulation.cell, holding.simulation.context
    shown_at = holding.station.pose_of("plate")
    phases = present(holding.station, "plate", guard=GUARD, awake=frozenset(["plate"]))
    carry_out(holding, next(phases))
    gone = RigidTransform([0.6, -0.6, 0.0]) @ shown_at
    cell.plant.SetFreeBodyPose(context, cell.parts["plate"].body, gone)
    with pytest.raises(PhaseFailed, match="does not see plate"):
        list(phases)


@needs_rendering
def test_where_nothing_shows_it_the_hand_is_believed(
    holding: RunningCell, monkeypatch: pytest.MonkeyPatch
) -> None:
    station = holding.station
    monkeypatch.setattr(HandEye, "visible", lambda self, part, X_HP, q: 0.05)
    before = station.pose_of("plate")
    assert shown(holding) == []
    assert station.pose_of("plate").IsExactlyEqualTo(before)
    assert "plate" in station.recoveries[-1]


def test_truth_needs_no_showing() -> None:
    station = RunningCell(PRODUCT, CellConfig(), 0).station
    station.look()
    station.carry("plate")
    assert list(present(station, "plate", guard=GUARD, awake=frozenset())) == []


@needs_rendering
def test_points_of_the_hand_are_left_out(holding: RunningCell) -> None:
    """With the part far away nothing is left of what the camera sees around it."""
    station, cell = holding.station, holding.simulation.cell
    source = station.source
    assert isinstance(source, HandEye)
    X_HP = station.tool_pose(station.holder, "tip").inverse() @ station.pose_of("plate")
    (phase,) = shown(holding)
    for name in station.in_hand:
        away = RigidTransform([0.0, 0.0, -5.0])
        cell.plant.SetFreeBodyPose(holding.simulation.context, cell.parts[name].body, away)
    source.watch("plate", X_HP)
    (view,) = source.in_hand.views_now()
    apart = np.linalg.norm(view.points - station.pose_of("plate").translation(), axis=1)
    assert not (apart < 0.03).any(), phase


def test_gripping_spreads_a_pose_as_turns_and_slides_between_the_pads_do() -> None:
    """Of small turns about the pads and slides, drawn at random, the covariance is as foretold."""
    X_WH = RigidTransform(RollPitchYaw(1.0, 2.0, 0.3), [0.1, 0.2, 0.3])
    X_HP = RigidTransform(RollPitchYaw(0.4, 0.5, 0.6), [0.03, 0.02, -0.05])
    X_WPart, rng, errors = X_WH @ X_HP, np.random.default_rng(0), []
    sigma = np.r_[np.full(3, np.deg2rad(4.0)), 3e-4, 2e-3, 2e-3]
    small = 0.1  # Where turns add up like vectors.
    for draw in rng.normal(scale=small * sigma, size=(20_000, 6)):
        moved = X_WH @ RigidTransform(RollPitchYaw(draw[:3]), draw[3:]) @ X_HP
        turn = (X_WPart.rotation().inverse() @ moved.rotation()).ToAngleAxis()
        off = moved.translation() - X_WPart.translation()
        errors.append(np.r_[turn.angle() * turn.axis(), off])
    drawn, foretold = np.cov(np.array(errors).T) / small**2, gripped(X_WPart, X_WH)
    scale = np.sqrt(np.outer(foretold.diagonal(), foretold.diagonal()))
    assert np.abs((drawn - foretold) / scale).max() < 0.05
