"""SDF text of a part is read back by Drake with the same physics."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Box, HydroelasticContactRepresentation, SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Diagram, DiagramBuilder

from cell.cad.sdf import LINK, Contact, Model, Piece, Visual, mesh_inertia, sdf_text, write_model
from cell.errors import BadPart
from cell.paths import model_url, new_parser
from cell.products.loading import load_product


def brick(size: tuple[float, float, float] = (0.1, 0.2, 0.3)) -> trimesh.Trimesh:
    return trimesh.creation.box(size)


def test_inertia_of_a_box_is_the_textbook_one() -> None:
    inertia = mesh_inertia(brick().apply_translation([1, 2, 3]), 6.0)
    np.testing.assert_allclose(inertia.p_PCm, [1, 2, 3], atol=1e-12)
    expected = np.diag([0.2**2 + 0.3**2, 0.1**2 + 0.3**2, 0.1**2 + 0.2**2]) * 6.0 / 12.0
    np.testing.assert_allclose(inertia.I_Cm_P, expected, atol=1e-12)


@pytest.mark.parametrize("mass", [0.0, -1.0, float("nan")])
def test_impossible_mass_is_refused(mass: float) -> None:
    with pytest.raises(BadPart, match="brick.*mass"):
        mesh_inertia(brick(), mass, "brick")


def test_drake_reads_back_pose_mass_and_contact() -> None:
    X = RigidTransform(RollPitchYaw(0.1, -0.2, 0.3), [1e-3, -2e-3, 3e-3])
    piece = Piece("bed_side", Box(0.1, 0.2, 0.3), Contact(0.4, 1e8, 0.003, 7.0), X)
    visual = Visual("look", Box(0.1, 0.2, 0.3), (1, 0, 0), X)
    model = Model("thing", mesh_inertia(brick(), 2.0), [piece], [visual])
    plant, scene_graph = MultibodyPlant(1e-3), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    Parser(plant).AddModelsFromString(sdf_text(model), "sdf")
    plant.Finalize()
    body = plant.GetBodyByName(LINK)
    assert body.default_mass() == pytest.approx(2.0)
    (geometry,) = plant.GetCollisionGeometriesForBody(body)
    inspector = scene_graph.model_inspector()
    assert inspector.GetName(geometry) == "thing::bed_side"
    assert inspector.GetPoseInFrame(geometry).IsNearlyEqualTo(X, 1e-9)
    properties = inspector.GetProximityProperties(geometry)
    assert properties.GetProperty("hydroelastic", "hydroelastic_modulus") == 1e8
    assert properties.GetProperty("hydroelastic", "resolution_hint") == 0.003
    assert properties.GetProperty("material", "hunt_crossley_dissipation") == 7.0
    assert properties.GetProperty("material", "coulomb_friction").static_friction() == 0.4


def test_meshes_lie_where_the_sdf_points(tmp_path: Path) -> None:
    piece = Piece("hull", brick(), Contact(0.5), convex=True)
    model = Model(
        "thing", mesh_inertia(brick(), 1.0), [piece], [Visual("skin", brick(), (1, 1, 1))]
    )
    text = write_model(tmp_path, model).read_text()
    for file in ("hull_contact.obj", "skin_visual.obj"):
        assert f"sdf/thing/{file}" in text
        assert (tmp_path / "thing" / file).is_file()


def test_bolt_inertia_keeps_its_precision_in_the_text() -> None:
    """1e-9 kg m2 printed with too few digits is not positive definite."""
    parts = load_product("motor_unit").parts
    plant = MultibodyPlant(1e-3)
    instance = new_parser(plant).AddModels(url=model_url("bolt_m3x10"))[0]
    plant.Finalize()
    body = plant.GetRigidBodyByName(LINK, instance)
    M = body.default_spatial_inertia()
    expected = mesh_inertia(parts["bolt_1"].mesh, parts["bolt_1"].mass)
    assert M.get_mass() == pytest.approx(parts["bolt_1"].mass)
    I_Cm = M.Shift(M.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    np.testing.assert_allclose(I_Cm, expected.I_Cm_P, rtol=1e-3, atol=1e-14)


class Assembled:
    """Motor, plate and bolt as free bodies at chosen offsets from their assembled poses."""

    def __init__(self) -> None:
        product = load_product("motor_unit")
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(time_step=1e-3, contact_model="hydroelastic_with_fallback")
        self.plant, _ = AddMultibodyPlant(config, builder)
        parser = new_parser(self.plant)
        self.parts = {name: product.parts[name] for name in ("motor", "plate", "bolt_2")}
        self.bodies: dict[str, RigidBody] = {}
        for name, part in self.parts.items():
            instance = parser.AddModels(url=model_url(str(part.model)))[0]
            self.bodies[name] = self.plant.GetRigidBodyByName(LINK, instance)
        self.plant.Finalize()
        self.diagram: Diagram = builder.Build()

    def contacts(self, **offset: list[float]) -> set[tuple[str, str]]:
        """Return the pairs of pieces that touch, with parts moved by offsets [m]; no fallback."""
        root = self.diagram.CreateDefaultContext()
        context = self.plant.GetMyMutableContextFromRoot(root)
        for k, (name, body) in enumerate(self.bodies.items()):
            away = [1.0 + k, 0.0, 0.0]
            X = RigidTransform(offset.get(name, away)) @ self.parts[name].X_AP
            self.plant.SetFreeBodyPose(context, body, X)
        query = self.plant.get_geometry_query_input_port().Eval(context)
        surfaces, points = query.ComputeContactSurfacesWithFallback(
            HydroelasticContactRepresentation.kPolygon
        )
        assert points == []
        name = query.inspector().GetName
        pairs = [sorted(name(i).split("::")[-1] for i in (s.id_M(), s.id_N())) for s in surfaces]
        return {(first, second) for first, second in pairs}


@pytest.fixture(scope="module")
def assembled() -> Assembled:
    return Assembled()


def test_boss_clears_the_bore_and_a_misplaced_one_touches_it(assembled: Assembled) -> None:
    """Rigid on rigid would fall back to convex hulls, which close the hole."""
    assert assembled.contacts(motor=[0, 0, -2e-3], plate=[0, 0, 0]) == set()
    assert assembled.contacts(motor=[2e-4, 0, -2e-3], plate=[0, 0, 0]) == {("bore", "boss")}


def test_seated_face_is_supported_by_the_washers_alone(assembled: Assembled) -> None:
    pairs = assembled.contacts(motor=[0, 0, 1e-5], plate=[0, 0, 0])
    assert {second for _, second in pairs} == {f"washer_{k}" for k in range(6)}


def test_head_sits_on_its_washer_and_shank_is_free_in_the_hole(assembled: Assembled) -> None:
    assert assembled.contacts(bolt_2=[0, 0, -1e-5], plate=[0, 0, 0]) == {("head", "washer_1")}
    pairs = assembled.contacts(bolt_2=[3e-4, 0, 1e-3], plate=[0, 0, 0])
    assert pairs == {("shank", "washer_1")}
