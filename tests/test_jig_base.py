"""The jig's base on the force plate: weight and place of a free one, its sleep, a bolted one."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import Cylinder
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity

from cell import Cell, CellConfig, build_cell, load_product
from cell.fixtures.jig_dimensions import BASE_DIAMETER
from cell.fixtures.soft_jig.parameters import BadJig
from cell.simulation.simulation import Simulation
from planning.operations.stroke import Stroke


def empty_cell(fixed: bool, **changes: float) -> Cell:
    config = CellConfig().with_changes({"workcell.jig_base_fixed": fixed})
    config = config.with_changes({f"simulation.{key}": value for key, value in changes.items()})
    product = replace(load_product("motor_unit"), parts={}, joints=(), groups={})
    return build_cell(config, product)


def settled(cell: Cell, steps: int = 150) -> Simulation:
    simulation = Simulation(cell)
    for _ in range(steps):
        simulation.step()
    return simulation


def test_free_base_stands_where_it_was_set_and_weighs_what_is_configured() -> None:
    """Asleep it still weighs on the force plate: the plate reads the same."""
    cell = empty_cell(fixed=False)
    simulation = settled(cell)
    rest = cell.force_plate.read(simulation.context)
    root = simulation.root
    weight = rest[5] + 9.81 * cell.jig_base.plate.get_mass(simulation.context)
    assert weight == pytest.approx(-cell.config.push.jig_mass * 9.81, rel=0.01)
    X_WJ = RigidTransform(cell.X_WJ.rotation(), cell.X_WJ.translation() + [0.02, -0.01, 0.0])
    cell.jig_base.set_down(root, X_WJ)
    for _ in range(150):
        simulation.step()
    assert cell.jig_base.X_WJ(simulation.context).IsNearlyEqualTo(X_WJ, 1e-4)
    awake = cell.force_plate.read(simulation.context)
    assert awake[5] == pytest.approx(rest[5], abs=0.05)
    cell.jig_base.sleep(root)
    for _ in range(3):
        simulation.step()
    asleep = cell.force_plate.read(simulation.context)
    np.testing.assert_allclose(asleep, awake, atol=0.05)


def test_a_sleeping_base_does_not_move_and_goes_on_from_rest() -> None:
    cell = empty_cell(fixed=False)
    simulation = settled(cell)
    base, root = cell.jig_base, simulation.root
    before = base.X_WJ(simulation.context)
    base.sleep(root)
    assert base.asleep(root)
    for _ in range(20):
        simulation.step()
    assert base.X_WJ(simulation.context).IsExactlyEqualTo(before)
    base.wake(root)
    assert not base.asleep(root)
    for _ in range(50):
        simulation.step()
    assert base.X_WJ(simulation.context).IsNearlyEqualTo(before, 1e-4)


def test_a_base_that_lands_while_it_slides_is_not_braked_by_the_step() -> None:
    """It tips on its edge and falls back: friction stays what the mean normal force bears."""
    speed, tipping, radius = 0.1, 0.2, BASE_DIAMETER / 2
    travel = {}
    for step in (1e-3, 5e-4):
        cell = empty_cell(fixed=False, time_step=step)
        simulation = settled(cell, round(0.05 / step))
        context, body = simulation.context, cell.jig_base.body
        before = cell.jig_base.X_WJ(context).translation()
        V_WJ = SpatialVelocity(
            np.array([0.0, -tipping, 0.0]), np.array([speed, 0.0, tipping * radius])
        )
        cell.plant.SetFreeBodySpatialVelocity(context, body, V_WJ)
        for _ in range(round(0.2 / step)):
            simulation.step()
        travel[step] = (cell.jig_base.X_WJ(context).translation() - before)[0]
    flat = speed**2 / (2 * cell.config.push.base_friction * 9.81)
    assert travel[1e-3] == pytest.approx(travel[5e-4], rel=0.2)
    assert travel[1e-3] > 0.9 * flat  # 1.25 and 1.43 mm, 1.27 mm flat; rigid on rigid 0.3 mm.


def test_joint_of_the_base_yields_by_its_stiffness() -> None:
    """Gravity times five, in place of a load: the base sinks by the weight over the stiffness."""
    cell = empty_cell(fixed=False)
    heights = []
    for gravity in (9.81, 49.05):
        cell.plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -gravity])
        simulation = settled(cell)
        heights.append(cell.jig_base.X_WJ(simulation.context).translation()[2])
    push = cell.config.push
    sunk = push.jig_mass * 4 * 9.81 / push.base_stiffness
    assert heights[0] - heights[1] == pytest.approx(sunk, rel=0.1)


def test_a_bolted_base_neither_sleeps_nor_moves() -> None:
    cell = empty_cell(fixed=True)
    simulation = settled(cell, 2)
    cell.jig_base.set_down(simulation.root, RigidTransform([1.0, 0.0, 0.0]))
    cell.jig_base.sleep(simulation.root)
    assert not cell.jig_base.asleep(simulation.root)
    assert cell.jig_base.X_WJ(simulation.context).IsNearlyEqualTo(cell.X_WJ, 1e-12)


def test_base_is_as_wide_as_its_bag_needs_and_carries_its_beads() -> None:
    """Half as wide again: the same rim beside the bag, in proportion; heavier beads sit above."""
    wide = {"jig.bag.cap_radius": 0.09, "jig.bag.cap_height": 1.5 * 0.0459}
    full = {**wide, "jig.bag.bead_volume": 1.5**3 * 180e-6, "push.jig_mass": 4.0}
    found = {}
    for name, changes in (("usual", {}), ("wide", full)):
        config = CellConfig().with_changes({"workcell.jig_base_fixed": False, **changes})
        product = replace(load_product("motor_unit"), parts={}, joints=(), groups={})
        cell = build_cell(config, product)
        inspector = cell.scene_graph.model_inspector()
        geometries = cell.plant.GetCollisionGeometriesForBody(cell.jig_base.body)
        (shape,) = (s for g in geometries if isinstance(s := inspector.GetShape(g), Cylinder))
        simulation = Simulation(cell)
        inertia = cell.jig_base.body.CalcSpatialInertiaInBodyFrame(simulation.context)
        found[name] = shape.radius(), inertia
    assert found["usual"][0] == BASE_DIAMETER / 2
    assert found["wide"][0] == pytest.approx(1.5 * BASE_DIAMETER / 2)
    beads, base = 1.5**3 * 0.45, 4.0 - 1.5**3 * 0.45
    height = (beads * 0.4 * 1.5 * 0.0459 - base * 0.0125) / 4.0
    assert found["wide"][1].get_mass() == pytest.approx(4.0)
    assert found["wide"][1].get_com()[2] == pytest.approx(height)


def test_jig_lighter_than_its_beads_is_refused() -> None:
    config = CellConfig().with_changes(
        {"workcell.jig_base_fixed": False, "jig.bag.bead_volume": 1e-3}
    )
    product = replace(load_product("motor_unit"), parts={}, joints=(), groups={})
    with pytest.raises(BadJig, match="push.jig_mass.*beads alone 2.5 kg"):
        Simulation(build_cell(config, product))


def test_a_short_stroke_never_reaches_its_speed() -> None:
    stroke = Stroke(way=0.002, speed=0.25, acceleration=2.5)
    assert stroke.top == pytest.approx(np.sqrt(2 * 2.5 * 0.002))
    assert stroke.at(stroke.duration) == (0.002, 0.0)
    times = np.linspace(0.0, stroke.duration - 1e-9, 200)
    way = np.array([stroke.at(t)[0] for t in times])
    rates = np.array([stroke.at(t)[1] for t in times])
    assert np.gradient(way, times)[1:-1] == pytest.approx(rates[1:-1], abs=1e-3)
