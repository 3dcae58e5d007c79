"""Strength of the frozen bed: formulas, relief of excess pressure, and the plastic return."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cell.fixtures.soft_jig.frozen.yielding import Patch, Strength, plastic_return
from cell.fixtures.soft_jig.mesh.tet_mesh import TetMesh
from cell.fixtures.soft_jig.parameters import SoilParameters
from experiments.jig.element_rig import ElementRig
from experiments.jig.element_tests import PUSH_HEIGHT, parameters
from experiments.jig.specimens import Prism

UP = np.array([0.0, 0.0, 1.0])
STILL = (np.zeros(3), np.zeros(3))


def block() -> TetMesh:
    """Return a 20 mm cube of jammed beads on z = 0, as tetrahedra from its middle."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 2)]) * 0.01
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    tetrahedra = np.array([(a, b, c, 8) for a, b, c in faces])
    vertices = np.vstack([corners, [[0.0, 0.0, 0.01]]])
    mesh = TetMesh(vertices, tetrahedra)
    flipped = mesh.volumes() < 0
    tetrahedra[flipped] = tetrahedra[flipped][:, [0, 2, 1, 3]]
    return TetMesh(vertices, tetrahedra)


def patch_on_top(depth: float, excess: float, gradient: float = 2.5e8) -> Patch:
    """Return polygons at a depth [m] behind the top of the block, with an excess pressure [Pa]."""
    side = np.linspace(-0.009, 0.009, 10)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    n = len(x)
    points = np.column_stack([x, y, np.full(n, 0.02 - depth)])
    limits = np.full(n, 1e5)
    return Patch(
        points,
        np.tile(UP, (n, 1)),
        np.full(n, 4e-6),
        limits + excess,
        np.full(n, gradient),
        limits,
    )


def test_strength_follows_the_formulas_of_soil_mechanics() -> None:
    """90 kPa and 25 deg: 132 kPa on a wall, c Nc = 0.87 MPa on a floor [D]."""
    strength = Strength(90e3, SoilParameters().friction_angle)
    assert strength.lateral == pytest.approx(132e3, rel=0.005)
    assert strength.bearing == pytest.approx(0.87e6, rel=0.005)
    half = Strength(45e3, SoilParameters().friction_angle)
    assert half.lateral == pytest.approx(strength.lateral / 2)
    wall_and_floor = strength.limit(np.array([[1.0, 0, 0], [0, 0, 1.0]]))
    assert wall_and_floor == pytest.approx([strength.lateral, strength.bearing])


def test_strength_of_an_inclined_face_is_between_wall_and_floor() -> None:
    """Slip lines: p (Kp exp(2 a tan(phi)) - 1), 371 kPa at 45 deg [D]; up or down alike."""
    strength = Strength(90e3, SoilParameters().friction_angle)
    half = np.sqrt(0.5) * np.array([[1.0, 0, 1.0], [0, 1.0, -1.0]])
    assert strength.limit(half) == pytest.approx(371e3, rel=0.005)


def test_relief_leaves_the_viscous_pressure_at_any_step() -> None:
    """At 20 mm/s the pressure gains k v dt in a step; the relief runs ahead, and eta v is left."""
    patch, viscosity, gradient = patch_on_top(1e-3, 2e4), 1e5, 2.5e8
    sinking = (np.zeros(3), np.array([0.0, 0.0, -0.02]))
    for dt in (1e-3, 0.5e-3):
        force, _ = patch.relief(np.zeros(3), sinking, viscosity, dt)
        left = 2e4 + gradient * 0.02 * dt + force[2] / (100 * 4e-6)
        assert left == pytest.approx(viscosity * 0.02)


def test_relief_is_the_excess_pressure_times_the_area_into_the_bed() -> None:
    force, torque = patch_on_top(1e-3, 2e4).relief(np.array([0.0, 0.0, 0.02]), STILL, 1e5, 1e-3)
    assert force == pytest.approx([0, 0, -2e4 * 100 * 4e-6])
    assert torque == pytest.approx(np.zeros(3), abs=1e-9)


def test_nothing_is_relieved_below_the_limit() -> None:
    force, _ = patch_on_top(1e-3, -1.0).relief(np.zeros(3), STILL, 1e5, 1e-3)
    assert not force.any()
    assert plastic_return(block(), [patch_on_top(1e-3, -1.0)], 1e-5) is None


def test_surface_moves_by_the_excess_depth() -> None:
    """A uniform excess of 50 kPa at 250 kPa/mm lowers the face by 0.2 mm, and only that face."""
    mesh = block()
    moved = plastic_return(mesh, [patch_on_top(1e-3, 5e4)], 1e-5)
    assert moved is not None
    shift = moved.vertices - mesh.vertices
    top = mesh.vertices[:, 2] > 0.015
    assert shift[top, 2] == pytest.approx(-2e-4, rel=0.05)
    assert np.abs(shift[~top]).max() < 1e-9
    assert moved.volumes().min() > 0


def test_plastic_return_never_folds_the_mesh_over() -> None:
    """An excess depth beyond the height of the block leaves its tetrahedra positive."""
    moved = plastic_return(block(), [patch_on_top(1e-3, 5e6)], 1e-5)
    assert moved is None or moved.volumes().min() > 0


def test_capacity_falls_with_the_strength_of_the_beads() -> None:
    """In the plant: sealed, a cylinder tips over the edge that the beads carry.

    At 0.3 of their strength they need 40 % of its end in place of 12 %: a lever of 0.5 in place of
    0.8 radii [D].
    """
    forces = []
    for strength in (1.0, 0.3):
        params = parameters(sealed=True)
        jammed = replace(params.jammed, strength=strength)
        rig = ElementRig(replace(params, jammed=jammed), Prism(facets=12))
        rig.lower_to(0.015, speed=0.04)
        rig.jam()
        rig.let_go(0.2)
        top = np.array([0, 0, 0.015 + PUSH_HEIGHT])
        forces.append(rig.drag(top, np.array([1.0, 0, 0]), 0.004, 0.02).holding_force)
    assert 0.4 * forces[0] < forces[1] < 0.8 * forces[0]
