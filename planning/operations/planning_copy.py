"""The planning copy of a cell: what collisions are checked in."""

from __future__ import annotations

from collections.abc import Mapping

from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant

from cell.builder import Cell
from cell.configuration.config import CellConfig
from cell.machines.arm import Arm
from cell.machines.devices import add_arms, make_drives
from cell.machines.driver import Driver
from cell.machines.jig_base import fit_to_bag
from cell.machines.workcell import add_workcell
from cell.workpieces.bit_end import BitEnd
from cell.workpieces.parts import add_parts
from planning.motion.collision_model import CollisionModel


def collision_model(cell: Cell, config: CellConfig) -> CollisionModel:
    """Return the planning copy of a cell, with the empty fixture as an obstacle.

    Args:
        cell: The cell.
        config: What the planner believes it to be.
    """

    def populate(plant: MultibodyPlant, scene_graph: SceneGraph) -> Mapping[str, Arm]:
        workcell = add_workcell(plant, config, cell.product.tray)
        fit_to_bag(plant, scene_graph, workcell.base, config.jig.bag)
        plant.RegisterCollisionGeometry(
            workcell.base,
            RigidTransform(),
            cell.fixture.obstacle(),
            "fixture",
            CoulombFriction(1.0, 1.0),
        )
        arms = add_arms(plant, config, make_drives(config))
        for arm in arms.values():
            if isinstance(arm.tool, Driver):
                BitEnd.add(plant, scene_graph, arm.tool.bit_frame)
        add_parts(plant, cell.product, config.workcell.X_WT)
        return arms

    motion = config.motion
    return CollisionModel(
        populate,
        arm_clearance=motion.arm_clearance,
        obstacle_clearance=motion.obstacle_clearance,
        hand=(cell.holder.name, "tip"),
    )
