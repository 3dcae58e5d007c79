"""Saving and restoring a run: what follows is the same to the last bit."""

from __future__ import annotations

import contextlib
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from stories import (
    BOX_STORY,
    JIG_STEPS,
    JIG_STORY,
    QUICK,
    STEP,
    Story,
    add_box,
    assert_same,
    fix,
    let_go,
    play_ours,
    press_motor,
    push,
    sleep,
    small_product,
    snapshot,
    wake,
)

from cell import Cell, CellConfig, FixtureError, Simulation, build_cell
from cell.errors import InputError
from cell.fixtures.soft_jig.jig import SoftJig
from cell.simulation.events import receive_part
from cell.simulation.state import State, read_state, restore_state, save_state, write_state

STEPS = 50


def history(simulation: Simulation) -> np.ndarray:
    """Step on; return positions and velocities after every step, (STEPS, n)."""
    rows = []
    for _ in range(STEPS):
        simulation.step()
        plant, context = simulation.cell.plant, simulation.context
        rows.append(plant.GetPositionsAndVelocities(context).copy())
    return np.array(rows)


def under_way(cell: Cell) -> Simulation:
    """Return a run with motor and bolt awake, the jaws closing, the spindle turning, a soft bag."""
    simulation = Simulation(cell)
    cell.parts.sleep_all_but(simulation.root, ["motor", "bolt_3"])
    cell.gripper.command(simulation.root, 0.03, 10.0)
    cell.screwdriver.command(simulation.root, 20.0)
    receive_part("motor")(simulation)
    for _ in range(20):
        simulation.step()
    return simulation


def test_continuing_is_bit_identical_in_the_same_and_in_a_new_simulation(
    motor_unit_cell: Cell, tmp_path: Path
) -> None:
    simulation = under_way(motor_unit_cell)
    write_state(tmp_path / "state.npz", save_state(simulation))
    expected = history(simulation)
    assert np.ptp(expected, axis=0).max() > 1e-3  # Something moves.
    state = read_state(tmp_path / "state.npz")
    restore_state(simulation, state)
    np.testing.assert_array_equal(history(simulation), expected)
    fresh = Simulation(motor_unit_cell)
    restore_state(fresh, state)
    assert fresh.time == pytest.approx(0.020)
    np.testing.assert_array_equal(history(fresh), expected)


def test_restored_state_saves_to_the_same_arrays(motor_unit_cell: Cell) -> None:
    state = save_state(under_way(motor_unit_cell))
    fresh = Simulation(motor_unit_cell)
    restore_state(fresh, state | {"q/of the caller's own": np.zeros(3)})
    again = save_state(fresh)
    assert again.keys() == state.keys()
    for name, value in state.items():
        np.testing.assert_array_equal(again[name], value, err_msg=name)


def test_bodies_in_the_bag_keep_their_order(motor_unit_cell: Cell) -> None:
    """Their forces are added in it, and sums of rounded numbers depend on it."""
    cell = motor_unit_cell
    simulation, fresh = Simulation(cell), Simulation(cell)
    for name in reversed(list(cell.parts.by_name)):
        with contextlib.suppress(FixtureError):  # Some have nothing for the bag to hold.
            receive_part(name)(simulation)
    restore_state(fresh, save_state(simulation))
    pressing = list(soft_jig(cell).memory(simulation.root).pressing)
    assert len(pressing) > 1
    assert list(soft_jig(cell).memory(fresh.root).pressing) == pressing


def test_restoring_brings_back_sleep_and_drive_mode(motor_unit_cell: Cell) -> None:
    cell = motor_unit_cell
    simulation = Simulation(cell)
    root, drive = simulation.root, cell.holder.drive
    cell.parts.sleep_all_but(root, ["plate"])
    drive.use_torque(root, True)
    state = save_state(simulation)
    drive.use_torque(root, False)
    cell.parts.sleep_all_but(root, ["motor"])
    restore_state(simulation, state)
    assert drive.uses_torque(root)
    assert [part.part.name for part in cell.parts if not part.asleep(root)] == ["plate"]


# Asleep in the soft bag, which then jams around it.
ASLEEP_STORY: Story = {0: press_motor, 200: let_go, 250: sleep, 300: fix, 500: wake}


@pytest.fixture(scope="module", params=["full", "linked"])
def small_cell(request: pytest.FixtureRequest) -> Cell:
    config = QUICK.with_changes({"simulation.contact": request.param})
    return build_cell(config, small_product("motor"))


def go_on(cell: Cell, simulation: Simulation, story: Story, steps: int) -> None:
    for step in range(simulation.steps, steps):
        if step in story:
            story[step](cell, simulation.root)
        simulation.step()


@pytest.mark.parametrize(
    ("story", "steps", "moments"),
    [(JIG_STORY, JIG_STEPS, (348, 420, 470)), (ASLEEP_STORY, 600, (270,))],
)
def test_jig_and_sleepers_continue_bit_for_bit(
    small_cell: Cell, story: Story, steps: int, moments: tuple[int, ...]
) -> None:
    """While pressing, a step before jamming, jammed, asleep, vented: force plate and all."""
    simulation, states = Simulation(small_cell), {}
    for moment in moments:
        go_on(small_cell, simulation, story, moment)
        states[moment] = save_state(simulation)
    go_on(small_cell, simulation, story, steps)
    expected = snapshot(small_cell, simulation.root)
    for moment, state in states.items():
        fresh = Simulation(small_cell)
        restore_state(fresh, state)
        pushing = moment < min(k for k, command in story.items() if command is let_go)
        push(small_cell, fresh.root, small_cell.parts["motor"].body, 20.0 if pushing else 0.0)
        go_on(small_cell, fresh, story, steps)
        assert_same(snapshot(small_cell, fresh.root), expected)


def test_load_of_a_part_that_falls_asleep_right_after_a_restore(small_cell: Cell) -> None:
    """Drake has no contact then to read it from: the state has."""
    story = {k: command for k, command in JIG_STORY.items() if k < 450}
    simulation = play_ours(small_cell, story, 470)
    state = save_state(simulation)
    fresh = Simulation(small_cell)
    restore_state(fresh, state)
    for each in (simulation, fresh):
        sleep(small_cell, each.root)
        each.step()
    assert_same(snapshot(small_cell, fresh.root), snapshot(small_cell, simulation.root))
    load = small_cell.force_plate.read(fresh.context)[5]
    assert load < -60.0  # 59.35 N without the motor.


def test_state_goes_over_to_another_build_of_the_same_cell(small_cell: Cell) -> None:
    """With a caller's own body, asleep on the jig when the state was saved."""
    one, other = (build_cell(QUICK, small_product("motor"), extend=add_box) for _ in range(2))
    simulation = play_ours(one, BOX_STORY, 470)
    state = save_state(simulation)
    fresh = Simulation(other)
    restore_state(fresh, state)
    assert other.plant.GetBodyByName("box").is_locked(fresh.context)
    push(other, fresh.root, other.parts["motor"].body, 0.0)
    for cell, each in ((one, simulation), (other, fresh)):
        go_on(cell, each, BOX_STORY, 560)
    assert_same(snapshot(other, fresh.root), snapshot(one, simulation.root))


def refused(cell: Cell, state: State) -> str:
    """Return the one line with which a state is refused."""
    with pytest.raises(InputError) as error:
        restore_state(Simulation(cell), state)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_state_of_something_else_is_refused(small_cell: Cell) -> None:
    state = save_state(Simulation(small_cell))
    product = small_cell.product
    heavier = replace(product.parts["motor"], mass=0.2)
    for config, other, message in (
        (QUICK, small_product("plate"), "another product: motor_unit .*, not motor_unit "),
        (QUICK, replace(product, parts={"motor": heavier}), "another product"),
        (CellConfig(), product, "another configuration"),
    ):
        assert re.search(message, refused(build_cell(config, other), state))
    line = refused(small_cell, state | {"of/Drake": np.array("1.2.3")})
    assert line.startswith("The saved state is of another Drake: 1.2.3, not ")
    assert "another product: unknown" in refused(small_cell, {})


def test_every_missing_array_is_noticed(small_cell: Cell) -> None:
    state = save_state(play_ours(small_cell, {0: press_motor}, 20))
    simulation = Simulation(small_cell)
    for name in state.keys() - {f"of/{what}" for what in simulation.identity}:
        rest = {other: value for other, value in state.items() if other != name}
        with pytest.raises(InputError, match=f"The saved state lacks '{re.escape(name)}'"):
            restore_state(simulation, rest)


@pytest.mark.parametrize("name", ["q", "steps", "fixture/state", "fixture/tetrahedra"])
def test_damaged_state_is_refused_and_changes_nothing(small_cell: Cell, name: str) -> None:
    """Also where only numbers differ, and never half way."""
    state = save_state(play_ours(small_cell, {0: press_motor}, 20))
    value = state[name]
    damages = [np.zeros(7)]
    if value.dtype.kind == "f":
        damages += [value * np.nan, value + 1e-12]
    elif value.dtype.kind == "U":
        damages.append(np.array("molten"))
    simulation = Simulation(small_cell)
    before = save_state(simulation)
    for damaged in damages:
        with pytest.raises(InputError, match=f"damaged: '{name}' is not what was saved"):
            restore_state(simulation, state | {name: damaged})
    assert_same(save_state(simulation), before)


def test_vacuum_changed_while_jammed(small_cell: Cell) -> None:
    """The bed's stiffness follows it; what was saved on the way continues to the last bit."""
    evacuate: Story = {420: lambda cell, root: soft_jig(cell).evacuate(root, 30e3)}
    story = {k: command for k, command in JIG_STORY.items() if k < 450} | evacuate
    simulation, states = Simulation(small_cell), []
    for moment in (415, 425, 620):
        go_on(small_cell, simulation, story, moment)
        states.append(save_state(simulation))
    stiff_for = [float(state["fixture/stiff_for"]) for state in states]
    assert stiff_for == [QUICK.jig.vacuum.pressure, QUICK.jig.vacuum.pressure, 30e3]
    go_on(small_cell, simulation, story, 660)
    for state in states:
        fresh = Simulation(small_cell)
        restore_state(fresh, state)
        push(small_cell, fresh.root, small_cell.parts["motor"].body, 0.0)
        go_on(small_cell, fresh, story, 660)
        assert_same(snapshot(small_cell, fresh.root), snapshot(small_cell, simulation.root))


def soft_jig(cell: Cell) -> SoftJig:
    assert isinstance(cell.fixture, SoftJig)
    return cell.fixture


def test_own_body_that_falls_asleep_right_after_a_restore() -> None:
    """Its load is saved as a part's is."""
    cell = build_cell(QUICK, small_product("motor"), extend=add_box)
    story = {k: command for k, command in BOX_STORY.items() if k < 450}
    simulation, fresh = play_ours(cell, story, 470), Simulation(cell)
    restore_state(fresh, save_state(simulation))
    for each in (simulation, fresh):
        push(cell, each.root, cell.plant.GetBodyByName("box"), 0.0)
        cell.sleeper.put_to_sleep(each.root, cell.plant.GetBodyByName("box"))
        each.step()
    ours, restored = (cell.force_plate.read(each.context) for each in (simulation, fresh))
    np.testing.assert_array_equal(restored, ours)
    assert restored[5] < -61.0  # 59.35 N without the box.


def test_whoever_advances_the_simulator_the_steps_count(small_cell: Cell) -> None:
    simulation = Simulation(small_cell)
    simulation.simulator.AdvanceTo(5 * STEP)
    simulation.step()
    assert simulation.steps == int(save_state(simulation)["steps"]) == 6
    assert simulation.time == pytest.approx(simulation.root.get_time())


def test_file_that_is_no_state_is_refused(small_cell: Cell, tmp_path: Path) -> None:
    whole = tmp_path / "whole"  # Without an ending: a file has the name that it was given.
    write_state(whole, save_state(Simulation(small_cell)))
    content = whole.read_bytes()
    half = len(content) // 2
    flipped = bytes(byte ^ 0xFF for byte in content[half : half + 8])
    for name, text in (
        ("nonsense", b"nonsense"),
        ("empty", b""),
        ("half", content[:half]),
        ("flipped", content[:half] + flipped + content[half + 8 :]),
    ):
        path = tmp_path / f"{name}.npz"
        path.write_bytes(text)
        with pytest.raises(InputError, match=f"{name}.npz' is not a saved state"):
            read_state(path)
    np.save(tmp_path / "array.npy", np.zeros(3))
    for path in (tmp_path / "array.npy", tmp_path):
        with pytest.raises(InputError, match="is not a saved state"):
            read_state(path)
    with pytest.raises(InputError, match="There is no saved state"):
        read_state(tmp_path / "nowhere.npz")
