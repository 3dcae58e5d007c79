"""The end of the bit: beside a socket it stands on the head, over it it goes in."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from thread_rig import BOLT, ThreadRig

from cell import Cell, Simulation
from cell.simulation.state import restore_state, save_state

FIND_SPEED = 3.0  # [rad/s]
STEPS = 5
DEEP = 1.8e-3  # From the top of the M3 head to the bit's end when it is in [m].


def lowered(rig: ThreadRig, off: float, speed: float) -> float:
    """Bring the bit down beside the socket [m] and let it turn [rad/s].

    Returns:
        How far above its seat its end comes to stand [m].
    """
    seat = rig.seated_bit
    rig.put_bit(seat + [off, 0.0, 0.004])
    rig.driver.command(rig.root, speed)
    for _ in range(600):
        rig.move_bit(-0.02 if rig.p_WE[2] > seat[2] else 0.0)
        rig.step()
    return float(rig.bit.CalcPoseInWorld(rig.context).translation()[2] - seat[2])


@pytest.mark.parametrize("off", [6e-4, 1.5e-3])
def test_bit_beside_the_socket_stands_on_the_head(off: float) -> None:
    rig = ThreadRig()
    assert lowered(rig, off, FIND_SPEED) == pytest.approx(DEEP, abs=2e-5)
    assert rig.driver.push(rig.context) == pytest.approx(2e3 * DEEP, rel=0.02)
    assert not rig.threads.bit_engaged(rig.root, BOLT)
    # Lifted and set down over the socket, it drops in.
    p_WF = rig.thread.bolt.body_frame().CalcPoseInWorld(rig.context).translation()
    aside = float(np.hypot(*(p_WF - rig.seated_bit)[:2]))
    assert aside < 1e-3
    assert lowered(rig, float((p_WF - rig.seated_bit)[0]), FIND_SPEED) < 1e-4
    assert rig.threads.bit_engaged(rig.root, BOLT)


def test_bit_over_the_socket_goes_in_untouched() -> None:
    rig = ThreadRig()
    assert abs(lowered(rig, 2e-4, 0.0)) < 2e-5
    assert abs(rig.driver.push(rig.context)) < 0.05


def test_what_touches_is_restored(motor_unit_cell: Cell) -> None:
    """Also in the depth of a socket, where the shape would be inside of the head."""
    simulation = in_a_socket(motor_unit_cell)
    state, velocities = save_state(simulation), []
    for _ in range(2):
        simulation.step()
        velocities.append(motor_unit_cell.plant.GetVelocities(simulation.context).copy())
        simulation = Simulation(motor_unit_cell)
        restore_state(simulation, state)
    np.testing.assert_array_equal(*velocities)
    # Nothing but its weight has moved the bolt.
    fall = motor_unit_cell.parts[BOLT].velocity(simulation.context)
    np.testing.assert_allclose(fall, [0.0, 0.0, 0.0, 0.0, 0.0, -9.81 * STEPS * 1e-3], atol=1e-6)


def in_a_socket(cell: Cell) -> Simulation:
    """Return a run in which a bolt falls off the bit that is in its socket, and does not turn."""
    simulation = Simulation(cell)
    X_WE = cell.screwdriver.bit_frame.CalcPoseInWorld(simulation.context)
    seat = cell.product.screws[BOLT].bit_seat
    X_EF = RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0.0, 0.0, seat])
    cell.parts.sleep_all_but(simulation.root, [BOLT])
    cell.plant.SetFreeBodyPose(simulation.context, cell.parts[BOLT].body, X_WE @ X_EF)
    cell.threads.meet_heads(simulation.root)
    for _ in range(STEPS):
        simulation.step()
    return simulation
