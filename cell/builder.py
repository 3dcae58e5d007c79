"""Build the cell: arms with tools, a fixture on a force plate, tray and parts, in one plant.

The whole cell on one screen: `add_cell` puts it into a caller's diagram, `build_cell` into one of
its own. A program that steps either with Drake's own `Simulator` needs one line more:
``simulator.set_monitor(cell.monitor)``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from cell.configuration.config import CellConfig
from cell.contact.links import ContactLinks
from cell.errors import InputError, UnknownName
from cell.fixtures import add_fixture
from cell.fixtures.base import Fixture
from cell.fixtures.wiring import wire_fixture
from cell.link_policy import add_links
from cell.machines.arm import Arm
from cell.machines.cameras.camera import Camera, cameras_of
from cell.machines.devices import add_arms, make_drives
from cell.machines.drive import JointDrive
from cell.machines.driver import Driver
from cell.machines.gripper import Gripper
from cell.machines.jig_base import JigBase, fit_to_bag, stand_on
from cell.machines.sensors import WrenchSensor
from cell.machines.workcell import add_workcell
from cell.monitor import Monitor, StepCounter
from cell.ports import Ports, add_part_poses
from cell.products.product import Product
from cell.sleep import Sleep
from cell.workpieces.parts import Parts, add_parts
from cell.workpieces.press_fits import PressFits, add_press_fits
from cell.workpieces.threads import Threads, add_threads
from cell.workpieces.work import fixture_work

Extend = Callable[[MultibodyPlant, SceneGraph], None]


@dataclass(frozen=True)
class Cell:
    """Handles to a built cell. Holding it keeps everything alive that a simulation needs.

    Attributes:
        config: What it was built from.
        product: The product whose parts are in it.
        plant, scene_graph: Plain Drake.
        arms: By name; each carries a tool.
        jig_base: What the fixture sits on, bolted down or free on the force plate.
        fixture: Holds a part on the base.
        parts: The loose parts.
        threads: Of the product's bolts.
        press_fits: Of the product's parts.
        links: Contacts that stick, as springs.
        sleeper: Puts parts and base to sleep.
        force_plate: Wrench sensor under the jig.
        cameras: By name: "above", and "hand_eye" if it is mounted.
        ports: Inputs and outputs by name.
        monitor: For `Simulator.set_monitor`.
        diagram: The built diagram; None until the caller of `add_cell` has built theirs.
    """

    config: CellConfig
    product: Product
    plant: MultibodyPlant
    scene_graph: SceneGraph
    arms: Mapping[str, Arm]
    jig_base: JigBase
    fixture: Fixture
    parts: Parts
    threads: Threads
    press_fits: PressFits
    links: ContactLinks
    sleeper: Sleep
    force_plate: WrenchSensor
    cameras: Mapping[str, Camera]
    ports: Ports
    monitor: Monitor
    diagram: Diagram | None = None

    def with_diagram(self, diagram: Diagram) -> Cell:
        """Return the cell with the diagram that a caller has built around it."""
        return replace(self, diagram=diagram)

    def arm_with(self, role: str) -> Arm:
        """Return the first arm whose tool has a role: "gripper" or "driver".

        Raises:
            UnknownName: No arm carries such a tool.
        """
        for arm in self.arms.values():
            if arm.tool.role == role:
                return arm
        raise UnknownName("arm with a", role, {arm.tool.role for arm in self.arms.values()})

    @property
    def holder(self) -> Arm:
        """The arm that grips parts."""
        return self.arm_with("gripper")

    @property
    def driver(self) -> Arm:
        """The arm that drives bolts."""
        return self.arm_with("driver")

    @property
    def gripper(self) -> Gripper:
        """The tool of the holder."""
        tool = self.holder.tool
        assert isinstance(tool, Gripper)
        return tool

    @property
    def screwdriver(self) -> Driver:
        """The tool of the driver."""
        tool = self.driver.tool
        assert isinstance(tool, Driver)
        return tool

    @property
    def drives(self) -> dict[str, JointDrive]:
        """What each device is told, by the name of the device."""
        tools = {arm.tool.name: arm.tool.drive for arm in self.arms.values()}
        return {arm.name: arm.drive for arm in self.arms.values()} | tools

    @property
    def X_WJ(self) -> RigidTransform:
        """Pose of the jig frame where the base was set down."""
        return self.config.workcell.X_WJ


def build_cell(config: CellConfig, product: Product, *, extend: Extend | None = None) -> Cell:
    """Build the cell for one product, as a diagram of its own.

    Its ports are those of the diagram; the arguments are those of `add_cell`.
    """
    builder = DiagramBuilder()
    cell = add_cell(builder, config, product, extend=extend)
    cell.ports.export(builder)
    return cell.with_diagram(builder.Build())


def add_cell(
    builder: DiagramBuilder,
    config: CellConfig,
    product: Product,
    *,
    name: str = "",
    extend: Extend | None = None,
) -> Cell:
    """Add the cell to a caller's diagram; with nothing connected to its ports the arms hold.

    Args:
        builder: The caller's. The diagram owns all that it steps with; the returned cell is needed
            for handles only.
        config: Every number of the cell.
        product: What is to be assembled; every part needs a simulation model.
        name: Tells two cells in one builder apart.
        extend: Called with plant and scene graph before the plant is finalized: adds bodies of the
            caller's own.

    Raises:
        InputError: A product without simulation models, an unknown device or fixture, a part that
            the fixture cannot hold, or systems of the builder that have the cell's names already.
    """
    product.check_simulable()
    prefix = f"{name}_" if name else ""
    _check_names(builder, f"{prefix}steps")
    counter = builder.AddNamedSystem(f"{prefix}steps", StepCounter(config.simulation.time_step))
    drives = make_drives(config)
    for arm, own in drives.items():
        # Before the plant: see `cell.machines.drive`.
        builder.AddNamedSystem(f"{prefix}{arm}_drive", own.arm)
        builder.AddNamedSystem(f"{prefix}{own.tool_name}_drive", own.tool)
    plant, scene_graph = AddMultibodyPlant(plant_config(config), builder)
    # With no name of the cell, those that Drake's visualizers look for.
    plant.set_name(f"{prefix}plant")
    scene_graph.set_name(f"{prefix}scene_graph")
    workcell = add_workcell(plant, config, product.tray)
    fit_to_bag(plant, scene_graph, workcell.base, config.jig.bag)
    if not config.workcell.jig_base_fixed:
        stand_on(plant, scene_graph, workcell.plate, workcell.base, config)
    arms = add_arms(plant, config, drives)
    parts = add_parts(plant, product, config.workcell.X_WT)
    drivers = [arm.tool for arm in arms.values() if isinstance(arm.tool, Driver)]
    threads = add_threads(plant, scene_graph, product, parts, next(iter(drivers), None))
    press_fits = add_press_fits(plant, product, parts)
    kind = config.workcell.fixture
    work = fixture_work(config, product)
    fixture = add_fixture(kind, plant, scene_graph, workcell.base, config.jig, work)
    for part in parts:
        fixture.add_part(plant, part.body, part.part.mesh)
    if extend is not None:
        extend(plant, scene_graph)
    grippers = [arm.tool for arm in arms.values() if isinstance(arm.tool, Gripper)]
    contact = config.simulation.contact
    links = add_links(plant, scene_graph, contact, grippers, fixture, list(parts), threads)
    plant.Finalize()

    bearers = (workcell.base, workcell.plate)
    wiring = wire_fixture(builder, plant, scene_graph, fixture, bearers, links, prefix)
    builder.AddNamedSystem(f"{prefix}threads", threads)
    builder.AddNamedSystem(f"{prefix}press_fits", press_fits)
    press_fits.connect(builder, plant)
    force_plate = WrenchSensor(plant, workcell.plate_weld)
    ports = Ports()
    for arm in arms.values():
        ports.add(*arm.connect(builder, prefix))
    ports.add({}, {"force_plate": force_plate.connect(builder, f"{prefix}force_plate")})
    ports.add({}, add_part_poses(builder, f"{prefix}part_poses", plant, parts))
    for port in fixture.inputs():
        ports.inputs[f"jig.{port.get_name()}"] = port
    for port in fixture.outputs():
        ports.outputs[f"jig.{port.get_name()}"] = port
    ports.inputs["external_forces"] = wiring.forces.GetInputPort("external")
    jig_base = JigBase(config, plant, workcell.base, workcell.plate, wiring.sleeper)
    _check_names(builder)

    def reset(root: Context) -> None:
        threads.install(root)
        press_fits.install(root)
        links.install(root)
        jig_base.reset(root)
        fixture.install(root)

    return Cell(
        config=config,
        product=product,
        plant=plant,
        scene_graph=scene_graph,
        arms=arms,
        jig_base=jig_base,
        fixture=fixture,
        parts=replace(parts, sleeper=wiring.sleeper),
        threads=threads,
        press_fits=press_fits,
        links=links,
        sleeper=wiring.sleeper,
        force_plate=force_plate,
        cameras=cameras_of(plant, scene_graph, config.workcell.X_WJ, config.camera),
        ports=ports,
        monitor=Monitor(counter, reset, (fixture, threads, press_fits, links)),
    )


def _check_names(builder: DiagramBuilder, *planned: str) -> None:
    """Refuse two systems of one name, at which Drake would end the process in `Build`.

    Called before the cell adds its systems, with one that every cell has, and after; what has been
    added cannot be removed again.
    """
    names = [*(system.get_name() for system in builder.GetSystems()), *planned]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            f"Two systems of the builder would be named {', '.join(twice)}: give the cell a name "
            'of its own, add_cell(..., name="left_cell"), which becomes their prefix'
            f"{'.' if planned else ', in a new builder.'}"
        )


def plant_config(config: CellConfig) -> MultibodyPlantConfig:
    """Return how the plant is stepped and what contact it has."""
    return MultibodyPlantConfig(
        time_step=config.simulation.time_step,
        discrete_contact_approximation=config.simulation.contact_approximation,
        contact_model="hydroelastic_with_fallback",
    )
