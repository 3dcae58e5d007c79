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
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import PdControllerGains, PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from cell.machines.drive import JointDrive
from cell.monitor import Monitor, StepCounter
from cell.products.joints import Press
from cell.workpieces.press_fit import INSTANCE, FitState, add_press_fit
from cell.workpieces.press_fits import PressFits

DEPTH, FORCE = 8e-3, 30.0  # Of the fit [m], [N].
RADIUS, FLANGE, THICK = 8e-3, 12e-3, 6e-3
FRICTION = CoulombFriction(0.3, 0.3)


@dataclass
class PressRig:
    """The diagram, its simulator and the handles a test needs.

    Product frame A and world coincide: the mouth of the hole is at the origin, the block below.
    The bush begins ``above`` its seat; the ram is on its flange.
    """

    time_step: float = 1e-3
    above: float = DEPTH + 1e-3
    force: float = FORCE

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
        plant = self.plant
        block = plant.AddRigidBody("block", SpatialInertia.SolidBoxWithMass(0.1, 0.04, 0.04, 0.04))
        plant.WeldFrames(plant.world_frame(), block.body_frame())
        rim = ProximityProperties()
        AddContactMaterial(friction=FRICTION, properties=rim)
        AddRigidHydroelasticProperties(5e-3, rim)
        for x in (-15e-3, 15e-3):  # What is left of the block's face beside the hole.
            plant.RegisterCollisionGeometry(
                block, RigidTransform([x, 0.0, -0.01]), Box(0.01, 0.04, 0.02), f"face_{x:g}", rim
            )
        self.bush = plant.AddRigidBody(
            "bush", SpatialInertia.SolidCylinderWithMass(0.01, RADIUS, 0.014, [0.0, 0.0, 1.0])
        )
        metal = ProximityProperties()
        AddContactMaterial(dissipation=500.0, friction=FRICTION, properties=metal)
        AddCompliantHydroelasticProperties(5e-3, 1e9, metal)
        X = RigidTransform([0.0, 0.0, THICK / 2])
        plant.RegisterCollisionGeometry(self.bush, X, Cylinder(FLANGE, THICK), "flange", metal)
        ram = plant.AddModelInstance("ram")
        inertia = SpatialInertia.SolidBoxWithMass(2.0, 0.02, 0.02, 0.02)
        self.ram = plant.AddRigidBody("ram", ram, inertia)
        joint = plant.AddJoint(
            PrismaticJoint("ram", plant.world_frame(), self.ram.body_frame(), np.array([0, 0, 1.0]))
        )
        plant.AddJointActuator("ram", joint).set_controller_gains(PdControllerGains(p=2e4, d=400.0))
        plant.RegisterCollisionGeometry(
            self.ram, RigidTransform([0, 0, 0.01]), Box(0.02, 0.02, 0.02), "ram", rim
        )
        plant.set_gravity_enabled(ram, False)
        plant.AddModelInstance(INSTANCE)
        press = Press("bush", "block", np.zeros(3), DEPTH, self.force)
        X_AP = RigidTransform()
        fit = add_press_fit(
            plant, "fit", press, (self.bush, X_AP), (block, X_AP), np.array([0, 0, 1.0])
        )
        plant.Finalize()
        self.joint = joint
        self.drive.connect(builder, plant, ram)
        self.fits = builder.AddNamedSystem("press_fits", PressFits([fit]))
        self.fits.connect(builder, plant)
        self.fit = fit
        self.simulator = Simulator(builder.Build())
        self.simulator.set_monitor(Monitor(counter, self.fits.install, [self.fits]))
        self.root = self.simulator.get_mutable_context()
        self.context = plant.GetMyMutableContextFromRoot(self.root)
        plant.SetFreeBodyPose(self.context, self.bush, RigidTransform([0.0, 0.0, self.above]))
        joint.set_translation(self.context, self.above + THICK)
        self.height = self.above + THICK
        self.move_ram(0.0)
        self.simulator.Initialize()

    def move_ram(self, speed: float) -> None:
        """Command where the ram shall be after the next step, at a speed [m/s]."""
        self.height += speed * self.time_step
        self.drive.set_target(self.root, np.array([self.height]), np.array([speed]))

    def step(self, speed: float = 0.0) -> None:
        """Advance by one step with the ram at a speed [m/s]."""
        self.move_ram(speed)
        self.simulator.AdvanceTo(self.root.get_time() + self.time_step)

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
