"""A planning copy of the cell for tests: two arms, tools, table, jig, motor and plate."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import QuaternionFloatingJoint

from cell.configuration.config import ArmConfig, CellConfig
from cell.machines.arm import Arm
from cell.machines.arms import ArmModel
from cell.machines.arms.ur import UR5E
from cell.machines.devices import add_arms, make_drives
from cell.paths import model_url, new_parser
from planning.motion.collision_model import CollisionModel

P_WJ = [0.0, 0.15, 0.20]
TOOL_DOWN = RollPitchYaw(np.pi, 0.0, 0.0)


def populate(
    plant: MultibodyPlant, scene_graph: SceneGraph, model: ArmModel, gripper: str
) -> Mapping[str, Arm]:
    X_WJ = RigidTransform(P_WJ)
    for name in ("table", "riser", "force_plate", "jig_base"):
        X_WM = RigidTransform() if name == "table" else X_WJ
        (instance,) = new_parser(plant).AddModelsFromUrl(model_url(name))
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(name, instance), X_WM)
    left = ArmConfig(
        model.name, gripper, p_WB=(-0.55, 0.0, 0.0), home_deg=model.home_deg["gripper"]
    )
    right = ArmConfig(
        "ur5e", "screwdriver", p_WB=(0.55, 0.0, 0.0), home_deg=UR5E.home_deg["gripper"]
    )
    config = CellConfig(arms={"left": left, "right": right})
    arms = add_arms(plant, config, make_drives(config))
    for name in ("motor", "motor_plate"):
        (instance,) = new_parser(plant).AddModelsFromUrl(model_url(name))
        body = plant.get_body(plant.GetBodyIndices(instance)[0])
        plant.AddJoint(
            QuaternionFloatingJoint(f"{name}_free", plant.world_frame(), body.body_frame())
        )
    return arms


def planning_cell(model: ArmModel = UR5E, gripper: str = "hand_e") -> CollisionModel:
    return CollisionModel(
        partial(populate, model=model, gripper=gripper),
        arm_clearance=0.02,
        obstacle_clearance=0.005,
        hand=("left", "tip"),
    )
