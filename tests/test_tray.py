"""The tray really carries the parts where the product file says they are."""

from collections.abc import Mapping

import numpy as np
import pytest
from pydrake.geometry import GeometryId
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import PrismaticJoint
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from cell.loading import load_product
from cell.paths import model_url, new_parser
from cell.product import Grasp
from cell.sdf import LINK

SETTLING = 5e-4  # [m] Half of the play between parts and stops.
TILTING = 1.0  # [deg]
OPENING = 1.5e-3  # [m] Per side: within the stroke for the plate, more than the play of its stops.


def settle(names: list[str], seconds: float, X_TP: dict[str, RigidTransform]):
    """Return the poses in T of parts that were let go at ``X_TP`` above a welded tray."""
    product = load_product("motor_unit")
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=1e-3,
        discrete_contact_approximation="lagged",
        contact_model="hydroelastic_with_fallback",
    )
    plant, _ = AddMultibodyPlant(config, builder)
    assert product.tray is not None
    parser = new_parser(plant)
    tray = parser.AddModels(url=model_url(product.tray))[0]
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(LINK, tray))
    bodies = {}
    for name in names:
        instance = parser.AddModels(url=model_url(str(product.parts[name].model)))[0]
        bodies[name] = plant.GetBodyByName(LINK, instance)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for name, body in bodies.items():
        plant.SetFreeBodyPose(context, body, X_TP[name])
    simulator.AdvanceTo(seconds)
    return {name: plant.EvalBodyPoseInWorld(context, body) for name, body in bodies.items()}


@pytest.mark.parametrize("names", [["motor"], ["plate"], ["bolt_1", "bolt_2"]])
def test_part_stays_where_the_tray_presents_it(names: list[str]) -> None:
    product = load_product("motor_unit")
    X_TP = {name: product.parts[name].X_TrayP or RigidTransform() for name in names}
    for name, X_TP_end in settle(names, 0.5, X_TP).items():
        change = X_TP[name].InvertAndCompose(X_TP_end)
        angle = np.rad2deg(change.rotation().ToAngleAxis().angle())
        assert np.linalg.norm(change.translation()) < SETTLING
        assert abs(angle) < TILTING


class TrayAndHand:
    """The loaded tray with a free gripper, for asking what a grasp would run into."""

    def __init__(self) -> None:
        self.product = load_product("motor_unit")
        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlant(MultibodyPlantConfig(time_step=1e-3), builder)
        parser = new_parser(self.plant)
        tray = parser.AddModels(url=model_url(str(self.product.tray)))[0]
        self.plant.WeldFrames(self.plant.world_frame(), self.plant.GetFrameByName(LINK, tray))
        self.bodies = {}
        for name, part in self.product.parts.items():
            instance = parser.AddModels(url=model_url(str(part.model)))[0]
            self.bodies[name] = self.plant.GetBodyByName(LINK, instance)
        self.hand = parser.AddModels(url=model_url("hand_e"))[0]
        self.plant.Finalize()
        self.diagram = builder.Build()

    def hits(self, poses: Mapping[str, RigidTransform], name: str, grasp: Grasp) -> set[str]:
        """Return what the open hand overlaps at the grasp and on its way down to it."""
        root = self.diagram.CreateDefaultContext()
        context = self.plant.GetMyMutableContextFromRoot(root)
        for part, X_TP in poses.items():
            self.plant.SetFreeBodyPose(context, self.bodies[part], X_TP)
        recess = 0.012 if grasp.jaw == "wide" else 0.0
        for side in ("left", "right"):
            finger = self.plant.GetJointByName(f"finger_{side}_joint", self.hand)
            assert isinstance(finger, PrismaticJoint)
            finger.set_translation(context, grasp.width / 2 - recess + OPENING)
        palm = self.plant.GetBodyByName("palm", self.hand)
        X_PalmJaw = self.plant.GetFrameByName(grasp.jaw, self.hand).GetFixedPoseInBodyFrame()
        found = set()
        for lift in (0.0, 0.01, 0.03, 0.06):
            X_TJaw = poses[name] @ grasp.X_PJaw @ RigidTransform([0.0, 0.0, -lift])
            self.plant.SetFreeBodyPose(context, palm, X_TJaw @ X_PalmJaw.inverse())
            query = self.plant.get_geometry_query_input_port().Eval(context)
            for pair in query.ComputePointPairPenetration():
                owners = [self._owner(g) for g in (pair.id_A, pair.id_B)]
                if "hand_e" in owners:
                    found |= set(owners) - {"hand_e"}
        return found

    def _owner(self, geometry: GeometryId) -> str:
        inspector = self.diagram.GetSubsystemByName("scene_graph").model_inspector()  # type: ignore[attr-defined]
        body = self.plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        assert body is not None
        return self.plant.GetModelInstanceName(body.model_instance())


@pytest.fixture(scope="module")
def tray_and_hand() -> TrayAndHand:
    return TrayAndHand()


@pytest.mark.parametrize("name", ["motor", "plate", "bolt_1", "bolt_3"])
def test_hand_reaches_each_part_from_above(tray_and_hand: TrayAndHand, name: str) -> None:
    """Open by 1.5 mm a side, the hand comes straight down without touching tray or neighbours."""
    parts = tray_and_hand.product.parts
    poses = {n: part.X_TrayP for n, part in parts.items() if part.X_TrayP is not None}
    down = [g for g in parts[name].grasps if points_down(poses[name] @ g.X_PJaw)]
    assert down
    for grasp in down:
        assert tray_and_hand.hits(poses, name, grasp) == set(), grasp.name


def points_down(X_TJaw: RigidTransform) -> bool:
    return X_TJaw.rotation().matrix()[2, 2] < -0.99


def test_plate_can_be_held_while_bolts_are_tightened(tray_and_hand: TrayAndHand) -> None:
    """The side grasp clears motor and bolts of the assembled unit."""
    parts = tray_and_hand.product.parts
    high = RigidTransform([0.0, 0.0, 0.5])
    poses = {name: high @ part.X_AP for name, part in parts.items()}
    grasp = {g.name: g for g in parts["plate"].grasps}["edges_side"]
    assert tray_and_hand.hits(poses, "plate", grasp) == set()
