"""The tray really carries the parts where the product file says they are."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from cell.load_product import load_product
from cell.paths import model_url, new_parser
from cell.sdf import LINK

SETTLING = 5e-4  # [m] Half of the play between parts and stops.
TILTING = 1.0  # [deg]


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
