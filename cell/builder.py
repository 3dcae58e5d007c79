"""Build the cell: two arms with tools, soft jig on a force plate, tray and parts, in one plant."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace

from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import RigidBody, WeldJoint
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from cell.configuration.config import CellConfig
from cell.fixtures.soft_jig import SoftJig
from cell.machines.arm import Arm, Drive, add_arm
from cell.machines.jig_base import JigBase
from cell.machines.sensors import WrenchSensor
from cell.machines.tools import (
    Driver,
    Gripper,
    connect_driver,
    connect_gripper,
    set_driver_gains,
    set_gripper_gains,
)
from cell.paths import model_url, new_parser
from cell.products.product import Product
from cell.workpieces.parts import Parts, add_parts
from cell.workpieces.thread import Thread, add_thread

# The jaws wait this far open [m]: wide enough for the motor, narrow enough to see that they move.
JAW_REST = 0.045


@dataclass(frozen=True)
class Cell:
    """Handles to a built cell. Holding it keeps everything alive that a simulation needs.

    Attributes:
        config: What it was built from.
        product: The product whose parts are in it.
        plant, scene_graph: Plain Drake.
        left, right: The arms; the left one carries the gripper, the right one the driver.
        drives: Inputs of each arm, by arm name.
        gripper, driver: The tools.
        jig_base: What the jig's bag sits on, bolted down or free on the force plate.
        soft_jig: The jig.
        parts: The loose parts.
        threads: By the name of the bolt.
        wrists: Wrist wrench sensors, by arm name.
        force_plate: Wrench sensor under the jig.
        diagram: The built diagram; None until the caller of `add_cell` has built theirs.
    """

    config: CellConfig
    product: Product
    plant: MultibodyPlant
    scene_graph: SceneGraph
    left: Arm
    right: Arm
    drives: Mapping[str, Drive]
    gripper: Gripper
    driver: Driver
    jig_base: JigBase
    soft_jig: SoftJig
    parts: Parts
    threads: Mapping[str, Thread]
    wrists: Mapping[str, WrenchSensor]
    force_plate: WrenchSensor
    diagram: Diagram | None = None

    @property
    def arms(self) -> Mapping[str, Arm]:
        """The arms by name."""
        return {"left": self.left, "right": self.right}

    @property
    def X_WJ(self) -> RigidTransform:
        """Pose of the jig frame where the base was set down."""
        return self.config.workcell.X_WJ

    def reset(self, root: Context) -> None:
        """Put a new Context into the initial state: threads open, parts asleep, bag inflated.

        Drake has every constraint active in a default Context, those of all threads and bits too.

        Args:
            root: Context of the diagram that the cell was built into.
        """
        self.parts.reset(root)
        self.jig_base.reset(root, self.X_WJ)
        for thread in self.threads.values():
            thread.reset(root)
        for arm in self.arms.values():
            arm.use_position_drive()
        for body in self.soft_jig.pressing:
            self.soft_jig.release(body)
        self.soft_jig.inflate(root)


def build_cell(config: CellConfig, product: Product) -> Cell:
    """Build the simulated cell for one product, as a diagram of its own."""
    builder = DiagramBuilder()
    cell = add_cell(builder, config, product)
    return replace(cell, diagram=builder.Build())


def add_cell(builder: DiagramBuilder, config: CellConfig, product: Product) -> Cell:
    """Add the cell to a caller's diagram; with nothing else connected the arms hold.

    Reset each Context with `Cell.reset` before it is stepped. The diagram owns all that it steps
    with; the cell is needed for handles only.
    """
    plant, scene_graph = AddMultibodyPlant(plant_config(config), builder)
    plate_weld, base = add_workcell(plant, config, product)
    jig_base = JigBase.prepare(plant, scene_graph, plate_weld, base, config)
    left, right = add_arms(plant, config)
    parts = add_parts(plant, scene_graph, product, config.workcell.X_WT)
    threads = add_threads(plant, scene_graph, product, parts, right)
    soft_jig = SoftJig.add(plant, scene_graph, base, config.jig)
    soft_jig.filters_lifted = _filters_lifted(parts, jig_base)
    for thread in threads.values():
        thread.filters_lifted = soft_jig.filters_lifted
    plant.Finalize()
    drives = {
        arm.name: Drive.connect(builder, plant, arm.instance, arm.home) for arm in (left, right)
    }
    gripper = connect_gripper(builder, plant, left.tool, JAW_REST)
    driver = connect_driver(builder, plant, right.tool)
    wrists = {arm.name: WrenchSensor(plant, arm.wrist) for arm in (left, right)}
    force_plate = WrenchSensor(plant, plate_weld)
    return Cell(
        config=config,
        product=product,
        plant=plant,
        scene_graph=scene_graph,
        left=left,
        right=right,
        drives=drives,
        gripper=gripper,
        driver=driver,
        jig_base=jig_base,
        soft_jig=soft_jig,
        parts=parts,
        threads=threads,
        wrists=wrists,
        force_plate=force_plate,
    )


def _filters_lifted(
    parts: Parts, jig_base: JigBase
) -> Callable[[Context], AbstractContextManager[None]]:
    """Return what lifts the filters of everything that sleeps, given the root context."""

    @contextmanager
    def lifted(root: Context) -> Iterator[None]:
        with parts.filters_lifted(root), jig_base.filters_lifted(root):
            yield

    return lifted


def plant_config(config: CellConfig) -> MultibodyPlantConfig:
    """Return how the plant is stepped and what contact it has."""
    return MultibodyPlantConfig(
        time_step=config.simulation.time_step,
        discrete_contact_approximation=config.simulation.contact_approximation,
        contact_model="hydroelastic_with_fallback",
    )


def add_arms(plant: MultibodyPlant, config: CellConfig) -> tuple[Arm, Arm]:
    """Add both arms with their tools."""
    left = add_arm(plant, "left", "hand_e", config.left_arm)
    right = add_arm(plant, "right", "screwdriver", config.right_arm)
    set_gripper_gains(plant, left.tool)
    set_driver_gains(plant, right.tool)
    return left, right


def add_workcell(
    plant: MultibodyPlant, config: CellConfig, product: Product
) -> tuple[WeldJoint, RigidBody]:
    """Add table, riser, force plate, jig base and tray.

    Returns:
        The weld under the force plate, where it reads, and the jig base.
    """
    X_WJ = config.workcell.X_WJ
    _add_static(plant, "table", RigidTransform())
    _add_static(plant, "riser", X_WJ)
    weld = _add_static(plant, "force_plate", X_WJ)
    (instance,) = new_parser(plant).AddModelsFromUrl(model_url("jig_base"))
    jig_base = plant.GetBodyByName("jig_base", instance)
    if config.workcell.jig_base_fixed:
        plant.WeldFrames(weld.frame_on_child(), jig_base.body_frame())
    else:
        plant.SetDefaultFloatingBaseBodyPose(jig_base, X_WJ)
    if product.tray is not None:
        _add_static(plant, product.tray, config.workcell.X_WT)
    return weld, jig_base


def _add_static(plant: MultibodyPlant, model: str, X_WM: RigidTransform) -> WeldJoint:
    """Add a one-body model, welded: contact with ``world_body()`` itself crashes some plants."""
    (instance,) = new_parser(plant).AddModelsFromUrl(model_url(model))
    body = plant.get_body(plant.GetBodyIndices(instance)[0])
    return plant.WeldFrames(plant.world_frame(), body.body_frame(), X_WM)


def add_threads(
    plant: MultibodyPlant, scene_graph: SceneGraph, product: Product, parts: Parts, driver: Arm
) -> dict[str, Thread]:
    """Add the tapped hole and the open ties of every fastener of the product."""
    plant.AddModelInstance("threads")
    threads = {}
    for name, fastener in product.fasteners.items():
        X_AI = product.parts[fastener.into].X_AP
        threads[name] = add_thread(
            plant,
            scene_graph,
            fastener,
            bolt=parts[name].body,
            into=parts[fastener.into].body,
            X_IH=X_AI.inverse() @ product.parts[name].X_AP,
            bit_frame=driver.frame("bit_tip"),
        )
    return threads
