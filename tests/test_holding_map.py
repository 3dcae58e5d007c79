"""The holding map: statics with known answers, contact as Drake has it, and the motor unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from jig_rig import MASS, Rig
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Convex,
    HydroelasticContactRepresentation,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder
from tiny_products import product_of, rod

from cell.contact.polygons import read_faces
from cell.errors import InputError
from cell.fixtures.contacts import Contacts, ContactSprings, SuctionPatches
from cell.fixtures.soft_jig import JigParameters
from cell.fixtures.soft_jig.drake_values import drake_proximity, drake_shape
from cell.fixtures.soft_jig.frozen.contacts import bed_springs
from cell.fixtures.soft_jig.frozen.yielding import Strength
from cell.fixtures.soft_jig.mesh.contact_mesh import imprint_mesh
from cell.fixtures.soft_jig.soft.bed import Bed
from cell.fixtures.soft_jig.soft.samples import SurfaceSamples
from cell.vectors import rotation_with_up
from experiments.holding_map import main
from planning.feasibility.solids import solids_of
from planning.fixture_analysis.frozen_body import HeldPart, frozen_body
from planning.fixture_analysis.holding_map import (
    CRITERIA,
    Bearing,
    holding_map,
    sphere_of_forces,
)

JIG = JigParameters()
STIFF, MU, WEIGHT = 1e9, 0.5, 2.0
X, Y, Z = np.eye(3)


def patches(points, normals, areas, *, depth=0.0, limit=1e9, mu=MU) -> ContactSprings:
    count = len(points)
    same = np.ones(count)
    normals = np.tile(normals, (count, 1)) if np.ndim(normals) == 1 else normals
    return ContactSprings(
        np.asarray(points, float), normals, areas * same, depth * same, STIFF * same, limit * same,
        mu * same, np.arange(count), np.inf * same, np.zeros((count, 3)),
    )  # fmt: skip


def floor(half: float = 0.015, count: int = 10, **kinds) -> ContactSprings:
    """A square of 30 mm under a part, at z = 0."""
    axis = (np.arange(count) + 0.5) / count * 2 * half - half
    x, y = (own.ravel() for own in np.meshgrid(axis, axis))
    return patches(np.column_stack([x, y, 0 * x]), Z, (2 * half / count) ** 2, **kinds)


def wall(x: float, height: float, **kinds) -> ContactSprings:
    """A wall 20 mm wide at x that faces the middle, from the floor up."""
    y, z = np.meshgrid(np.linspace(-0.009, 0.009, 7), (np.arange(5) + 0.5) / 5 * height)
    points = np.column_stack([np.full(y.size, x), y.ravel(), z.ravel()])
    return patches(points, -np.sign(x) * X, 0.020 * height / y.size, **kinds)


def suction(force: float) -> SuctionPatches:
    points = floor().points
    share = np.full(len(points), force / len(points))
    return SuctionPatches(points, np.tile(Z, (len(points), 1)), share, 1e-3, 3e-3)


def borne(springs: ContactSprings, force=None, moment=None, *, held=None, height=0.005, **more):
    """The bearing along one direction, the centre of mass at a height."""
    direction = np.concatenate(
        [Z * 0 if moment is None else moment, Z * 0 if force is None else force]
    )
    contacts = Contacts(springs, held or SuctionPatches.none())
    return holding_map(contacts, height * Z, WEIGHT, direction[None], **more)[0]


def test_a_low_pull_slides_at_the_friction_of_the_weight():
    found = borne(floor(), X)
    assert found.moved and found.criterion == "slides"
    assert found.load == pytest.approx(MU * WEIGHT, rel=0.05)


def test_a_high_pull_tips_over_the_edge():
    """[D] F h = W (b - 1 mm): the centre of mass is then 1 mm nearer to the edge."""
    found = borne(floor(), X, height=0.060)
    assert found.criterion == "tips" and found.rotation[1] > 0
    assert found.load == pytest.approx(WEIGHT * 0.014 / 0.060, rel=0.05)


def test_turning_is_borne_by_friction_of_the_floor():
    """[D] A square of half width b under even pressure bears 0.765 mu W b about its middle."""
    found = borne(floor(), moment=Z)
    assert found.criterion == "turns"
    assert found.load == pytest.approx(0.765 * MU * WEIGHT * 0.015, rel=0.05)


def test_suction_is_lifted_against_and_lost():
    found = borne(floor(), Z, held=suction(5.0))
    assert found.load == pytest.approx(WEIGHT + 5.0, rel=0.05)
    assert found.criterion == "seal lost" and found.translation[2] > 0


def test_walls_that_do_not_press_clamp_nothing():
    """Limit analysis would let opposite walls press as hard as it takes to bear any pull up."""
    walls = [wall(0.015, 0.010), wall(-0.015, 0.010)]
    found = borne(ContactSprings.together(floor(), *walls), Z)
    assert found.criterion == "lifts"
    # The ramp goes on by two steps of 0.05 N while the part rises.
    assert found.load == pytest.approx(WEIGHT, rel=0.08)


def test_walls_that_press_hold_by_their_friction():
    """[D] W + 2 mu k d A for a depth d."""
    depth = 1e-6
    walls = [wall(x, 0.010, depth=depth) for x in (0.015, -0.015)]
    found = borne(ContactSprings.together(floor(), *walls), Z)
    clamping = MU * STIFF * depth * 2 * 0.020 * 0.010
    assert found.load == pytest.approx(WEIGHT + clamping, rel=0.05)


def test_a_wall_yields_at_its_strength():
    """[D] Wall and friction: q A + mu W; it gives way before the part has moved by 1 mm."""
    springs = ContactSprings.together(floor(), wall(0.015, 0.010, limit=5e4, mu=0.0))
    found = borne(springs, X)
    assert found.criterion == "yields"
    assert found.load == pytest.approx(5e4 * 0.020 * 0.010 + MU * WEIGHT, rel=0.05)


def test_what_bears_more_than_asked_says_so():
    found = borne(floor(), -Z, most=30.0)
    assert not found.moved and found.load == 30.0 and found.criterion == ""


def test_a_gap_is_closed_before_a_wall_bears():
    """0.5 mm of gap: the part slides that far, then the wall stops it."""
    springs = ContactSprings.together(floor(), wall(0.015, 0.010, depth=-5e-4, mu=0.0))
    found = borne(springs, X, most=10.0)
    assert not found.moved and 5e-4 < found.translation[0] < 7e-4


def test_a_steady_push_down_adds_to_the_friction():
    down = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -10.0])
    assert borne(floor(), X, steady=down).load == pytest.approx(MU * (WEIGHT + 10.0), rel=0.05)


def test_directions_do_not_meet():
    """Loaded together or one by one, the result is the same."""
    contacts = Contacts(floor(), suction(3.0))
    ways = sphere_of_forces(4)
    together = holding_map(contacts, 0.02 * Z, WEIGHT, ways, most=10.0)
    for way, found in zip(ways, together, strict=True):
        alone = holding_map(contacts, 0.02 * Z, WEIGHT, way[None], most=10.0)[0]
        assert found.load == pytest.approx(alone.load, rel=0.02)  # Steps of 1 %, rounded apart.
        assert found.criterion == alone.criterion


def test_the_map_turns_with_the_world():
    """A quarter turn of contacts and directions changes nothing."""
    springs = ContactSprings.together(floor(), wall(0.015, 0.008, limit=5e4))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = replace(springs, points=springs.points @ turn.T, normals=springs.normals @ turn.T)
    ways = sphere_of_forces(4)
    loads = [
        [b.load for b in holding_map(Contacts(own, suction(3.0)), 0.02 * Z, WEIGHT, at, most=10.0)]
        for own, at in ((springs, ways), (turned, np.hstack([ways[:, :3], ways[:, 3:] @ turn.T])))
    ]
    np.testing.assert_allclose(*loads, rtol=0.02)


def test_patches_of_one_polygon_press_at_their_common_middle():
    """[D] Two walls that press resist a turn by 14 N m/rad; as one polygon each, not at all.

    Until they open at their ends, at 10 um / 9 mm = 1.1 mrad.
    """
    smooth = floor(mu=0.0)
    walls = [wall(x, 0.010, depth=1e-5, mu=0.0) for x in (0.015, -0.015)]
    whole = [replace(own, polygons=0 * own.polygons) for own in walls]
    turned = [
        borne(ContactSprings.together(smooth, *own), moment=Z, most=0.005).rotation[2]
        for own in (walls, whole)
    ]
    assert turned[0] == pytest.approx(0.005 / 14.4, rel=0.2)
    assert turned[1] > 1e-3


def test_patch_counts_no_longer_beyond_an_edge_of_the_part():
    """Lifted above a low wall, the part is pushed over it; a wall without an end would hold it."""
    high = wall(0.015, 0.0004, mu=0.0)
    low = replace(
        high, bounds=high.points[:, 2] + 1e-6, bound_normals=np.tile(Z, (len(high.areas), 1))
    )
    push = np.array([0.0, 0.0, 0.0, 0.05, 0.0, 0.0])
    moved = [
        borne(ContactSprings.together(floor(mu=0.0), own), Z, steady=push, height=2e-4)
        for own in (high, low)
    ]
    assert moved[0].criterion == "lifts" and moved[0].translation[0] < 1e-5
    assert moved[1].translation[0] > 5e-4


def test_sphere_of_forces_is_even():
    forces = sphere_of_forces(30)[:, 3:]
    np.testing.assert_allclose(np.linalg.norm(forces, axis=1), 1.0)
    np.testing.assert_allclose(forces.mean(axis=0), 0.0, atol=0.02)


def test_criterion_and_margin_are_read_from_the_ramp():
    """By hand: 2 degrees are reached at 2 N, when half a millimetre has been slid."""
    motion = np.zeros((3, 6))
    motion[:, 0] = np.deg2rad([0.0, 1.0, 3.0])
    motion[:, 3] = [0.0, 0.00025, 0.00075]
    found = Bearing.of(np.array([0.0, 1.0, 3.0]), motion, 0.0, np.zeros(3), np.zeros(3))
    assert found.criterion == "tips" and found.moved
    assert found.load == pytest.approx(2.0)
    assert found.margin == pytest.approx(1.0)
    assert set(CRITERIA) >= {found.criterion}


def pressed_can() -> tuple[Bed, np.ndarray]:
    """A frozen bed with a prism 10 mm deep in it, and the prism's corners in J."""
    angle = np.arange(16) * 2 * np.pi / 16
    ring = 0.0175 * np.column_stack([np.cos(angle), np.sin(angle)])
    low = JIG.bag.cap_height - 0.010
    hull = np.vstack([np.column_stack([ring, np.full(16, z)]) for z in (low, low + 0.05)])
    bed = Bed(JIG.bag, JIG.soil)
    samples = SurfaceSamples.of("can", trimesh.convex.convex_hull(hull))
    for depth in np.arange(0.0, 0.0101, 0.0005):
        at = (np.eye(3), np.array([0.0, 0.0, 0.010 - depth]))
        bed.press(at, (np.zeros(3), np.array([0.0, 0.0, -0.01])), samples, 0.05)
        bed.settle(0.05)
    bed.jam(JIG.vacuum.contraction)
    return bed, hull


def test_springs_push_as_drakes_contact_surface_does():
    """Pressed 30 um down, floor and walls of the bed push within 3 % of what Drake computes."""
    bed, hull = pressed_can()
    mesh = imprint_mesh(bed, JIG.jammed, [hull], None, 0.4)
    gradient, sink = 1e9, 3e-5
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(time_step=1e-3, contact_model="hydroelastic_with_fallback")
    plant, _ = AddMultibodyPlant(config, builder)
    bed_properties = drake_proximity(mesh, JIG, gradient)
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform(), drake_shape(mesh), "bed", bed_properties
    )
    body = plant.AddRigidBody("can", SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1))
    rigid = ProximityProperties()
    AddRigidHydroelasticProperties(0.01, rigid)
    AddContactMaterial(friction=CoulombFriction(0.5, 0.5), properties=rigid)
    shape = Convex(points=hull.T, label="can")
    plant.RegisterCollisionGeometry(body, RigidTransform(), shape, "can", rigid)
    plant.Finalize()
    diagram = builder.Build()
    context = plant.GetMyMutableContextFromRoot(root := diagram.CreateDefaultContext())
    plant.SetFreeBodyPose(context, body, RigidTransform([0.0, 0.0, -sink]))
    assert root is not None
    query = plant.get_geometry_query_input_port().Eval(context)
    (surface,) = query.ComputeContactSurfaces(HydroelasticContactRepresentation.kPolygon)
    _, normals, areas, pressures = read_faces(surface)
    steep = np.abs(normals[:, 2]) < 0.5
    strength = Strength(90e3, JIG.soil.friction_angle)
    springs = bed_springs(mesh, [hull], gradient, strength, 0.5)
    sunk = replace(
        springs,
        depths=springs.depths + sink * springs.normals[:, 2],
        bounds=springs.bounds + sink * springs.bound_normals[:, 2],
    )
    force = sunk.pressures * sunk.areas
    assert force[~springs.walls].sum() == pytest.approx((areas * pressures)[~steep].sum(), rel=0.03)
    assert force[springs.walls].sum() == pytest.approx((areas * pressures)[steep].sum(), rel=0.05)
    fewer = springs.merged(4e-3)
    assert len(fewer.areas) < len(springs.areas)
    assert fewer.areas.sum() == pytest.approx(springs.areas.sum())


def can_in_bed(press_force: float, vacuum: float | None = None):
    product = product_of({"can": rod(34.8, 0, 50)})
    (solid,) = solids_of(product).values()
    part = HeldPart.of(product.parts["can"], solid, JIG.jammed.friction)
    return frozen_body(
        [part], [solid], rotation_with_up("+z").matrix(), np.zeros(2), JIG, press_force, vacuum
    )


def test_more_depth_and_more_vacuum_bear_more():
    loads = {}
    for force, vacuum in ((5.0, None), (20.0, None), (20.0, 30e3)):
        body = can_in_bed(force, vacuum)
        direction = np.concatenate([np.zeros(3), X])[None]
        loads[force, vacuum] = holding_map(body.contacts, body.p_JG, body.weight, direction)[0].load
    assert loads[20.0, None] > 1.1 * loads[5.0, None]
    assert loads[20.0, None] > 1.2 * loads[20.0, 30e3]


def test_without_vacuum_nothing_is_frozen():
    with pytest.raises(InputError, match="does not freeze"):
        can_in_bed(20.0, 0.0)


@pytest.mark.slow
def test_the_jig_tells_what_holds_a_part():
    """Nothing while soft; frozen, the floor carries weight and suction of the part at rest."""
    rig = Rig()
    assert rig.jig.contacts(rig.context, rig.motor) is None
    rig.press(duration=0.6)
    rig.jam()
    rig.let_go()
    rig.step(200)
    held = rig.jig.contacts(rig.context, rig.motor)
    assert held is not None
    springs = held.springs
    up = springs.pressures * springs.areas * springs.normals[:, 2]
    assert up.sum() == pytest.approx(MASS * 9.81 + held.suction.forces.sum(), rel=0.1)


def test_script_maps_without_pulls(tmp_path, capsys):
    arguments = ["--case", "plate/P1", "--directions", "2", "--no-pulls", "--out", str(tmp_path)]
    assert main(arguments) == 0
    assert (tmp_path / "holding_map.json").exists()
    assert "plate/P1" in capsys.readouterr().out


def test_script_refuses_an_unknown_case(tmp_path, capsys):
    assert main(["--case", "motor/P7", "--out", str(tmp_path)]) == 2
    assert "motor/P2" in capsys.readouterr().err
