"""Cartesian impedance of an arm: a damped spring with a limit, that ends at its target."""

from __future__ import annotations

from enum import Enum

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from cell import Cell, Simulation
from cell.simulation.phase import Impedance, Phase, after
from cell.simulation.simulation import impedance_torque

STIFFNESS = np.array([5.0, 5.0, 40.0, 4000.0, 4000.0, 2000.0])
LIMIT = np.array([1.0, 1.0, 1.0, 15.0, 15.0, 10.0])
X_FC = RigidTransform([0.0, 0.02, 0.01])


class Kind(Enum):
    GO = "go"


@pytest.fixture
def simulation(motor_unit_cell: Cell) -> Simulation:
    return Simulation(motor_unit_cell)


def centre(simulation: Simulation) -> RigidTransform:
    """Return the pose of the compliance centre."""
    return simulation.cell.holder.frame("tip").CalcPoseInWorld(simulation.context) @ X_FC


def spring(simulation: Simulation, X_WD: RigidTransform, **changes: np.ndarray) -> Impedance:
    frame = simulation.cell.holder.frame("tip")
    return Impedance(frame, X_FC, lambda _: X_WD, STIFFNESS, LIMIT, **changes)


def wrench_at_centre(simulation: Simulation, command: Impedance) -> np.ndarray:
    """Return the wrench (6,) in W that the joint torques would hold at the compliance centre."""
    arm, context = simulation.cell.holder, simulation.context
    torque = impedance_torque(arm, context, command, 0.0)
    jacobian = arm.jacobian(context, command.frame, X_FC.translation())
    return np.linalg.solve(jacobian.T, torque)


def displaced(X_WC: RigidTransform, axis: int, amount: float) -> RigidTransform:
    """Return the pose moved by an angle (axis 0 to 2) or a length (3 to 5) along an axis of W."""
    step = np.zeros(6)
    step[axis] = amount
    turns = (
        RotationMatrix.MakeXRotation(step[0])
        @ RotationMatrix.MakeYRotation(step[1])
        @ RotationMatrix.MakeZRotation(step[2])
    )
    return RigidTransform(turns @ X_WC.rotation(), X_WC.translation() + step[3:])


def test_no_torque_at_the_target(simulation: Simulation) -> None:
    command = spring(simulation, centre(simulation))
    torque = impedance_torque(simulation.cell.holder, simulation.context, command, 0.0)
    np.testing.assert_allclose(torque, np.zeros(6), atol=1e-9)


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_spring_pulls_to_the_target_along_each_axis(
    simulation: Simulation, axis: int, sign: float
) -> None:
    amount = sign * 1e-3
    command = spring(simulation, displaced(centre(simulation), axis, amount))
    expected = np.zeros(6)
    expected[axis] = STIFFNESS[axis] * amount
    np.testing.assert_allclose(wrench_at_centre(simulation, command), expected, atol=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_static_wrench_stays_below_its_limit(simulation: Simulation, seed: int) -> None:
    """However far the target is: a hand that has run into something presses no harder."""
    rng = np.random.default_rng(seed)
    X_WC = centre(simulation)
    R = RotationMatrix.MakeZRotation(rng.uniform(-3.0, 3.0))
    X_WD = RigidTransform(R @ X_WC.rotation(), X_WC.translation() + rng.normal(scale=0.1, size=3))
    wrench = wrench_at_centre(simulation, spring(simulation, X_WD))
    assert (np.abs(wrench) <= LIMIT + 1e-9).all()


def test_bias_is_carried_on_top(simulation: Simulation) -> None:
    bias = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 4.0])
    command = spring(simulation, centre(simulation), bias=bias)
    np.testing.assert_allclose(wrench_at_centre(simulation, command), bias, atol=1e-9)


def test_damping_takes_power_from_every_motion(simulation: Simulation) -> None:
    arm, plant, context = simulation.cell.holder, simulation.cell.plant, simulation.context
    command = spring(simulation, centre(simulation))
    rng = np.random.default_rng(0)
    for _ in range(20):
        v = rng.normal(scale=0.1, size=6)
        plant.SetVelocities(context, arm.instance, v)
        assert impedance_torque(arm, context, command, 0.0) @ v < 0.0


def test_free_hand_goes_to_the_target_and_stops_there(simulation: Simulation) -> None:
    """5 mm aside: a second later it is within 0.1 mm and slower than 1 mm/s."""
    goal = displaced(centre(simulation), 3, 5e-3)
    commands = {simulation.cell.holder.name: spring(simulation, goal)}
    phase = Phase(Kind.GO, after(1.0), timeout=2.0, commands=commands)
    simulation.run_phase(phase)
    error = centre(simulation).translation() - goal.translation()
    assert np.linalg.norm(error) < 1e-4
    arm, frame = simulation.cell.holder, simulation.cell.holder.frame("tip")
    jacobian = arm.jacobian(simulation.context, frame, X_FC.translation())
    assert np.linalg.norm((jacobian @ arm.velocities(simulation.context))[3:]) < 1e-3
    assert not simulation.cell.holder.drive.uses_torque(simulation.root)
