"""A bolt at a tapped hole, a free plate under its head, and a screwdriver on a carriage above."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import PdControllerGains, PrismaticJoint, RigidBody, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from cell import CellConfig, load_product
from cell.machines.drive import JointDrive
from cell.machines.driver import Driver, DriverDrive
from cell.monitor import Monitor, StepCounter
from cell.paths import model_url, new_parser
from cell.products.joints import BIT_SEAT
from cell.products.product import Product
from cell.workpieces.bit_end import BitEnd
from cell.workpieces.thread import add_thread, set_head_friction
from cell.workpieces.threads import Threads

BOLT = "bolt_1"
BIT_TIP = 0.28  # Of the bit's end from the tool's mount [m].
FEED_GAIN, FEED_LIMIT = 0.02, 0.02  # Of the carriage that keeps the thrust [m/s/N], [m/s].


@dataclass
class ThreadRig:
    """The diagram, its simulator and the handles a test needs.

    The motor is welded to the world with A = W; the bolt stands ``thread_depth`` above its seat.
    """

    time_step: float = 1e-3
    product: Product = field(default_factory=lambda: load_product("motor_unit"))

    def __post_init__(self) -> None:
        builder = DiagramBuilder()
        counter = builder.AddNamedSystem("steps", StepCounter(self.time_step))
        self.feed = builder.AddNamedSystem("feed", JointDrive(np.zeros(3)))
        drive = builder.AddNamedSystem("driver", DriverDrive())
        config = MultibodyPlantConfig(
            time_step=self.time_step,
            contact_model="hydroelastic_with_fallback",
            discrete_contact_approximation="lagged",
        )
        self.config = CellConfig().driver
        self.screw = self.product.screws[BOLT]
        self.plant, scene_graph = AddMultibodyPlant(config, builder)
        self.motor, self.plate, self.bolt = (
            self._add(name) for name in (self.screw.into, self.screw.clamps, BOLT)
        )
        self.plant.WeldFrames(self.plant.world_frame(), self.motor.body_frame())
        (tool,) = new_parser(self.plant).AddModelsFromUrl(model_url("screwdriver"))
        self.driver = Driver.add(self.plant, tool, "spindle", drive)
        carriage = self._add_carriage()
        X_CM = RigidTransform(RotationMatrix.MakeXRotation(np.pi), np.zeros(3))
        mount = self.plant.GetFrameByName("mount", tool)
        self.plant.WeldFrames(carriage.body_frame(), mount, X_CM)
        for instance in (self.carriage, tool):
            self.plant.set_gravity_enabled(instance, False)
        self.plant.AddModelInstance("threads")
        X_AH = self.product.parts[BOLT].X_AP
        self.bit = self.driver.bit_frame
        set_head_friction(self.plant, scene_graph, self.screw, self.bolt, self.plate)
        head_height = float(self.product.parts[BOLT].mesh.bounds[1][2])
        self.thread = add_thread(
            self.plant, scene_graph, self.screw, self.bolt, self.motor, X_AH, self.bit, head_height
        )
        bit_end = BitEnd.add(self.plant, scene_graph, self.bit)
        self.plant.Finalize()
        self.feed.connect(builder, self.plant, self.carriage)
        drive.connect(builder, self.plant, tool)
        threads = Threads({BOLT: self.thread}, self.driver, bit_end)
        self.threads = builder.AddNamedSystem("threads", threads)
        self.simulator = Simulator(builder.Build())
        self.simulator.set_monitor(Monitor(counter, self.threads.install, [self.threads]))
        self.root = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)
        X_WBolt = X_AH @ RigidTransform([0.0, 0.0, self.screw.thread_depth])
        self.plant.SetFreeBodyPose(self.context, self.bolt, X_WBolt)
        self.seated_bit = X_WBolt.translation() + [0.0, 0.0, BIT_SEAT]
        self.put_bit(self.seated_bit + [0.0, 0.0, 0.02])
        self.simulator.Initialize()

    def _add(self, part: str) -> RigidBody:
        model = self.product.parts[part].model
        assert model is not None
        (instance,) = new_parser(self.plant).AddModelsFromUrl(model_url(model))
        return self.plant.get_body(self.plant.GetBodyIndices(instance)[0])

    def _add_carriage(self) -> RigidBody:
        """Add three slides in a row, with stiff drives; the last one carries the tool."""
        plant = self.plant
        self.carriage = plant.AddModelInstance("carriage")
        body = plant.world_body()
        for name, axis in zip("xyz", np.eye(3), strict=True):
            inertia = SpatialInertia.SolidBoxWithMass(2.0, 0.1, 0.1, 0.1)
            slide = plant.AddRigidBody(f"slide_{name}", self.carriage, inertia)
            joint = PrismaticJoint(f"joint_{name}", body.body_frame(), slide.body_frame(), axis)
            actuator = plant.AddJointActuator(f"joint_{name}", plant.AddJoint(joint))
            actuator.set_controller_gains(PdControllerGains(p=1e5, d=2e3))
            body = slide
        return body

    def put_bit(self, p_WE: np.ndarray) -> None:
        """Set the bit's end to a point of W (3,) [m] at once, at rest."""
        self.p_WE = np.array(p_WE)
        self.plant.SetPositions(self.context, self.carriage, self.p_WE + [0.0, 0.0, BIT_TIP])
        self.plant.SetVelocities(self.context, self.carriage, np.zeros(3))
        self._command(0.0)

    def move_bit(self, rate: float) -> None:
        """Send the bit up for one step [m/s]."""
        self.p_WE[2] += rate * self.time_step
        self._command(rate)

    def _command(self, rate: float) -> None:
        target = self.p_WE + [0.0, 0.0, BIT_TIP]
        self.feed.set_target(self.root, target, np.array([0.0, 0.0, rate]))

    def keep_thrust(self) -> None:
        """Move the carriage so that the bit holder's spring pushes as configured."""
        error = self.config.push_force - self.driver.push(self.context)
        self.move_bit(-float(np.clip(FEED_GAIN * error, -FEED_LIMIT, FEED_LIMIT)))

    def step(self, count: int = 1) -> None:
        """Advance the simulation."""
        for _ in range(count):
            self.simulator.AdvanceTo(self.root.get_time() + self.time_step)

    @property
    def height(self) -> float:
        """Height of the bolt above its seat [m]."""
        return float(self.thread.X_HF(self.context).translation()[2])
