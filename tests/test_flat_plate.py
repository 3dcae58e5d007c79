"""The flat plate: the simplest fixture that keeps the protocol."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context
from stories import Player, free, small_product

from cell import Cell, CellConfig, Simulation, build_cell
from cell.fixtures import FIXTURES, fixture_class
from cell.fixtures.base import Fixture
from cell.fixtures.flat_plate import FlatPlate
from cell.simulation.state import restore_state, save_state

PART = "plate"  # Of the product: it lies on its front face, the foot up.
CONFIG = CellConfig.load(overrides=["workcell.fixture=flat_plate"])


@pytest.fixture(scope="module")
def cell() -> Cell:
    return build_cell(CONFIG, small_product(PART))


def put_down(cell: Cell, root: Context) -> None:
    """Let the part go half a millimetre above the fixture."""
    part = cell.parts[PART]
    cell.parts.wake(root, PART)
    context = cell.plant.GetMyMutableContextFromRoot(root)
    height = cell.fixture.entry_height + part.part.mesh.bounds[1][2] + 5e-4
    X_JP = RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0.0, 0.0, height])
    cell.plant.SetFreeBodyPose(context, part.body, cell.fixture.pose(context) @ X_JP)


@pytest.mark.parametrize("name", FIXTURES)
def test_fixture_of_every_name_is_one(name: str) -> None:
    kind = fixture_class(name)
    assert isinstance(kind, type)
    assert issubclass(kind, Fixture)
    assert kind.name == name
    # Drake's systems have a metaclass of their own, which does not look for what is abstract.
    names = [name for name in dir(kind) if getattr(getattr(kind, name), "__isabstractmethod__", 0)]
    assert names == []


def test_part_stands_on_it_and_is_fixed_at_once(cell: Cell) -> None:
    player = Player(cell, {0: put_down}).play(300)
    part, root = cell.parts[PART], player.root
    context = cell.plant.GetMyContextFromRoot(root)
    assert cell.fixture.fixed(root)
    assert cell.fixture.freed(root)
    X_JP = cell.fixture.pose(context).InvertAndCompose(part.X_WP(context))
    assert np.linalg.norm(part.velocity(context)) < 1e-3
    assert X_JP.rotation().matrix()[2, 2] < -0.9999
    low = X_JP.translation()[2] - part.part.mesh.bounds[1][2]
    assert low == pytest.approx(cell.fixture.entry_height, abs=1e-4)
    load = -59.3505 - part.part.mass * 9.81
    assert cell.force_plate.read(context)[5] == pytest.approx(load, abs=0.05)
    cell.parts.sleep(root, PART)
    player.play(5)
    assert cell.force_plate.read(context)[5] == pytest.approx(load, abs=0.05)


def test_commands_change_nothing(cell: Cell) -> None:
    player = Player(cell, {0: put_down, 150: free}).play(150)
    fixture, root = cell.fixture, player.root
    for command in (fixture.prepare, fixture.fix, fixture.free):
        command(root)
    fixture.release(root, cell.parts[PART].body)
    assert fixture.reading(root) == {}
    assert fixture.inputs() == fixture.outputs() == []
    calm = Player(cell, {0: put_down}).play(200).root
    positions = [
        cell.plant.GetPositions(cell.plant.GetMyContextFromRoot(each))
        for each in (player.play(50).root, calm)
    ]
    np.testing.assert_array_equal(*positions)


def test_saved_state_goes_on_bit_for_bit(cell: Cell) -> None:
    simulation = Simulation(cell)
    put_down(cell, simulation.root)
    for _ in range(50):
        simulation.step()
    fresh = Simulation(cell)
    restore_state(fresh, save_state(simulation))
    for each in (simulation, fresh):
        for _ in range(50):
            each.step()
    q, again = (cell.plant.GetPositions(each.context) for each in (simulation, fresh))
    np.testing.assert_array_equal(again, q)


def test_planners_obstacle_is_the_plate(cell: Cell) -> None:
    hull = cell.fixture.obstacle().GetConvexHull()
    points = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
    assert points[:, 2].max() == pytest.approx(cell.fixture.entry_height)
    assert np.hypot(*points[:, :2].T).max() == pytest.approx(CONFIG.jig.bag.aperture_radius)


class Counting(FlatPlate):
    """A fixture that remembers a number as discrete state, and nothing about saving."""

    name = "counting"

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.DeclareDiscreteState([0.0])

    def step(self, root: Context, dt: float) -> None:
        context = self.GetMyMutableContextFromRoot(root)
        context.SetDiscreteState([context.get_discrete_state_vector()[0] + 1.0])


def test_discrete_state_of_a_fixture_is_saved_without_further_ado(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(FIXTURES, "counting", Counting)
    counting = build_cell(CONFIG.with_changes({"workcell.fixture": "counting"}), small_product())
    simulation, other = Simulation(counting), Simulation(counting)
    for _ in range(3):
        simulation.step()
    restore_state(other, save_state(simulation))
    other.step()
    (count,) = counting.fixture.save(other.root).values()
    assert count.tolist() == [4.0]
