"""Loose parts: asleep they neither move nor touch, awake they fall and collide."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from cell import load_product
from cell.errors import UnknownName
from cell.sleep import Sleep
from cell.workpieces.parts import LoosePart, Parts, add_parts

HIGH = RigidTransform([0.0, 0.0, 1.0])


@dataclass
class Air:
    """The parts of the motor unit in mid-air, with nothing else."""

    parts: Parts = field(init=False)

    def __post_init__(self) -> None:
        builder = DiagramBuilder()
        self.plant, self.scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
        parts = add_parts(self.plant, load_product("motor_unit"), HIGH)
        self.plant.Finalize()
        sleeper = builder.AddNamedSystem("sleep", Sleep(self.plant, self.scene_graph, ()))
        self.parts = replace(parts, sleeper=sleeper)
        self.simulator = Simulator(builder.Build())
        self.root = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)

    def step(self, count: int) -> None:
        self.simulator.AdvanceTo(self.root.get_time() + count * 1e-3)

    def may_touch(self, one: str, other: str) -> bool:
        """Return whether contact between two parts is not filtered."""
        context = self.scene_graph.GetMyContextFromRoot(self.root)
        inspector = self.scene_graph.get_query_output_port().Eval(context).inspector()
        a, b = (
            self.plant.GetCollisionGeometriesForBody(self.parts[name].body)[0]
            for name in (one, other)
        )
        return not inspector.CollisionFiltered(a, b)

    def height(self, part: str) -> float:
        return float(self.parts[part].X_WP(self.context).translation()[2])


@pytest.fixture(scope="module")
def air() -> Air:
    return Air()


@pytest.fixture(autouse=True)
def at_rest(air: Air) -> None:
    """Every test begins with all parts awake, at rest in mid-air, as they hang in the tray."""
    for name in air.parts.by_name:
        air.parts.wake(air.root, name)
    air.root.SetTime(0.0)
    air.plant.SetDefaultState(air.context, air.context.get_mutable_state())
    air.simulator.Initialize()


def set_velocity(air: Air, part: LoosePart, V_WP: np.ndarray) -> None:
    v = np.zeros(air.plant.num_velocities())
    start = part.joint.velocity_start()
    v[start : start + 6] = V_WP
    air.plant.SetVelocities(air.context, v)


def test_awake_part_falls_from_rest_as_newton_says(air: Air) -> None:
    before = air.height("motor")
    air.parts.sleep_all_but(air.root, ["motor"])
    air.step(100)
    g = 9.81
    # The discrete plant moves with the velocity at the end of each step: 1 % more way in 100 steps.
    assert before - air.height("motor") == pytest.approx(g * 0.1**2 / 2, rel=0.02)
    assert air.parts["motor"].velocity(air.context)[5] == pytest.approx(-g * 0.1, rel=1e-6)


def test_sleeping_part_stays_exactly_where_it_is(air: Air) -> None:
    motor = air.parts["motor"]
    set_velocity(air, motor, np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]))
    air.parts.sleep_all_but(air.root, ["plate"])
    pose = motor.X_WP(air.context).GetAsMatrix4()
    air.step(50)
    np.testing.assert_array_equal(motor.X_WP(air.context).GetAsMatrix4(), pose)
    np.testing.assert_array_equal(motor.velocity(air.context), np.zeros(6))


def test_sleep_of_one_part_leaves_the_velocity_of_another(air: Air) -> None:
    V_WP = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    set_velocity(air, air.parts["plate"], V_WP)
    air.parts.sleep(air.root, "motor")
    np.testing.assert_allclose(air.parts["plate"].velocity(air.context), V_WP, atol=1e-12)


def test_woken_part_starts_from_rest(air: Air) -> None:
    motor = air.parts["motor"]
    set_velocity(air, motor, np.ones(6))
    air.parts.sleep(air.root, "motor")
    air.parts.wake(air.root, "motor")
    np.testing.assert_array_equal(motor.velocity(air.context), np.zeros(6))
    air.step(1)
    assert motor.velocity(air.context)[5] == pytest.approx(-9.81e-3, rel=1e-6)


def test_sleeping_part_touches_nothing(air: Air) -> None:
    assert air.may_touch("motor", "plate")
    air.parts.sleep(air.root, "motor")
    assert not air.may_touch("motor", "plate")
    assert air.may_touch("plate", "bolt_1")
    air.parts.wake(air.root, "motor")
    assert air.may_touch("motor", "plate")


def test_falling_asleep_twice_needs_one_waking(air: Air) -> None:
    for action in ("sleep", "sleep", "wake", "wake"):
        getattr(air.parts, action)(air.root, "motor")
    assert not air.parts["motor"].asleep(air.root)
    assert air.may_touch("motor", "plate")


def exclude_bolts(air: Air) -> None:
    """Set a lasting filter between two bolts."""
    a, b = (
        GeometrySet(air.plant.GetCollisionGeometriesForBody(air.parts[name].body))
        for name in ("bolt_1", "bolt_2")
    )
    context = air.scene_graph.GetMyMutableContextFromRoot(air.root)
    manager = air.scene_graph.collision_filter_manager(context)
    manager.Apply(CollisionFilterDeclaration().ExcludeBetween(a, b))


def test_lasting_filters_can_be_set_while_parts_sleep() -> None:
    """Sleep neither hides them nor forgets them; it stays what it was itself."""
    air = Air()
    air.parts.sleep_all_but(air.root, ["bolt_1"])
    exclude_bolts(air)
    assert not air.may_touch("motor", "plate")
    assert air.parts["motor"].asleep(air.root)
    air.parts.sleep_all_but(air.root, air.parts.by_name)
    assert air.may_touch("motor", "plate")
    assert air.may_touch("bolt_1", "bolt_3")
    assert not air.may_touch("bolt_1", "bolt_2")


def test_parts_sleep_in_one_context_only(air: Air) -> None:
    other = air.root.Clone()
    air.parts.sleep(air.root, "motor")
    assert not air.parts["motor"].asleep(other)
    copied = air.root.Clone()
    air.parts.wake(air.root, "motor")
    assert air.parts["motor"].asleep(copied)


def test_unknown_part_is_named_with_the_known_ones(air: Air) -> None:
    with pytest.raises(UnknownName, match="'moter'.*Did you mean 'motor'"):
        air.parts.sleep_all_but(air.root, ["moter"])
