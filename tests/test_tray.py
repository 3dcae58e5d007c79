"""The trays really carry the parts where the product files say they are."""

from collections.abc import Iterator, Mapping

import numpy as np
import pytest
from pydrake.geometry import GeometryId
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import PrismaticJoint
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from cell.cad.sdf import LINK
from cell.paths import model_url, new_parser
from cell.products.loading import load_product
from cell.products.product import Grasp, Product

SETTLING = 5e-4  # [m] Half of the play between parts and stops.
TILTING = 1.0  # [deg]
OPENING = 1.5e-3  # [m] Per side: within the stroke for the plate, more than the play of its stops.


PRODUCTS = {name: load_product(name) for name in ("motor_unit", "idler")}
# Whatever has bolts in it when it is set aside, by product.
CLAMPED = {"motor_unit": "plate", "idler": "arm"}


def settle(product: Product, seconds: float, X_TP: dict[str, RigidTransform]):
    """Return the poses in T of parts that were let go at ``X_TP`` above a welded tray."""
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
    for name in X_TP:
        instance = parser.AddModels(url=model_url(str(product.parts[name].model)))[0]
        bodies[name] = plant.GetBodyByName(LINK, instance)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for name, body in bodies.items():
        plant.SetFreeBodyPose(context, body, X_TP[name])
    simulator.AdvanceTo(seconds)
    return {name: plant.EvalBodyPoseInWorld(context, body) for name, body in bodies.items()}


@pytest.mark.parametrize(
    ("product", "names"),
    [
        ("motor_unit", ["motor"]),
        ("motor_unit", ["plate"]),
        ("motor_unit", ["bolt_1", "bolt_2"]),
        ("idler", ["post"]),
        ("idler", ["arm"]),
        ("idler", ["bolt_1", "bolt_2"]),
    ],
)
def test_part_stays_where_the_tray_presents_it(product: str, names: list[str]) -> None:
    parts = PRODUCTS[product].parts
    X_TP = {name: parts[name].X_TrayP or RigidTransform() for name in names}
    for name, X_TP_end in settle(PRODUCTS[product], 0.5, X_TP).items():
        change = X_TP[name].InvertAndCompose(X_TP_end)
        angle = np.rad2deg(change.rotation().ToAngleAxis().angle())
        assert np.linalg.norm(change.translation()) < SETTLING
        assert abs(angle) < TILTING


@pytest.mark.parametrize("product", PRODUCTS)
def test_bolts_hang_free_in_what_is_set_aside_in_the_tray(product: str) -> None:
    """The place is open below: let go 0.3 mm above, every bolt comes to rest on its head."""
    parts, screws = PRODUCTS[product].parts, PRODUCTS[product].screws
    clamped = parts[CLAMPED[product]]
    assert clamped.X_TrayP is not None
    X_TA = clamped.X_TrayP @ clamped.X_AP.inverse()
    dropped = RigidTransform([0.0, 0.0, 3e-4])
    X_TP = {clamped.name: clamped.X_TrayP}
    X_TP |= {bolt: dropped @ X_TA @ parts[bolt].X_AP for bolt in screws}
    X_TP_end = settle(PRODUCTS[product], 0.5, X_TP)
    X_TA = X_TP_end[clamped.name] @ clamped.X_AP.inverse()
    for bolt in screws:
        X_SeatF = (X_TA @ parts[bolt].X_AP).InvertAndCompose(X_TP_end[bolt])
        assert abs(X_SeatF.translation()[2]) < 5e-5
        assert np.hypot(*X_SeatF.translation()[:2]) < 3e-4
        assert X_SeatF.rotation().matrix()[2, 2] > np.cos(np.deg2rad(0.5))


class TrayAndHand:
    """The loaded tray with a free gripper, for asking what a grasp would run into."""

    def __init__(self, product: str) -> None:
        self.product = PRODUCTS[product]
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
        inspector = self.diagram.GetSubsystemByName("scene_graph").model_inspector()
        body = self.plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        assert body is not None
        return self.plant.GetModelInstanceName(body.model_instance())


@pytest.fixture(scope="module", params=PRODUCTS)
def tray_and_hand(request: pytest.FixtureRequest) -> TrayAndHand:
    return TrayAndHand(request.param)


def test_hand_reaches_each_part_from_above(tray_and_hand: TrayAndHand) -> None:
    """Open by 1.5 mm a side, the hand comes straight down without touching tray or neighbours."""
    poses = {name: part.X_TrayP for name, part in tray_and_hand.product.parts.items()}
    poses = {name: X_TP for name, X_TP in poses.items() if X_TP is not None}
    for name, part in tray_and_hand.product.parts.items():
        down = [g for g in part.grasps if points_down(poses[name] @ g.X_PJaw)]
        assert down
        for grasp in down:
            assert tray_and_hand.hits(poses, name, grasp) == set(), grasp.name


def points_down(X_TJaw: RigidTransform) -> bool:
    return X_TJaw.rotation().matrix()[2, 2] < -0.99


def side_grasps(product: Product) -> Iterator[tuple[str, Grasp]]:
    """Yield the clamped part's grasps that leave the space above it to the driver."""
    part = product.parts[CLAMPED[product.name]]
    for grasp in part.grasps:
        if abs((part.X_AP @ grasp.X_PJaw).rotation().matrix()[2, 2]) < 0.5:
            yield part.name, grasp


def test_clamped_part_can_be_held_while_bolts_are_tightened(tray_and_hand: TrayAndHand) -> None:
    """A side grasp clears what is below the part, and the bolts, of the assembled product."""
    parts = tray_and_hand.product.parts
    high = RigidTransform([0.0, 0.0, 0.5])
    poses = {name: high @ part.X_AP for name, part in parts.items()}
    found = list(side_grasps(tray_and_hand.product))
    assert found
    for name, grasp in found:
        assert tray_and_hand.hits(poses, name, grasp) == set()
