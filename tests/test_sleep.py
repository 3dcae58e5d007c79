"""Sleeping bodies go on weighing on what bears them: the force plate does not see who sleeps."""

from __future__ import annotations

import numpy as np
import pytest
from stories import (
    JIG_STORY,
    QUICK,
    Player,
    Story,
    fix,
    free,
    let_go,
    press_motor,
    sleep,
    small_product,
    wake,
)

from cell import Cell, Simulation, build_cell

SAME = 0.05  # [N], [N m]
PRESSED: Story = {0: press_motor, 200: let_go}


@pytest.fixture(scope="module")
def cell() -> Cell:
    return build_cell(QUICK, small_product("motor"))


def plate(cell: Cell, player: Player) -> np.ndarray:
    return cell.force_plate.read(cell.plant.GetMyContextFromRoot(player.root))


def test_force_plate_of_an_empty_cell_bears_plate_and_base() -> None:
    cell = build_cell(QUICK, small_product())
    simulation = Simulation(cell)
    simulation.step()
    bodies = [cell.plant.GetBodyByName(name) for name in ("force_plate", "jig_base")]
    weight = 9.81 * sum(body.default_mass() for body in bodies)
    np.testing.assert_allclose(
        cell.force_plate.read(simulation.context), [0, 0, 0, 0, 0, -weight], atol=1e-9
    )


@pytest.mark.parametrize(
    ("story", "then"),
    [
        (PRESSED, {}),
        (PRESSED, {505: fix}),
        (PRESSED | {210: fix}, {}),
        (PRESSED | {210: fix}, {505: free}),
    ],
    ids=["soft", "soft, jams while it sleeps", "jammed", "jammed, vented while it sleeps"],
)
def test_motor_on_the_jig_weighs_the_same_asleep(cell: Cell, story: Story, then: Story) -> None:
    """At rest, asleep, whatever the bag does meanwhile, and awake again."""
    player = Player(cell, story | {500: sleep, 800: wake} | then)
    empty = 59.3505
    awake = plate(cell, player.play(500))
    assert awake[5] == pytest.approx(-empty - 0.195 * 9.81, abs=SAME)
    for steps in (3, 4, 290):
        np.testing.assert_allclose(plate(cell, player.play(steps)), awake, atol=SAME)
    again = plate(cell, player.play(203))
    np.testing.assert_allclose(again, awake, atol=SAME)


def test_sleeper_neither_moves_nor_touches(cell: Cell) -> None:
    player = Player(cell, JIG_STORY).play(455)
    context = cell.plant.GetMyContextFromRoot(player.root)
    before = cell.parts["motor"].X_WP(context).GetAsMatrix4()
    player.play(40)
    np.testing.assert_array_equal(cell.parts["motor"].X_WP(context).GetAsMatrix4(), before)
    results = cell.plant.get_contact_results_output_port().Eval(context)
    assert results.num_hydroelastic_contacts() == 0


def test_body_woken_and_put_to_sleep_at_once_after_a_restore_keeps_its_load(cell: Cell) -> None:
    """As at a change of the time step: there is no contact to read before the first step."""
    player = Player(cell, PRESSED | {210: fix, 500: sleep}).play(505)
    root, awake = player.root, plate(cell, player)
    saved = cell.sleeper.save(root, [cell.parts["motor"].body])
    cell.sleeper.restore(root, saved, root.get_time())
    wake(cell, root)
    sleep(cell, root)
    np.testing.assert_allclose(plate(cell, player.play(5)), awake, atol=SAME)
