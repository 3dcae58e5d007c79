"""The soft jig in Drake: pressing, freezing, carrying, and continuing from a saved state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import trimesh
from jig_rig import Rig
from numpy.typing import NDArray

from cell.errors import InputError
from cell.fixtures.base import FixtureError
from cell.fixtures.soft_jig import JigParameters, JigState
from cell.fixtures.soft_jig.parameters import VacuumParameters
from experiments.jig.element_rig import ElementRig
from experiments.jig.specimens import Prism

# A short press that still reaches the drive's limit of 20 N.
FAST = {"speed": 0.04, "duration": 0.8}


@dataclass(frozen=True)
class Held:
    """A rig whose motor was pressed, frozen and let go, and what happened.

    Attributes:
        rig: A second after letting go.
        pressed_volume: Of the bed before freezing [m3].
        kick: Way of the motor since just before it was let go [m].
        speeds: Of the motor, per step after letting go [m/s].
    """

    rig: Rig
    pressed_volume: float
    kick: float
    speeds: list[float]


@pytest.fixture(scope="module")
def held() -> Held:
    rig = Rig()
    rig.press(**FAST)
    volume = rig.memory.bed.volume
    rig.jam()
    rig.step(100)
    before = rig.X_JM.translation()
    rig.let_go()
    speeds = []
    for _ in range(1000):
        rig.step()
        speeds.append(float(np.linalg.norm(rig.velocity)))
    return Held(rig, volume, float(np.linalg.norm(rig.X_JM.translation() - before)), speeds)


def full_state(rig: Rig) -> NDArray[np.float64]:
    return rig.plant.GetPositionsAndVelocities(rig.plant_context)


def test_states_follow_the_commands_and_the_pressure() -> None:
    """Inflated -> soft -> jammed when 95 % of the vacuum is there -> soft again."""
    rig = Rig()
    vacuum = rig.params.vacuum
    rig.jig.inflate(rig.context)
    assert rig.memory.state is JigState.INFLATED
    rig.jig.evacuate(rig.context)
    assert rig.memory.state is JigState.SOFT
    rig.step(250)
    assert rig.memory.pressure == pytest.approx(vacuum.pressure * (1 - np.exp(-1)), rel=1e-6)
    rig.jam()
    assert rig.context.get_time() == pytest.approx(-0.25 * np.log(0.05), abs=2e-3)
    rig.jig.soften(rig.context)
    assert rig.memory.state is JigState.SOFT
    rig.step(100)
    assert rig.memory.pressure < vacuum.pressure
    assert not rig.jig.freed(rig.context)  # 57 kPa are left, and 2 kPa after 0.95 s [D].
    rig.step(860)
    assert rig.jig.freed(rig.context)


def test_part_is_let_go_without_a_kick(held: Held) -> None:
    """Freezing and releasing move the motor by less than 0.3 mm and 20 mm/s."""
    assert held.kick < 0.3e-3
    assert max(held.speeds) < 20e-3


def test_frozen_bed_carries_the_part_at_rest(held: Held) -> None:
    """It stands: below 1 mm/s and 1 deg; the contact carries its weight and the suction."""
    assert held.speeds[-1] < 1e-3
    assert np.degrees(held.rig.tilt) < 1.0
    results = held.rig.plant.get_contact_results_output_port().Eval(held.rig.plant_context)
    assert results.num_hydroelastic_contacts() == 1
    assert results.num_point_pair_contacts() == 0
    force = results.hydroelastic_contact_info(0).F_Ac_W().translational()
    suction = held.rig.memory.forces[0].F_Bq_W.translational()[2]
    assert suction < 0
    assert abs(force[2]) == pytest.approx(0.195 * 9.81 - suction, rel=0.02)


def test_bed_keeps_its_volume(held: Held) -> None:
    """Collar, dilation and contraction account for it from inflation to the frozen bed."""
    bed = held.rig.memory.bed
    rest = type(bed)(bed.bag, bed.soil).volume
    assert held.pressed_volume == pytest.approx(rest + bed.ledger.dilated, rel=0.01)
    assert bed.volume == pytest.approx(rest + bed.ledger.dilated - bed.contracted, rel=1e-9)
    assert bed.contracted < 1.01 * held.rig.params.vacuum.contraction * bed.volume


def test_pressed_depth_is_in_the_range_of_the_references(held: Held) -> None:
    """22 N (20 N and the motor's weight) on the can.

    A quasi-static prototype with its collar at the rim, which stretches the membrane most, sinks
    8.5 mm; the discrete elements, which have no membrane, bear no more than 11 N at 14.5 mm.
    """
    assert 8.5e-3 < held.rig.depth < 20e-3


def test_half_the_step_gives_the_same_depth() -> None:
    depth = []
    for time_step in (1e-3, 0.5e-3):
        rig = Rig(time_step=time_step)
        rig.press(**FAST)
        depth.append(rig.depth)
    assert depth[1] == pytest.approx(depth[0], rel=0.05)


def test_restored_state_continues_bit_for_bit() -> None:
    """In the middle of pressing and across the freezing, from a copied Context or from arrays."""
    rig = Rig()
    rig.press(speed=0.04, duration=0.35)
    rig.jig.evacuate(rig.context)
    rig.step(13)
    context, saved = rig.context.Clone(), rig.jig.save(rig.context)
    rig.step(850)
    first, heights = full_state(rig), rig.memory.bed.heights.copy()
    assert rig.memory.state is JigState.JAMMED
    for from_arrays in (False, True):
        rig.context.SetTimeStateAndParametersFrom(context)
        if from_arrays:
            rig.jig.inflate(rig.context)
            rig.jig.restore(rig.context, saved)
        rig.simulator.Initialize()
        assert rig.memory.state is JigState.SOFT
        rig.step(850)
        assert np.array_equal(full_state(rig), first)
        assert np.array_equal(rig.memory.bed.heights, heights)


def test_frozen_part_resists_torque_and_side_load(held: Held) -> None:
    """0.1 N m about its axis and 3 N at half height leave it within 1 deg and 1 mm."""
    start = held.rig.X_JM
    held.rig.pull((3.0, 0.0, 0.0), (0.0, 0.0, 0.1), (0.0, 0.0, -0.0267))
    held.rig.step(300)
    moved = start.InvertAndCompose(held.rig.X_JM)
    held.rig.unload()
    held.rig.step(200)
    assert np.linalg.norm(moved.translation()) < 1e-3
    assert np.degrees(moved.rotation().ToAngleAxis().angle()) < 1.0


def test_letting_air_in_keeps_the_part_where_it_is(held: Held) -> None:
    """Soft again, the plastic bed carries the weight in the same imprint."""
    height = held.rig.X_JM.translation()[2]
    held.rig.jig.soften(held.rig.context)
    held.rig.step(500)
    assert held.rig.memory.state is JigState.SOFT
    assert held.rig.X_JM.translation()[2] == pytest.approx(height, abs=1e-3)
    assert np.linalg.norm(held.rig.velocity) < 5e-3
    up = [force.F_Bq_W.translational()[2] for force in held.rig.memory.forces]
    assert up[0] == pytest.approx(0.195 * 9.81, rel=0.05)
    assert sum(up) == pytest.approx(0.0, abs=1e-12)


def test_inflating_wipes_the_imprint(held: Held) -> None:
    held.rig.jig.inflate(held.rig.context)
    bed = held.rig.memory.bed
    assert bed.heights.max() == pytest.approx(JigParameters().bag.cap_height)
    assert held.rig.memory.state is JigState.INFLATED


def test_part_without_a_surface_for_the_bed_is_refused(held: Held) -> None:
    """It would fall through the frozen bed."""
    carriage = held.rig.plant.GetBodyByName("carriage")
    with pytest.raises(FixtureError, match="carriage.*bed_"):
        held.rig.jig.receive(held.rig.context, carriage, trimesh.creation.box((0.01,) * 3))


def test_a_vacuum_beyond_the_pump_is_refused_and_none_leaves_the_bag_soft(held: Held) -> None:
    rig = held.rig
    for pressure in (-1.0, 90001.0):
        with pytest.raises(InputError, match="beyond the pump: it draws 0 to 90000 Pa"):
            rig.jig.evacuate(rig.context, pressure)
    rig.jig.evacuate(rig.context, 0.0)
    assert rig.memory.target == 0.0
    assert rig.memory.state is JigState.SOFT


def test_imprint_closes_with_the_vacuum() -> None:
    """Beads contract with about p^0.7: not at all where nothing is pumped out, half at 30 kPa."""
    shares = [VacuumParameters().closing(pressure) for pressure in (0.0, 30e3, 90e3)]
    assert shares == pytest.approx([0.0, 0.463, 1.0], abs=1e-3)


def test_friction_is_the_same_soft_and_frozen() -> None:
    """Drake combines 0.9 of the membrane and 0.5 of the part harmonically: 0.64."""
    rig = ElementRig(part=Prism())
    (samples,) = rig.jig.memory(rig.root).pressing.values()
    assert samples.friction == pytest.approx(2 * 0.9 * 0.5 / (0.9 + 0.5))
