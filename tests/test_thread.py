"""A bolt that is driven home: gates, helix, clamp force, and what holds it afterwards."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from thread_rig import BOLT, ThreadRig

from cell.errors import UnknownName
from cell.machines.driver import tightening_speed
from cell.workpieces.thread import (
    BIT_GATE,
    ENGAGED_MASS_FACTOR,
    NO_BIT,
    THREAD_GATE,
    Engagement,
    Gate,
    Misfit,
    ThreadState,
)

FIND_SPEED = 3.0  # The bit turns slowly until its hex meets the socket [rad/s].
SLOW_BELOW = 6e-4  # [m]


@dataclass(frozen=True)
class Story:
    """One bolt from standing loose to tightened, the bit gone.

    Attributes:
        rig: At the end.
        loose_mass: Of the bolt before it was driven [kg].
        driven_mass: Of the bolt while its thread is engaged [kg].
        with_high_bit: What became of the thread while the bit turned 20 mm above the socket.
        with_standing_bit: And while the bit stood in the socket, in one of its hex positions.
        resting_misfit: Of the thread, as the bolt stands loose on its mouth.
        bit_misfit, thread_misfit: When the ties closed.
        helix: Turns and advance [m] since the thread caught, one row per step until near the seat.
        torque: Of the spindle when the clutch tripped [N m].
        clamp_at_trip, clamp_after: Before locking, and after the bit has left [N].
        under_push: What became of it when the spindle stood and the bit still pushed.
    """

    rig: ThreadRig
    loose_mass: float
    driven_mass: float
    with_high_bit: Engagement
    with_standing_bit: Engagement
    resting_misfit: Misfit
    bit_misfit: Misfit
    thread_misfit: Misfit
    helix: np.ndarray
    torque: float
    clamp_at_trip: float
    clamp_after: float
    under_push: Engagement


def mass(rig: ThreadRig) -> float:
    return rig.bolt.get_mass(rig.context)


def engagement(rig: ThreadRig) -> Engagement:
    return rig.threads.engagement(rig.root, BOLT)


def engage_bit(rig: ThreadRig) -> Misfit:
    """Lower the slowly turning bit into the socket; return its misfit when it dropped in."""
    rig.put_bit(rig.seated_bit + [0.0, 0.0, 0.002])
    rig.driver.command(rig.root, FIND_SPEED)
    for _ in range(2000):
        rig.move_bit(-0.02 if rig.p_WE[2] > rig.seated_bit[2] else 0.0)
        rig.step()
        if engagement(rig).bit_position != NO_BIT:
            misfit, position = rig.thread.bit_misfit(rig.context)
            assert position == engagement(rig).bit_position
            return misfit
    raise AssertionError("the bit found no socket")


def catch_thread(rig: ThreadRig) -> Misfit:
    """Turn the bolt until its thread catches; return the misfit at which it did."""
    rig.driver.command(rig.root, rig.config.free_speed)
    for _ in range(1000):
        if engagement(rig).state is ThreadState.CAUGHT:
            misfit, _ = rig.thread.thread_misfit(rig.context)
            return misfit
        rig.keep_thrust()
        rig.step()
    raise AssertionError("the thread did not catch")


def run_down(rig: ThreadRig) -> np.ndarray:
    """Drive the bolt to just above its seat; return turns and advance, (n, 2)."""
    start, rows = rig.height, []
    while rig.height > SLOW_BELOW:
        rig.keep_thrust()
        rig.step()
        rows.append((rig.threads.turns(rig.root, BOLT), start - rig.height))
        assert len(rows) < 4000
    return np.array(rows)


def tighten(rig: ThreadRig) -> tuple[float, float]:
    """Turn until the clutch trips; return torque and clamp force at that moment."""
    rig.driver.command(rig.root, tightening_speed(rig.screw.torque, rig.screw.diameter))
    for _ in range(3000):
        rig.keep_thrust()
        rig.step()
        torque = rig.driver.read(rig.context).torque
        if torque >= rig.screw.torque:
            return torque, rig.thread.clamp_force(rig.context)
    raise AssertionError("the clutch did not trip")


def leave(rig: ThreadRig) -> Engagement:
    """Stop the spindle, take the bit away; return what the thread was before that."""
    rig.driver.command(rig.root, 0.0)
    rig.step(50)
    under_push = engagement(rig)
    for _ in range(150):
        rig.move_bit(0.1)
        rig.step()
    return under_push


def with_standing_bit() -> Engagement:
    """Put a bit that stands into the socket for some steps; return what became of the thread."""
    rig = ThreadRig()
    rig.put_bit(rig.seated_bit)
    misfit, _ = rig.thread.bit_misfit(rig.context)
    assert misfit.within(BIT_GATE)
    rig.step(5)
    return engagement(rig)


@pytest.fixture(scope="module")
def story() -> Story:
    rig = ThreadRig()
    rig.step(50)
    resting_misfit, _ = rig.thread.thread_misfit(rig.context)
    rig.driver.command(rig.root, FIND_SPEED)
    rig.step(5)
    with_high_bit = engagement(rig)
    loose_mass = mass(rig)
    bit_misfit = engage_bit(rig)
    thread_misfit = catch_thread(rig)
    helix = run_down(rig)
    torque, clamp_at_trip = tighten(rig)
    driven_mass = mass(rig)
    under_push = leave(rig)
    return Story(
        rig=rig,
        loose_mass=loose_mass,
        driven_mass=driven_mass,
        with_high_bit=with_high_bit,
        with_standing_bit=with_standing_bit(),
        resting_misfit=resting_misfit,
        bit_misfit=bit_misfit,
        thread_misfit=thread_misfit,
        helix=helix,
        torque=torque,
        clamp_at_trip=clamp_at_trip,
        clamp_after=rig.thread.clamp_force(rig.context),
        under_push=under_push,
    )


def test_bit_engages_only_within_its_gate_and_only_while_it_turns(story: Story) -> None:
    assert story.with_high_bit.bit_position == NO_BIT
    assert story.with_standing_bit.bit_position == NO_BIT
    assert story.bit_misfit.within(BIT_GATE)


def test_thread_catches_only_within_its_gate_and_only_with_the_bit_on(story: Story) -> None:
    """A loose bolt stands on the mouth of its thread, well inside the gate, and stays loose."""
    assert story.resting_misfit.within(THREAD_GATE)
    assert story.with_high_bit.state is ThreadState.FREE
    assert story.thread_misfit.within(THREAD_GATE)


def test_bolt_advances_one_pitch_per_turn(story: Story) -> None:
    turns, advance = story.helix.T
    assert turns[-1] > 8
    slope = np.polyfit(turns, advance, 1)[0]
    assert slope == pytest.approx(story.rig.screw.pitch, rel=0.02)


def test_clamp_force_follows_the_torque(story: Story) -> None:
    """F = T / (K d): friction under the head, by contact, makes what K says."""
    screw = story.rig.screw
    expected = story.torque / (screw.nut_factor * screw.diameter)
    assert story.clamp_at_trip == pytest.approx(expected, rel=0.15)


def test_bit_stays_while_it_pushes_and_the_thread_is_locked(story: Story) -> None:
    """A spindle that stands locks the thread; the bit leaves when its holder pushes no more."""
    assert story.under_push.state is ThreadState.LOCKED
    assert story.under_push.bit_position != NO_BIT
    assert engagement(story.rig).bit_position == NO_BIT


def test_clamp_force_stays_when_the_bit_leaves(story: Story) -> None:
    assert engagement(story.rig).state is ThreadState.LOCKED
    assert story.clamp_after == pytest.approx(story.clamp_at_trip, rel=0.10)


def test_only_an_engaged_bolt_has_added_inertia(story: Story) -> None:
    real = story.rig.bolt.default_mass()
    assert story.loose_mass == pytest.approx(real, rel=1e-12)
    assert story.driven_mass == pytest.approx(ENGAGED_MASS_FACTOR * real, rel=1e-12)


def test_plate_is_pressed_onto_the_motor(story: Story) -> None:
    """One bolt, off the centre, clamps the plate where it lies: no shift beyond the fit's play."""
    X_WPlate = story.rig.plant.EvalBodyPoseInWorld(story.rig.context, story.rig.plate)
    assert np.linalg.norm(X_WPlate.translation()) < 0.15e-3


def test_loosened_bolt_has_its_own_inertia_and_turns_freely() -> None:
    rig = ThreadRig()
    rig.threads.set(rig.root, BOLT, Engagement(ThreadState.CAUGHT, bit_position=2))
    assert mass(rig) > rig.bolt.default_mass()
    rig.threads.set(rig.root, BOLT, Engagement())
    inertia = rig.bolt.CalcSpatialInertiaInBodyFrame(rig.context)
    real = rig.bolt.default_spatial_inertia()
    np.testing.assert_allclose(
        inertia.CopyToFullMatrix6(), real.CopyToFullMatrix6(), rtol=1e-9, atol=1e-15
    )
    turn_at_once(rig)
    assert engagement(rig) == Engagement()


def turn_at_once(rig: ThreadRig) -> None:
    """Command the spindle to turn and apply the rules, where everything stands."""
    rig.driver.command(rig.root, rig.config.free_speed)
    rig.threads.step(rig.root, rig.time_step)


def test_thread_catches_on_its_helix_and_nowhere_else() -> None:
    rig = ThreadRig()
    X_WH = rig.product.parts["bolt_1"].X_AP
    for turns, above in ((0.0, 0.0), (0.3, 0.0), (3.8, 0.0), (3.8, 1e-4), (7.5, -1e-4)):
        z = turns * rig.screw.pitch + above
        R_HF = RotationMatrix.MakeZRotation(2 * np.pi * turns)
        rig.plant.SetFreeBodyPose(rig.context, rig.bolt, X_WH @ RigidTransform(R_HF, [0, 0, z]))
        rig.threads.set(rig.root, BOLT, Engagement(bit_position=0))
        misfit, theta = rig.thread.thread_misfit(rig.context)
        assert theta == pytest.approx(2 * np.pi * turns, abs=1e-9)
        assert misfit.axial == pytest.approx(above, abs=1e-9)
        turn_at_once(rig)
        assert (engagement(rig).state is ThreadState.CAUGHT) == (above == 0.0)


def test_locked_thread_turns_again_when_the_spindle_does() -> None:
    """In the middle of a drive: stopped it is locked, turned on it goes on from where it was."""
    rig = ThreadRig()
    rig.threads.set(rig.root, BOLT, Engagement(ThreadState.CAUGHT, 0, 1.5))
    rig.threads.step(rig.root, rig.time_step)
    assert engagement(rig).state is ThreadState.LOCKED
    rig.threads.set(rig.root, BOLT, Engagement(ThreadState.LOCKED, 0, 1.5))
    turn_at_once(rig)
    assert engagement(rig) == Engagement(ThreadState.CAUGHT, 0, 1.5)


def test_sleeping_bolt_is_not_engaged() -> None:
    """A bit that passes over bolts in the tray takes none of them along."""
    rig = ThreadRig()
    joint = rig.plant.GetJointByName("body", rig.bolt.model_instance())
    joint.Lock(rig.context)
    rig.put_bit(rig.seated_bit)
    turn_at_once(rig)
    assert engagement(rig) == Engagement()


def test_unknown_bolt_is_named_with_the_known_ones() -> None:
    rig = ThreadRig()
    for ask in (rig.threads.state, rig.threads.bit_engaged, rig.threads.turns):
        with pytest.raises(UnknownName, match="No bolt 'bolt_9'.*Known: bolt_1"):
            ask(rig.root, "bolt_9")
    with pytest.raises(UnknownName):
        rig.threads.set(rig.root, "bolt_9", Engagement())


@pytest.mark.parametrize("error", ["axial", "lateral", "tilt", "angle"])
def test_every_error_alone_keeps_a_gate_shut(error: str) -> None:
    gate = Gate(axial=1e-3, lateral=1e-3, tilt=0.1, angle=0.1)
    fits = Misfit(0.9e-3, 0.9e-3, 0.09, 0.09)
    assert fits.within(gate)
    assert not replace(fits, **{error: 0.2}).within(gate)
    if error in ("axial", "angle"):
        assert not replace(fits, **{error: -0.2}).within(gate)


def test_misfit_measures_what_was_put_in() -> None:
    R = RotationMatrix.MakeZRotation(0.2) @ RotationMatrix.MakeXRotation(0.1)
    misfit = Misfit.between(RigidTransform(R, [3e-3, 4e-3, -1e-3]))
    assert misfit.axial == pytest.approx(-1e-3)
    assert misfit.lateral == pytest.approx(5e-3)
    assert misfit.tilt == pytest.approx(0.1)
    assert misfit.angle == pytest.approx(0.2)
