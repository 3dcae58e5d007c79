"""Fixtures that are made for one part in one posture: their design, and parts in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import Context
from scipy.spatial import ConvexHull
from stories import free, small_product

from cell import Cell, CellConfig, Product, Simulation, build_cell, load_product
from cell.errors import UnknownName
from cell.fixtures.base import FixtureError
from cell.fixtures.custom.fixture import ON_SUPPORTS, CustomFixture
from cell.fixtures.custom.nest import design_nest
from cell.fixtures.custom.posts import design_posts
from cell.fixtures.custom.walls import floors, slabs
from cell.fixtures.custom.work import MM, Work, signed_area
from cell.fixtures.rigid_jig import RigidJig
from cell.fixtures.support_jig import SupportJig
from cell.forces import applied_force
from cell.setting import BadSetting
from cell.simulation.state import restore_state, save_state
from cell.vectors import rotation_with_up
from cell.workpieces.work import fixture_work

PART, UP = "plate", "-z"  # It lies on its front face, the foot up.
KINDS = ("rigid_jig", "support_jig")
CASES = (("motor", "+z"), ("plate", "-z"), ("plate", "+z"), ("plate", "+y"))


def config_for(kind: str, part: str = PART, up: str = UP, **more: float) -> CellConfig:
    changes = {f"custom.{key.replace('__', '.')}": value for key, value in more.items()}
    held = {"custom.held.part": part, "custom.held.up": up}
    return CellConfig.load(overrides={"workcell.fixture": kind, **held, **changes})


def bare(part: str, up: str, **more: float) -> Work:
    """Return a part of the motor unit in a posture, with all room for the hand."""
    work = fixture_work(config_for("rigid_jig", part, up, **more), load_product("motor_unit"))
    assert work is not None
    return replace(work, hands=())


def box_work(size: tuple[float, float, float], turned: float = 0.0) -> Work:
    """Return a box, turned about x."""
    mesh = trimesh.creation.box(size)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(turned, [1, 0, 0]))
    return Work("box", "+z", mesh, rotation_with_up("+z"), CellConfig().custom)


# How they are designed.


@pytest.mark.parametrize(("part", "up"), CASES)
def test_printed_block_is_one_watertight_body(part: str, up: str, tmp_path) -> None:
    work = fixture_work(config_for("rigid_jig", part, up), load_product("motor_unit"))
    assert work is not None
    body = design_nest(work).body.to_mesh64()
    block = trimesh.Trimesh(body.vert_properties[:, :3], body.tri_verts, process=False)
    block.export(tmp_path / "block.stl")
    again = trimesh.load_mesh(tmp_path / "block.stl")
    assert again.is_watertight
    assert again.is_winding_consistent
    assert again.body_count == 1
    assert again.volume == pytest.approx(block.volume, rel=1e-4)


@pytest.mark.parametrize(("part", "up"), CASES)
@pytest.mark.parametrize("clearance", [5e-5, 1e-4, 4e-4])
def test_gap_between_nest_and_part_is_the_clearance(part: str, up: str, clearance: float) -> None:
    """Off the pads the part is nearest to the walls: to 5 micrometres, before the draft tells."""
    work = bare(part, up, seat__clearance=clearance)
    lifted = work.solid.translate([0.0, 0.0, 0.45])
    gap = design_nest(work).body.min_gap(lifted, 5.0)
    assert gap == pytest.approx(MM * clearance, abs=0.005)


@pytest.mark.parametrize(("part", "up"), CASES)
def test_part_goes_in_from_above_without_overlap(part: str, up: str) -> None:
    """With the hand that brings it, which leaves room for itself."""
    work = fixture_work(config_for("rigid_jig", part, up), load_product("motor_unit"))
    assert work is not None
    body = design_nest(work).body
    assert (work.hand ^ body).volume() < 1e-6
    for height in (0.0, 0.5, 3.0, 10.0, 30.0):
        assert (work.solid.translate([0.0, 0.0, height]) ^ body).volume() < 1e-6


@pytest.mark.parametrize(("part", "up"), CASES)
def test_contact_pieces_leave_pocket_and_hand_free(part: str, up: str) -> None:
    """They overlap neither the seated part nor the hand, and are where the block is."""
    work = fixture_work(config_for("rigid_jig", part, up), load_product("motor_unit"))
    assert work is not None
    nest = design_nest(work)
    pieces = [Manifold.hull_points(p) for p in (*slabs(nest, work), *floors(nest, work))]
    assert max((piece ^ work.solid).volume() for piece in pieces) < 1e-6
    assert max((piece ^ work.hand).volume() for piece in pieces) < 0.05
    assert max((piece - nest.body).volume() for piece in pieces) < 0.3  # [mm3]


@pytest.mark.parametrize(("part", "up"), CASES)
def test_supports_touch_faces_of_the_part_around_its_mass_centre(part: str, up: str) -> None:
    work = bare(part, up)
    datum = design_posts(work).datum
    for x, y, z in datum.pads:
        radius = MM * work.params.seat.pad_radius
        under = Manifold.cylinder(1.0, radius, radius, 24).translate([x, y, z - 1.0])
        assert (under ^ work.solid).volume() < 1e-6
        # All of the pad is under the face.
        inside = (under.translate([0.0, 0.0, 0.1]) ^ work.solid).volume()
        assert inside == pytest.approx(0.1 * under.volume(), rel=1e-3)
    # The mass centre is over the origin.
    corners = datum.pads[:, :2]
    areas = [signed_area(np.array([[0, 0], *corners[[k, (k + 1) % 3]]])) for k in range(3)]
    assert min(areas) > 0.0


@pytest.mark.parametrize(("part", "up"), CASES)
def test_posts_are_set_in_steps_next_to_the_part(part: str, up: str) -> None:
    work = bare(part, up)
    posts, params = design_posts(work), work.params
    least, step = MM * params.seat.clearance, MM * params.posts.step
    height_step = MM * params.posts.height_step
    for post in posts.sides:
        assert least - 1e-9 <= post.gap <= least + step
        piece = Manifold.hull_points(posts.corners(post, MM * params.posts.radius))
        assert piece.min_gap(work.solid, 5.0) == pytest.approx(post.gap, abs=0.02)
        setting = (post.touch[:2] @ post.normal + post.gap) / step
        assert setting == pytest.approx(np.round(setting), abs=1e-6)
    heights = posts.supports[:, 2] / height_step
    np.testing.assert_allclose(heights, np.round(heights), atol=1e-6)
    assert np.abs(posts.supports - posts.datum.pads).max() <= height_step / 2 + 1e-9
    located = [post for post in posts.sides if post.locates]
    assert 2 <= len(located) <= 3
    assert len({post.side[1] for post in located}) == 2


def test_part_on_uneven_supports_leans_as_they_do() -> None:
    """The seat maps the points meant to touch onto the tops, and leaves the rest as it was."""
    work = bare("plate", "+z", posts__height_step=1.3e-3)
    posts = design_posts(work)
    X_DP = posts.seat(work.X_DP)
    moved = X_DP @ work.X_DP.inverse() @ (posts.datum.pads.T / MM)
    np.testing.assert_allclose(moved[2], posts.supports[:, 2] / MM, atol=5e-6)
    np.testing.assert_allclose(moved[:2].T, posts.datum.pads[:, :2] / MM, atol=5e-4)


@pytest.mark.parametrize("design", [design_nest, design_posts])
def test_postures_without_level_faces_are_refused(design) -> None:
    for work in (bare("motor", "-y"), box_work((0.03, 0.03, 0.04), turned=0.4)):
        with pytest.raises(FixtureError, match="up has no datum faces"):
            design(work)


def test_top_heavy_part_beyond_its_support_is_refused() -> None:
    foot = trimesh.creation.box((0.02, 0.02, 0.01))
    arm = trimesh.creation.box((0.08, 0.02, 0.02)).apply_translation([0.03, 0.0, 0.05])
    neck = trimesh.creation.box((0.02, 0.02, 0.06)).apply_translation([0.0, 0.0, 0.025])
    mesh = trimesh.boolean.union([foot, neck, arm])
    work = Work("crane", "+z", mesh, rotation_with_up("+z"), CellConfig().custom)
    # The arm's underside is too high to be supported.
    with pytest.raises(FixtureError, match="'crane' with \\+z up has no datum faces"):
        design_nest(work)


def test_bad_numbers_and_names_are_refused() -> None:
    with pytest.raises(BadSetting, match="'custom.seat.clearance' must be >= 0 and <= 0.005 m"):
        config_for("rigid_jig", seat__clearance=-1e-4)
    with pytest.raises(UnknownName, match="part to hold"):
        build_cell(config_for("rigid_jig", "wheel"), small_product(PART))
    with pytest.raises(FixtureError, match="made for one part"):
        build_cell(CellConfig.load(overrides=["workcell.fixture=rigid_jig"]), Product())


# Parts in them.


@cache
def cell_with(kind: str, clamp_force: float = 0.0) -> Cell:
    config = config_for(kind, posts__clamp_force=clamp_force, held__yaw_deg=30.0)
    return build_cell(config, small_product(PART))


def fixture_of(cell: Cell) -> CustomFixture:
    assert isinstance(cell.fixture, CustomFixture)
    return cell.fixture


def put_in(cell: Cell, root: Context, above: float = 3e-4) -> None:
    """Let the part go a little above its seat."""
    context = cell.plant.GetMyMutableContextFromRoot(root)
    body = cell.parts[PART].body
    cell.parts.wake(root, PART)
    cell.fixture.prepare(root)
    X_WP = cell.fixture.pose(context) @ fixture_of(cell).seat(PART)
    raised = RigidTransform(X_WP.rotation(), X_WP.translation() + [0.0, 0.0, above])
    cell.plant.SetFreeBodyPose(context, body, raised)
    cell.fixture.receive(root, body)


def error(cell: Cell, root: Context) -> tuple[float, float]:
    """Return how far the part is from its seat: of its mass centre [m], and angle [rad]."""
    context = cell.plant.GetMyContextFromRoot(root)
    seat, com = fixture_of(cell).seat(PART), cell.parts[PART].part.mesh.center_mass
    X_JP = cell.fixture.pose(context).InvertAndCompose(cell.parts[PART].X_WP(context))
    turn = (seat.rotation().inverse() @ X_JP.rotation()).ToAngleAxis().angle()
    return float(np.linalg.norm(X_JP @ com - seat @ com)), float(abs(turn))


def run(simulation: Simulation, steps: int, pull: Mapping[str, float] | None = None) -> None:
    """Step, with a force on the part's mass centre along axes of W [N]."""
    cell, body = simulation.cell, simulation.cell.parts[PART].body
    newton = np.array([(pull or {}).get(axis, 0.0) for axis in "xyz"])
    force = applied_force(
        body.index(), cell.parts[PART].part.mesh.center_mass, SpatialForce(np.zeros(3), newton)
    )
    assert cell.diagram is not None
    cell.diagram.GetInputPort("external_forces").FixValue(simulation.root, Value([force]))
    for _ in range(steps):
        simulation.step()


@pytest.mark.parametrize("kind", KINDS)
def test_seated_part_is_held_sideways_and_let_go_upward(kind: str) -> None:
    cell = cell_with(kind)
    simulation = Simulation(cell)
    put_in(cell, simulation.root)
    body, fixture = cell.parts[PART].body, fixture_of(cell)
    run(simulation, 150)
    assert fixture.holds(simulation.root, body)
    assert fixture.fixed(simulation.root)
    distance, angle = error(cell, simulation.root)
    assert distance < 1e-4
    assert angle < 2e-3
    context = cell.plant.GetMyContextFromRoot(simulation.root)
    X_JP = fixture.pose(context).InvertAndCompose(cell.parts[PART].X_WP(context))
    assert abs(fixture.off_supports(PART, X_JP)) < ON_SUPPORTS / 5
    weight = 9.81 * cell.parts[PART].part.mass
    for axis in "xy":  # Ten times what friction alone would bear.
        run(simulation, 150, {axis: 10 * 0.3 * weight})
        distance, angle = error(cell, simulation.root)
        assert distance < 6e-4
        assert angle < 0.02
    run(simulation, 150, {"z": 1.5 * weight})
    assert error(cell, simulation.root)[0] > 2e-3
    free_and_release(cell, simulation.root)
    assert not fixture.holds(simulation.root, body)


@pytest.mark.parametrize("kind", KINDS)
def test_part_that_hangs_or_leans_is_off_its_supports(kind: str) -> None:
    """By as much as it is raised, or as its farthest support is from the axis that it leans about.

    What it is turned or shifted by on its supports does not count.
    """
    fixture = fixture_of(cell_with(kind))
    seat = fixture.seat(PART)

    def off(R: RollPitchYaw, p: tuple[float, float, float]) -> float:
        """About the origin of J, below the mass centre."""
        return fixture.off_supports(PART, RigidTransform(R, p) @ seat)

    level = RollPitchYaw(0.0, 0.0, 0.0)
    assert off(level, (0.0, 0.0, 3e-4)) == pytest.approx(3e-4)
    assert off(RollPitchYaw(0.0, 0.0, 0.3), (1e-3, 2e-3, 0.0)) == pytest.approx(0.0, abs=1e-9)
    farthest = max((fixture.X_JD @ (fixture.made.supports.T / MM))[1])
    assert off(RollPitchYaw(0.02, 0.0, 0.0), (0.0, 0.0, 0.0)) == pytest.approx(
        0.02 * farthest, rel=0.05
    )


def free_and_release(cell: Cell, root: Context) -> None:
    free(cell, root)
    assert cell.fixture.freed(root)
    cell.fixture.release(root, cell.parts[PART].body)


def test_clamps_push_the_part_onto_its_locators_and_bear_an_upward_pull() -> None:
    """Two clamps of 20 N at friction 0.3, on both sides of the part, bear over 20 N."""
    cell = cell_with("support_jig", clamp_force=20.0)
    simulation = Simulation(cell)
    root, jig = simulation.root, cell.fixture
    assert isinstance(jig, SupportJig)
    put_in(cell, root)
    run(simulation, 100)
    jig.fix(root)
    assert not jig.fixed(root)
    run(simulation, 250)
    assert jig.fixed(root)
    assert jig.reading(root) == {"clamp_force": 20.0}
    context = cell.plant.GetMyContextFromRoot(root)
    X_DP = jig.X_JD.inverse() @ jig.pose(context).InvertAndCompose(cell.parts[PART].X_WP(context))
    points = MM * (X_DP @ cell.parts[PART].part.mesh.vertices.T).T
    for post in jig.posts.sides:
        if post.locates:
            gap = post.touch[:2] @ post.normal + post.gap - (points[:, :2] @ post.normal).max()
            assert abs(gap) < 0.03
    before = cell.parts[PART].X_WP(context).translation()
    run(simulation, 150, {"z": 15.0})
    assert np.linalg.norm(cell.parts[PART].X_WP(context).translation() - before) < 5e-4
    # They push part and base alike: the force plate feels no more than weights and the pull.
    jig.free(root)
    run(simulation, 250)
    assert jig.freed(root)
    assert jig.applied_forces(jig.GetMyContextFromRoot(root)) == [] or all(
        np.linalg.norm(force.F_Bq_W.translational()) == 0.0
        for force in jig.applied_forces(jig.GetMyContextFromRoot(root))
    )


@pytest.mark.parametrize(("kind", "clamp_force"), [("rigid_jig", 0.0), ("support_jig", 20.0)])
def test_saved_state_goes_on_bit_for_bit(kind: str, clamp_force: float) -> None:
    cell = cell_with(kind, clamp_force)
    simulation, fresh = Simulation(cell), Simulation(cell)
    put_in(cell, simulation.root)
    run(simulation, 30)
    cell.fixture.fix(simulation.root)
    run(simulation, 40)
    restore_state(fresh, save_state(simulation))
    for each in (simulation, fresh):
        run(each, 40)
    q, again = (cell.plant.GetPositions(each.context) for each in (simulation, fresh))
    np.testing.assert_array_equal(again, q)


@pytest.mark.parametrize("kind", KINDS)
def test_two_contexts_are_independent(kind: str) -> None:
    cell = cell_with(kind)
    one, other = Simulation(cell), Simulation(cell)
    put_in(cell, one.root)
    body = cell.parts[PART].body
    assert cell.fixture.holds(one.root, body)
    assert not cell.fixture.holds(other.root, body)
    run(one, 60)
    alone = Simulation(cell)
    put_in(cell, alone.root)
    for _ in range(60):
        run(alone, 1)
        run(other, 1)
    np.testing.assert_array_equal(
        cell.plant.GetPositions(alone.context), cell.plant.GetPositions(one.context)
    )


@pytest.mark.parametrize("kind", KINDS)
def test_planners_obstacle_contains_all_that_is_made(kind: str) -> None:
    fixture = fixture_of(cell_with(kind))
    hull = fixture.obstacle().GetConvexHull()
    corners = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
    (mesh,) = fixture.models().values()
    planes = ConvexHull(corners).equations
    assert (mesh.vertices @ planes[:, :3].T + planes[:, 3]).max() < 1e-6
    assert mesh.bounds[1, 2] == pytest.approx(fixture.entry_height)
    middle = mesh.bounds[:, :2].mean(axis=0)
    root = cell_with(kind).plant.CreateDefaultContext()
    assert fixture.height_at(root, np.array([middle + [0.2, 0.0]]))[0] < 0.005
    assert fixture.height_at(root, mesh.vertices[:, :2]).max() == pytest.approx(
        fixture.entry_height
    )


@pytest.mark.parametrize("kind", KINDS)
def test_other_parts_are_refused(kind: str) -> None:
    cell = build_cell(config_for(kind), small_product(PART, "motor"))
    root = Simulation(cell).root
    with pytest.raises(FixtureError, match=f"{kind} is made for 'plate' and cannot hold 'motor'"):
        cell.fixture.receive(root, cell.parts["motor"].body)


def test_what_it_is_made_for_is_the_first_part_of_the_order_unless_told() -> None:
    product = load_product("motor_unit")
    cell = build_cell(CellConfig.load(overrides=["workcell.fixture=rigid_jig"]), product)
    assert isinstance(cell.fixture, RigidJig)
    assert cell.fixture.part == "motor"
    up = cell.fixture.seat("motor").rotation().matrix()[2]
    np.testing.assert_allclose(up, [0.0, 0.0, 1.0], atol=1e-12)
