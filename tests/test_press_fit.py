"""A bush that is pressed home on a rig: its force over depth, what holds it, and what does not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from press_rig import DEPTH, FORCE, MASS, PressRig
from pydrake.math import RigidTransform, RotationMatrix

from cell.products.loading import load_product
from cell.workpieces.press_fit import FitState

SPEED = 10e-3  # Of the ram [m/s].
WEIGHT = 9.81 * MASS


def pressed(depth: float, time_step: float = 1e-3) -> PressRig:
    """Return a rig whose ram has pressed the bush to a depth [m]."""
    rig = PressRig(time_step)
    while rig.depth < depth:
        rig.step(-SPEED)
    return rig


@cache
def curve(time_step: float) -> np.ndarray:
    """Return the ram's force at every half millimetre of depth [N]."""
    rig, rows = PressRig(time_step), []
    while rig.depth < DEPTH - 1e-4:
        rig.step(-SPEED)
        rows.append((rig.depth, rig.ram_force))
    depth, force = np.array(rows).T
    return np.interp(np.arange(1e-3, DEPTH - 2e-4, 5e-4), depth, force)


@pytest.mark.parametrize("time_step", [1e-3, 5e-4])
def test_force_grows_with_the_engaged_depth(time_step: float) -> None:
    """F(d) = F_seat d / d_seat, less the weight of the bush."""
    expected = FORCE * np.arange(1e-3, DEPTH - 2e-4, 5e-4) / DEPTH - WEIGHT
    np.testing.assert_allclose(curve(time_step), expected, rtol=0.01, atol=0.1)


def test_half_the_step_gives_the_same_curve() -> None:
    np.testing.assert_allclose(curve(5e-4), curve(1e-3), rtol=0.01, atol=0.05)


def test_a_fit_that_is_not_pushed_on_stands_under_the_force_that_is_left() -> None:
    """No creep: stuck is locked, whatever pushes with less than the friction."""
    rig = pressed(4e-3)
    rig.step(0.0, 300)
    before = rig.depth
    rig.step(0.0, 500)
    assert rig.state is FitState.STUCK
    assert 0.3 * FORCE < rig.ram_force < 0.52 * FORCE
    assert rig.depth == pytest.approx(before, abs=1e-8)


def test_the_seat_stops_it() -> None:
    """The flange is contact: from there on the ram pushes on the seat, and the force runs away."""
    rig = pressed(DEPTH - 1e-5)
    rig.step(-SPEED, 100)
    before, force = rig.depth, rig.ram_force
    rig.step(-SPEED, 50)
    assert rig.depth == pytest.approx(DEPTH, abs=1e-5)
    assert rig.depth - before < 2e-6
    # Nothing throws so light a bush back: the force grows evenly, with the stiffness of the ram.
    assert rig.ram_force - force == pytest.approx(2e4 * 50 * SPEED * 1e-3, rel=0.05)


@pytest.mark.parametrize(("share", "held"), [(0.9, True), (1.15, False)])
def test_it_comes_out_only_beyond_its_friction(share: float, held: bool) -> None:
    rig = pressed(5e-3)
    depth = rig.depth
    rig.step(0.1, 50)  # The ram goes away.
    rig.pull_bush(share * FORCE * depth / DEPTH + WEIGHT)
    rig.step(0.0, 100)
    if held:
        assert rig.state is FitState.STUCK
        # The ram leaves at once: the last step of the slide throws it back by F dt^2 / m.
        assert rig.depth == pytest.approx(depth, abs=2e-5)
    else:
        assert rig.depth < depth - 1e-3


def test_pulled_out_it_is_free() -> None:
    rig = pressed(1e-3)
    rig.step(0.1, 50)
    rig.pull_bush(2.0 * FORCE * rig.depth / DEPTH)
    rig.step(0.0, 100)
    assert rig.state is FitState.FREE
    assert rig.depth < 0.0


@pytest.mark.parametrize(
    ("X_HT", "caught"),
    [
        (RigidTransform([5e-5, 0, DEPTH - 1e-4]), True),
        (RigidTransform([1.5e-4, 0, DEPTH - 1e-4]), False),
        (RigidTransform([0, 0, DEPTH + 1e-4]), False),
        (RigidTransform(RotationMatrix.MakeXRotation(0.01), [0, 0, DEPTH - 1e-4]), True),
        (RigidTransform(RotationMatrix.MakeXRotation(0.03), [0, 0, DEPTH - 1e-4]), False),
        (RigidTransform(RotationMatrix.MakeZRotation(1.0), [0, 0, DEPTH - 1e-4]), True),
    ],
)
def test_only_a_tip_in_the_mouth_is_caught(X_HT: RigidTransform, caught: bool) -> None:
    """Gated in depth, across the axis and in tilt; however it is turned about the axis."""
    rig = PressRig()
    tip = rig.fit.tip_frame.CalcPoseInBodyFrame(rig.context)
    rig.put_bush(rig.fit.hole_frame.CalcPoseInWorld(rig.context) @ X_HT @ tip.inverse())
    rig.fits.step(rig.root, rig.time_step)
    assert (rig.state is not FitState.FREE) == caught


def test_a_turned_bush_is_not_turned_back() -> None:
    rig = PressRig()
    turned = RigidTransform(RotationMatrix.MakeZRotation(1.0), [0.0, 0.0, rig.above])
    rig.put_bush(turned)
    while rig.depth < 2e-3:
        rig.step(-SPEED)
    angle = rig.fit.X_HT(rig.context).rotation().ToAngleAxis().angle()
    assert angle == pytest.approx(1.0, abs=1e-3)


def test_a_restored_press_goes_on_to_the_last_bit() -> None:
    """In the middle of a slide: all that it is lives in the Context."""
    rig = pressed(3e-3)
    assert rig.state is FitState.IN
    other = PressRig()
    other.root.SetTime(rig.root.get_time())
    other.counter.set_seen(other.root, rig.counter.seen(rig.root))
    other.fits.restore(other.root, rig.fits.save(rig.root))
    x = rig.plant.GetPositionsAndVelocities(rig.context)
    other.plant.SetPositionsAndVelocities(other.context, x)
    other.height = rig.height
    other.simulator.Initialize()
    for each in (rig, other):
        each.step(-SPEED, 200)
        each.step(0.0, 100)
    assert rig.state is other.state is FitState.STUCK
    np.testing.assert_array_equal(
        rig.plant.GetPositionsAndVelocities(rig.context),
        other.plant.GetPositionsAndVelocities(other.context),
    )
    assert rig.fits.save(rig.root)["0"].tobytes() == other.fits.save(other.root)["0"].tobytes()


def test_a_product_without_press_fits_gets_nothing() -> None:
    assert load_product("motor_unit").presses == ()
