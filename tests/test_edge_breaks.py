"""Broken edges of contact pieces: where they are, where they are not, and what they are for."""

from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from cell.cad.convex_pieces import convex_pieces
from cell.cad.edge_breaks import SHARE, WIDTH, with_broken_edges
from cell.cad.motor_unit import mesh
from cell.cad.sdf import LINK, Contact, Model, Piece, mesh_inertia, write_model
from cell.cad.shapes import box, to_trimesh


def off(solid: Manifold, pieces: list[Manifold]) -> float:
    """Return the volume that a solid has beyond its pieces [mm3]."""
    return (solid - sum(pieces, Manifold())).volume()


def test_all_twelve_edges_of_a_box_are_broken() -> None:
    """Prisms of w^2 / 2 along 4 (a + b + c), less what three of them share at each corner."""
    solid = box((0, 0, 0), (40, 30, 20))
    broken = with_broken_edges(solid, to_trimesh(solid))
    edges = 4 * (40 + 30 + 20) * WIDTH**2 / 2
    assert off(solid, [broken]) == pytest.approx(edges, abs=8 * WIDTH**3)
    assert broken.hull().volume() == pytest.approx(broken.volume(), rel=1e-9)


def test_a_thin_plate_keeps_most_of_its_edge() -> None:
    solid = box((0, 0, 0), (40, 30, 0.5))
    broken = with_broken_edges(solid, to_trimesh(solid))
    middle = broken.slice(0.25).area()
    assert middle == pytest.approx(40 * 30, rel=1e-3)
    at_face = broken.slice(1e-6).bounds()
    assert at_face[0] == pytest.approx(SHARE * 0.5, rel=1e-3)


def test_a_flat_face_has_no_groove_where_it_was_cut() -> None:
    """A step, cut into two: the lower one's foot and its side are as flat as they were."""
    solid = box((0, 0, 0), (40, 30, 10)) + box((0, 0, 0), (15, 30, 25))
    shape = to_trimesh(solid)
    pieces = [with_broken_edges(piece, shape) for piece in convex_pieces(solid)]
    assert len(pieces) == 2
    for along_the_cut in (
        box((1, 1, 0), (39, 29, 0.1)),
        box((1, 29.9, 9.5), (14.5, 30, 10.5)),
        box((0, 1, 9.5), (0.1, 29, 10.5)),
    ):
        assert off(along_the_cut, pieces) < 1e-2 * along_the_cut.volume()


def test_chamfers_and_round_walls_stay_as_they_are() -> None:
    prism = Manifold.cylinder(20.0, 10.0, -1.0, 64)
    chamfered = Manifold.batch_hull(
        [box((-9, -9, 0), (9, 9, 20)), box((-10, -9, 0), (10, 9, 19)), box((-9, -9, 0), (9, 9, 1))]
    )
    for solid in (prism, chamfered):
        broken = with_broken_edges(solid, to_trimesh(solid))
        assert broken.slice(10.0).area() == pytest.approx(solid.slice(10.0).area(), rel=2e-3)


def creep(folder: Path, plate: Manifold) -> float:
    """Return how far a plate slides that is dropped, tilted, on a block of its outline [m]."""
    drawn = {
        "block": (box((-20, -20, -40), (20, 20, 0)), Contact(0.9)),
        "plate": (plate, Contact(0.5, 1e10, dissipation=500.0)),
    }
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlant(
        MultibodyPlantConfig(time_step=2e-3, discrete_contact_approximation="lagged"), builder
    )
    bodies = {}
    for name, (solid, contact) in drawn.items():
        shape = mesh(solid)
        piece = Piece(f"{name}_0", shape, contact, convex=True)
        model = Model(name, mesh_inertia(shape, 2700 * float(shape.volume)), [piece], [], shape)
        (instance,) = Parser(plant).AddModels(str(write_model(folder, model, "a test")))
        bodies[name] = plant.GetBodyByName(LINK, instance)
    plant.WeldFrames(plant.world_frame(), bodies["block"].body_frame())
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    aside = np.array([0.0, 1e-4])
    X = RigidTransform(RollPitchYaw(0.01, 0.003, 0.0), [*aside, 2e-4])
    plant.SetFreeBodyPose(context, bodies["plate"], X)
    simulator.AdvanceTo(0.4)
    X_WP = bodies["plate"].EvalPoseInWorld(context)
    return float(np.linalg.norm(X_WP.translation()[:2] - aside))


def test_a_plate_with_broken_edges_stays_where_it_lands(tmp_path: Path) -> None:
    """The sides of a sharp block inside of a sharp plate push it out of its place."""
    sharp = box((-20, -20, 0), (20, 20, 5))
    broken = with_broken_edges(sharp, to_trimesh(sharp))
    creeps = {"sharp": creep(tmp_path / "s", sharp), "broken": creep(tmp_path / "b", broken)}
    assert creeps["broken"] < 5e-6
    assert creeps["broken"] < 0.1 * creeps["sharp"]
