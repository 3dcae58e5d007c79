"""Contacts as springs: their stiffness, when they let go, which ones there are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import RigidBody, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from stories import JIG_STORY, QUICK, Player, small_product

from cell import Cell, build_cell
from cell.contact.links import ContactLinks
from cell.contact.memory import Intent
from cell.contact.plant_side import Pair
from cell.contact.polygons import Polygons
from cell.contact.springs import Springs, line_wrenches, stiffness_matrix
from cell.forces import applied_force
from cell.workpieces.thread import Engagement, ThreadState

DT = 1e-3
MASS, GRAVITY, FRICTION = 0.5, 9.81, 0.4
SIZE = np.array([0.04, 0.04, 0.02])
PRESS = 20.0  # [N]


def random_polygons(count: int) -> Polygons:
    rng = np.random.default_rng(count)
    normals = rng.normal(size=(count, 3))
    return Polygons(
        points=rng.normal(scale=0.02, size=(count, 3)) + [0.3, 0.1, 0.2],
        normals=normals / np.linalg.norm(normals, axis=1)[:, None],
        areas=rng.uniform(1e-7, 1e-5, count),
        pressures=rng.uniform(0.0, 1e5, count),
        gradients=rng.uniform(1e8, 1e10, count),
        friction=np.full(count, 0.5),
    )


@pytest.mark.parametrize("count", [4, 40, 400])
def test_six_springs_have_the_stiffness_of_all_polygons_and_carry_their_wrench(count: int) -> None:
    polygons, wrench = random_polygons(count), np.random.default_rng(0).normal(size=6)
    springs = Springs.of(polygons, wrench)
    K = (springs.lines * springs.stiffness[:, None]).T @ springs.lines
    expected = stiffness_matrix(polygons, np.zeros(3))
    np.testing.assert_allclose(K, expected, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(springs.lines.T @ springs.forces, wrench, atol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(springs.directions, axis=1), 1.0)


def test_stiffness_is_the_sum_over_the_polygons() -> None:
    """Normal stiffness a g, 0.8 of it along the face, at the polygon's point."""
    polygons = random_polygons(5)
    K = np.zeros((6, 6))
    for p, n, k in zip(
        polygons.points, polygons.normals, polygons.areas * polygons.gradients, strict=True
    ):
        along = k * (np.outer(n, n) + 0.8 * (np.eye(3) - np.outer(n, n)))
        axes = line_wrenches(np.tile(p, (3, 1)), np.eye(3)).T
        K += axes @ along @ axes.T
    np.testing.assert_allclose(stiffness_matrix(polygons, np.zeros(3)), K, rtol=1e-9, atol=1e-3)


# A block on a table.


@dataclass
class Everything:
    """Links everything; surfaces bear a pressure."""

    limit: float = np.inf

    def until(self, root: Context, pair: Pair, intent: Intent) -> object:
        return True

    def limits(
        self, root: Context, A: RigidBody, B: RigidBody, normals_W: np.ndarray
    ) -> np.ndarray:
        return np.full(len(normals_W), self.limit)


class Block:
    """A block on a table, pressed down by `PRESS`, and its links."""

    def __init__(self, *, linked: bool, limit: float = np.inf) -> None:
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(time_step=DT, discrete_contact_approximation="lagged")
        self.plant, scene_graph = AddMultibodyPlant(config, builder)
        inertia = SpatialInertia.SolidBoxWithMass(MASS, *SIZE)
        self.body = self.plant.AddRigidBody("block", inertia)
        table = np.array([0.2, 0.2, 0.1])
        self._add_box(self.body, SIZE, RigidTransform())
        self.table = self.plant.AddRigidBody("table", SpatialInertia.SolidBoxWithMass(1.0, *table))
        self.plant.WeldFrames(self.plant.world_frame(), self.table.body_frame())
        self._add_box(self.table, table, RigidTransform([0, 0, -table[2] / 2]))
        most = 1 if linked else 0
        spare = (self.body, self.table)
        self.links = ContactLinks(self.plant, scene_graph, Everything(limit), most, spare)
        self.plant.Finalize()
        builder.AddNamedSystem("links", self.links)
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.root = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)
        self.links.install(self.root)
        X_WB = RigidTransform([0, 0, SIZE[2] / 2])
        self.plant.SetFreeBodyPose(self.context, self.body, X_WB)
        self.steps = 0
        for _ in range(200):
            self.step(np.zeros(3))

    def _add_box(self, body: RigidBody, size: np.ndarray, X_BG: RigidTransform) -> None:
        properties = ProximityProperties()
        AddCompliantHydroelasticProperties(0.005, 1e8, properties)
        friction = CoulombFriction(FRICTION, FRICTION)
        AddContactMaterial(dissipation=1.0, friction=friction, properties=properties)
        self.plant.RegisterCollisionGeometry(body, X_BG, Box(*size), "box", properties)

    def step(self, force: np.ndarray, lever: float = 0.0) -> None:
        """Advance by one step under a force [N] at the bottom of the block, `lever` [m] aside."""
        pressed = SpatialForce(np.zeros(3), np.array([0.0, 0.0, -PRESS]))
        pulled = SpatialForce(np.zeros(3), force)
        at = np.array([0.0, 0.0, -SIZE[2] / 2])
        forces = [
            applied_force(self.body.index(), at, pressed),
            applied_force(self.body.index(), at + [0.0, lever, 0.0], pulled),
        ]
        self.plant.get_applied_spatial_force_input_port().FixValue(self.context, forces)
        self.steps += 1
        self.simulator.AdvanceTo(self.steps * DT)
        self.links.step(self.root, DT)

    @property
    def linked(self) -> bool:
        return bool(self.links.memory(self.root).installed)

    def surfaces(self) -> list:
        results = self.plant.get_contact_results_output_port().Eval(self.context)
        return [
            results.hydroelastic_contact_info(i).contact_surface()
            for i in range(results.num_hydroelastic_contacts())
        ]

    def load_until(
        self, direction: np.ndarray, ends: Callable[[Block], bool], lever: float = 0.0
    ) -> float:
        """Raise a force by 5 N/s until something ends; return it [N]."""
        for step in range(8000):
            load = 0.005 * step
            self.step(load * direction, lever)
            if ends(self):
                return load
        raise AssertionError("nothing has ended it")


def let_go(block: Block) -> bool:
    return not block.linked


def ended(block: Block) -> list[str]:
    return list(block.links.memory(block.root).ended)


def test_what_stands_is_linked_and_stays_where_it_is() -> None:
    block = Block(linked=True)
    assert block.linked
    start = block.plant.GetPositions(block.context).copy()
    for _ in range(200):
        block.step(np.zeros(3))
    assert block.linked
    np.testing.assert_allclose(block.plant.GetPositions(block.context), start, atol=2e-8)


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.8, 0.6, 0.0), (0.3, -0.95, 0.0)])
@pytest.mark.parametrize("lever", [0.0, 0.01, 0.03], ids="lever {:g} m".format)
def test_link_slips_at_the_load_at_which_full_contact_does(
    direction: tuple[float, ...], lever: float
) -> None:
    sideways = np.array(direction)

    def slides(block: Block) -> bool:
        v = block.plant.GetVelocities(block.context)
        return float(np.linalg.norm(v[3:]) + np.linalg.norm(v[:3]) * SIZE[0] / 2) > 1e-3

    full = Block(linked=False).load_until(sideways, slides, lever)
    block = Block(linked=True)
    assert block.load_until(sideways, let_go, lever) == pytest.approx(full, rel=0.02)
    assert ended(block) == ["friction"]
    if lever == 0.0:
        assert full == pytest.approx(FRICTION * (PRESS + MASS * GRAVITY), rel=0.02)


def test_link_opens_at_the_load_at_which_full_contact_does() -> None:
    up = np.array([0.0, 0.0, 1.0])
    full = Block(linked=False).load_until(up, lambda block: not block.surfaces())
    block = Block(linked=True)
    assert block.load_until(up, let_go) == pytest.approx(full, rel=0.02)
    # Where the last pressure goes, so does what little friction there was to bear.
    assert ended(block) in (["opening"], ["friction"])


def test_link_yields_at_the_load_at_which_full_contact_does() -> None:
    down, limit = np.array([0.0, 0.0, -1.0]), 2.5e4

    def overloaded(block: Block) -> bool:
        read = [Polygons.of(surface, A_is_M=True) for surface in block.surfaces()]
        return bool((Polygons.together(read).pressures > limit).any())

    full = Block(linked=False).load_until(down, overloaded)
    block = Block(linked=True, limit=limit)
    total = PRESS + MASS * GRAVITY
    assert total + block.load_until(down, let_go) == pytest.approx(total + full, rel=0.02)
    assert ended(block) == ["yield"]


@pytest.mark.parametrize("delay", range(5))
@pytest.mark.parametrize("blow", [(40.0, 0.0, 0.0), (0.0, 0.0, 80.0)], ids=["aside", "up"])
def test_blow_ends_a_link_within_two_steps(blow: tuple[float, ...], delay: int) -> None:
    """Wherever it falls in the period of the checks: springs must not pass it on."""
    block = Block(linked=True)
    for _ in range(delay):
        block.step(np.zeros(3))
    assert block.linked
    for _ in range(2):
        block.step(np.array(blow))
    assert not block.linked


def test_full_contact_is_back_after_a_slip() -> None:
    """What slides on is braked by friction, not held by springs."""
    block = Block(linked=True)
    for _ in range(200):
        block.step(np.array([12.0, 0.0, 0.0]))
    v = block.plant.GetVelocities(block.context)[3]
    pull = 12.0 - FRICTION * (PRESS + MASS * GRAVITY)
    assert v == pytest.approx(pull / MASS * 0.2, rel=0.05)


def test_a_sleeping_body_keeps_its_link_without_springs() -> None:
    block = Block(linked=True)
    block.links.pause(block.root, block.body)
    z = block.plant.GetPositions(block.context)[6]
    block.step(np.zeros(3))
    assert block.plant.GetPositions(block.context)[6] < z  # Nothing bears it.
    block.links.resume(block.root, block.body)
    block.step(np.zeros(3))
    assert block.linked


def test_a_body_that_was_locked_on_a_stand_is_held_when_it_is_let_go() -> None:
    """Whoever locks its joint does so without notice."""
    block = Block(linked=True)
    block.links.clear(block.root)
    joint = block.plant.GetJointByName("block")
    joint.Lock(block.context)
    for _ in range(100):
        block.step(np.zeros(3))
    joint.Unlock(block.context)
    z = block.plant.GetPositions(block.context)[6]
    for _ in range(100):
        block.step(np.zeros(3))
    assert block.linked
    assert block.plant.GetPositions(block.context)[6] == pytest.approx(z, abs=2e-6)


def test_a_table_that_sleeps_apart_from_others_goes_on_bearing_the_block() -> None:
    """As the jig's base does, which sleeps apart from the force plate only."""
    block = Block(linked=True)
    start = block.plant.GetPositions(block.context).copy()
    world = block.plant.world_body()
    block.links.pause(block.root, block.table, [world])
    for _ in range(50):
        block.step(np.zeros(3))
    block.links.resume(block.root, block.table, [world])
    assert block.linked
    np.testing.assert_allclose(block.plant.GetPositions(block.context), start, atol=2e-8)


def test_springs_stay_off_until_both_bodies_are_awake() -> None:
    block = Block(linked=True)
    for body in (block.body, block.table):
        block.links.pause(block.root, body)
    block.links.resume(block.root, block.table)
    ((pair, own),) = block.links.memory(block.root).installed.items()
    assert own.sleepers == {int(block.body.index())} and pair
    block.links.resume(block.root, block.body)
    ((pair, own),) = block.links.memory(block.root).installed.items()
    assert not own.sleepers


def test_wrench_of_a_link_is_the_load() -> None:
    block = Block(linked=True)
    ((other, wrench),) = block.links.wrenches(block.root, block.body)
    assert other.index() == block.table.index()
    np.testing.assert_allclose(wrench[3:], [0, 0, -PRESS - MASS * GRAVITY], atol=0.05)


# Which contacts may be linked.


@pytest.fixture(scope="module")
def linked_cell() -> Cell:
    config = QUICK.with_changes({"simulation.contact": "linked"})
    return build_cell(config, small_product("motor", "plate", "bolt_1"))


def pair_of(A: RigidBody, B: RigidBody) -> Pair:
    a, b = sorted([int(A.index()), int(B.index())])
    return a, b


def test_policy(linked_cell: Cell) -> None:
    cell = linked_cell
    root = Player(cell, {}).play(1).root
    policy = cell.links.policy
    motor, plate, bolt = (cell.parts[name].body for name in ("motor", "plate", "bolt_1"))
    finger = cell.plant.GetBodyByName("finger_left")
    base, table = cell.jig_base.body, cell.plant.world_body()
    nothing = Intent()

    def may(A: RigidBody, B: RigidBody, intent: Intent = nothing) -> bool:
        return policy.until(root, pair_of(A, B), intent) is not None

    assert may(finger, plate)
    assert may(motor, plate)
    assert not may(motor, plate, Intent(mating=frozenset([frozenset(["plate", "motor"])])))
    assert not may(table, motor)
    assert not may(finger, base)
    assert not may(base, motor)  # Soft.
    assert not may(bolt, plate)
    riding = Intent(riding=frozenset(["bolt_1"]))
    assert may(bolt, plate, riding)
    assert not may(bolt, base, riding)
    cell.threads.set(root, "bolt_1", Engagement(ThreadState.LOCKED))
    assert may(bolt, plate)
    before = policy.until(root, pair_of(finger, plate), nothing)
    cell.gripper.command(root, 0.04, 20.0)
    assert policy.until(root, pair_of(finger, plate), nothing) != before


def test_part_in_the_frozen_bed_is_linked_until_air_comes_in(linked_cell: Cell) -> None:
    player = Player(linked_cell, JIG_STORY).play(440)
    links = linked_cell.links.memory(player.root)
    assert len(links.installed) == 1
    player.play(200)
    links = linked_cell.links.memory(player.root)
    assert not links.installed
    assert links.ended["geometry"] + links.ended["command"] >= 1


def test_full_contact_has_no_links() -> None:
    full = QUICK.with_changes({"simulation.contact": "full"})
    cell = build_cell(full, small_product("motor"))
    assert not cell.links.memory(Player(cell, JIG_STORY).play(440).root).made
