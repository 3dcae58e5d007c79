"""A flanged bush over the blind hole of a block that stands fast, and a ram that presses it in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    Cylinder,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import PdControllerGains, PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from cell.forces import applied_force
from cell.machines.drive import JointDrive
from cell.monitor import Monitor, StepCounter
from cell.products.joints import Press
from cell.workpieces.press_fit import INSTANCE, FitState, add_press_fit
from cell.workpieces.press_fits import PressFits

DEPTH, FORCE = 8e-3, 30.0  # Of the fit [m], [N].
RADIUS, FLANGE, THICK = 8e-3, 12e-3, 6e-3
MASS = 3e-3  # Of the bush [kg].
FRICTION = CoulombFriction(0.3, 0.3)
UP = np.array([0.0, 0.0, 1.0])


@dataclass
class PressRig:
    """The diagram, its simulator and the handles a test needs.

    Product frame A and world coincide: the mouth of the hole is at the origin, the block below.
    The bush begins ``above`` its seat, the ram on its flange.
    """

    time_step: float = 1e-3
    above: float = DEPTH + 1e-3

    def __post_init__(self) -> None:
        builder = DiagramBuilder()
        counter = builder.AddNamedSystem("steps", StepCounter(self.time_step))
        self.drive = builder.AddNamedSystem("ram", JointDrive(np.zeros(1)))
        config = MultibodyPlantConfig(
            time_step=self.time_step,
            contact_model="hydroelastic_with_fallback",
            discrete_contact_approximation="lagged",
        )
        self.plant, _ = AddMultibodyPlant(config, builder)
        self._add_bodies()
        self.plant.set_gravity_enabled(self.plant.AddModelInstance(INSTANCE), False)
        here = RigidTransform()
        press = Press("bush", "block", np.zeros(3), DEPTH, FORCE)
        self.fit = add_press_fit(
            self.plant, "fit", press, (self.bush, here), (self.block, here), UP
        )
        self.plant.Finalize()
        self.drive.connect(builder, self.plant, self.plant.GetModelInstanceByName("ram"))
        self.fits = builder.AddNamedSystem("press_fits", PressFits([self.fit]))
        self.fits.connect(builder, self.plant)
        self.simulator = Simulator(builder.Build())
        self.simulator.set_monitor(Monitor(counter, self.fits.install, [self.fits]))
        self.counter = counter
        self.root = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)
        self.put_bush(RigidTransform([0.0, 0.0, self.above]))
        self.height = self.above + THICK
        self.ram.set_translation(self.context, self.height)
        self._command(0.0)
        self.simulator.Initialize()

    def _add_bodies(self) -> None:
        """Add the block with what is left of its face beside the hole, the bush, and the ram."""
        plant = self.plant
        hard, metal = ProximityProperties(), ProximityProperties()
        AddContactMaterial(friction=FRICTION, properties=hard)
        AddRigidHydroelasticProperties(5e-3, hard)
        AddContactMaterial(dissipation=500.0, friction=FRICTION, properties=metal)
        AddCompliantHydroelasticProperties(5e-3, 1e9, metal)
        box = SpatialInertia.SolidBoxWithMass
        self.block = plant.AddRigidBody("block", box(0.1, 0.04, 0.04, 0.04))
        plant.WeldFrames(plant.world_frame(), self.block.body_frame())
        for name, x in (("left", -15e-3), ("right", 15e-3)):
            face = Box(0.01, 0.04, 0.02)
            plant.RegisterCollisionGeometry(
                self.block, RigidTransform([x, 0.0, -0.01]), face, name, hard
            )
        inertia = SpatialInertia.SolidCylinderWithMass(MASS, RADIUS, 0.014, UP)
        self.bush = plant.AddRigidBody("bush", inertia)
        X_BushFlange, flange = RigidTransform([0.0, 0.0, THICK / 2]), Cylinder(FLANGE, THICK)
        plant.RegisterCollisionGeometry(self.bush, X_BushFlange, flange, "flange", metal)
        instance = plant.AddModelInstance("ram")
        body = plant.AddRigidBody("ram", instance, box(2.0, 0.02, 0.02, 0.02))
        self.ram = plant.AddJoint(PrismaticJoint("ram", plant.world_frame(), body.body_frame(), UP))
        actuator = plant.AddJointActuator("ram", self.ram)
        actuator.set_controller_gains(PdControllerGains(p=2e4, d=400.0))
        face = RigidTransform([0.0, 0.0, 0.01]), Box(0.02, 0.02, 0.02)
        plant.RegisterCollisionGeometry(body, *face, "ram", hard)
        plant.set_gravity_enabled(instance, False)

    def put_bush(self, X_WBush: RigidTransform) -> None:
        """Put the bush somewhere."""
        self.plant.SetFreeBodyPose(self.context, self.bush, X_WBush)

    def pull_bush(self, force: float) -> None:
        """Pull the bush up with a force from now on [N]."""
        port = self.plant.get_applied_spatial_force_input_port()
        pull = SpatialForce(np.zeros(3), force * UP)
        port.FixValue(self.context, [applied_force(self.bush.index(), np.zeros(3), pull)])

    def step(self, speed: float = 0.0, count: int = 1) -> None:
        """Advance by some steps with the ram at a speed, negative down [m/s]."""
        for _ in range(count):
            self.height += speed * self.time_step
            self._command(speed)
            self.simulator.AdvanceTo(self.root.get_time() + self.time_step)

    def _command(self, speed: float) -> None:
        self.drive.set_target(self.root, np.array([self.height]), np.array([speed]))

    @property
    def depth(self) -> float:
        """Of the bush in the hole [m]."""
        return self.fit.depth(self.context)

    @property
    def state(self) -> FitState:
        """Of the fit."""
        return self.fits.grips(self.root)[0].state

    @property
    def ram_force(self) -> float:
        """With which the ram pushes down [N]."""
        forces = self.plant.get_net_actuation_output_port().Eval(self.context)
        return -float(forces[0])
