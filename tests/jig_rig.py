"""A stand-in motor on a force-limited carriage above a fixed soft jig, for the jig's tests."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Convex,
    Cylinder,
    InMemoryMesh,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from trimesh.exchange.obj import export_obj

from cell.fixtures.soft_jig import JigParameters, SoftJig
from cell.fixtures.soft_jig.memory import JigMemory
from cell.fixtures.wiring import wire_fixture
from cell.forces import applied_force
from cell.monitor import Monitor, StepCounter

# Motor of the product, in its own frame: gearbox front face at z = 0, +z along the shaft [M].
CAN_RADIUS, CAN_REAR, GEARBOX_RADIUS, GEARBOX_REAR = 0.0174, -0.0534, 0.0184, -0.024
FACETS = 24
MASS = 0.195
CENTER_OF_MASS = np.array([0.0, 0.0, -0.0257])


def can_mesh() -> trimesh.Trimesh:
    """Return the motor can as a prism with the mean radius of the round can."""
    angle = np.arange(FACETS) * 2 * np.pi / FACETS
    radius = CAN_RADIUS * 2 / (1 + np.cos(np.pi / FACETS))
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    ends = [np.column_stack([ring, np.full(FACETS, z)]) for z in (CAN_REAR, GEARBOX_REAR)]
    return trimesh.convex.convex_hull(np.concatenate(ends))


def motor_mesh() -> trimesh.Trimesh:
    """Return the stand-in's surface: can and gearbox, no terminals."""
    gearbox = trimesh.creation.cylinder(radius=GEARBOX_RADIUS, height=-GEARBOX_REAR, sections=48)
    gearbox.apply_translation([0, 0, GEARBOX_REAR / 2])
    whole = trimesh.util.concatenate([can_mesh(), gearbox])
    assert isinstance(whole, trimesh.Trimesh)
    return whole


def _rigid() -> ProximityProperties:
    properties = ProximityProperties()
    AddRigidHydroelasticProperties(0.01, properties)
    AddContactMaterial(friction=CoulombFriction(0.9, 0.9), properties=properties)
    return properties


@dataclass
class Rig:
    """The diagram, its simulator and the handles a test needs; steps 1 ms at a time.

    Attributes:
        time_step: [s].
        press_force: Limit of the carriage's drive [N].
        params: Of the jig.
    """

    time_step: float = 1e-3
    press_force: float = 20.0
    params: JigParameters = field(default_factory=JigParameters)

    def __post_init__(self) -> None:
        builder = DiagramBuilder()
        counter = builder.AddNamedSystem("steps", StepCounter(self.time_step))
        config = MultibodyPlantConfig(
            time_step=self.time_step,
            contact_model="hydroelastic_with_fallback",
            discrete_contact_approximation="lagged",
        )
        self.plant, self.scene_graph = AddMultibodyPlant(config, builder)
        base = self.plant.AddRigidBody("base", SpatialInertia.SolidBoxWithMass(1.5, 0.2, 0.2, 0.02))
        self.plant.WeldFrames(
            self.plant.world_frame(), base.body_frame(), RigidTransform([0, 0.15, 0.2])
        )
        self.jig = SoftJig(self.plant, self.scene_graph, base, self.params)
        self.motor = self._add_motor()
        self._add_carriage()
        self.plant.Finalize()
        self.forces = wire_fixture(builder, self.plant, self.scene_graph, self.jig, [base]).forces
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.simulator.set_monitor(Monitor(counter, self.jig.install, [self.jig]))
        self.context = self.simulator.get_mutable_context()
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        self.jig.receive(self.context, self.motor, motor_mesh())
        self.start_height = 0.2 + self.params.bag.cap_height - CAN_REAR + 0.5e-3
        self.command(self.start_height)
        X_WM = RigidTransform([0, 0.15, self.start_height])
        self.plant.SetFreeBodyPose(self.plant_context, self.motor, X_WM)
        self.slide.set_translation(self.plant_context, self.start_height)
        self.simulator.Initialize()

    def _add_motor(self) -> RigidBody:
        unit = UnitInertia(6.2e-5 / MASS, 6.2e-5 / MASS, 3.2e-5 / MASS)
        inertia = SpatialInertia(MASS, CENTER_OF_MASS, unit.ShiftFromCenterOfMass(-CENTER_OF_MASS))
        motor = self.plant.AddRigidBody("motor", inertia)
        text = export_obj(can_mesh(), digits=12)
        can = Convex(InMemoryMesh(mesh_file=MemoryFile(text, ".obj", "can")))
        self.plant.RegisterCollisionGeometry(motor, RigidTransform(), can, "bed_can", _rigid())
        self.plant.RegisterVisualGeometry(
            motor, RigidTransform(), can, "can", np.array([0.3, 0.3, 0.35, 1])
        )
        gearbox = Cylinder(GEARBOX_RADIUS, -GEARBOX_REAR)
        X_MG = RigidTransform([0, 0, GEARBOX_REAR / 2])
        self.plant.RegisterCollisionGeometry(motor, X_MG, gearbox, "gearbox", _rigid())
        self.plant.RegisterVisualGeometry(
            motor, X_MG, gearbox, "gearbox", np.array([0.6, 0.6, 0.6, 1])
        )
        return motor

    def _add_carriage(self) -> None:
        instance = self.plant.AddModelInstance("carriage")
        inertia = SpatialInertia.SolidBoxWithMass(5.0, 0.1, 0.1, 0.1)
        carriage = self.plant.AddRigidBody("carriage", instance, inertia)
        offset = RigidTransform([0, 0.15, 0])
        frame = self.plant.AddFrame(
            FixedOffsetFrame("slide_base", self.plant.world_frame(), offset)
        )
        self.slide = self.plant.AddJoint(
            PrismaticJoint("slide", frame, carriage.body_frame(), [0, 0, 1])
        )
        actuator = self.plant.AddJointActuator("slide", self.slide, self.press_force)
        actuator.set_controller_gains(PdControllerGains(p=1e5, d=2e3))
        self.plant.set_gravity_enabled(instance, False)
        self.carriage = instance
        self.grip = self.plant.AddWeldConstraint(
            carriage, RigidTransform(), self.motor, RigidTransform()
        )

    def command(self, height: float, speed: float = 0.0) -> None:
        """Send the carriage to a height of the motor's origin over W [m]."""
        port = self.plant.get_desired_state_input_port(self.carriage)
        port.FixValue(self.plant_context, [height, speed])

    def step(self, count: int = 1) -> None:
        """Advance the simulation."""
        for _ in range(count):
            self.simulator.AdvanceTo(self.context.get_time() + self.time_step)

    def press(self, speed: float = 0.02, duration: float = 1.5) -> None:
        """Lower the carriage until its drive is at its limit and the motor has come to rest."""
        for k in range(round(duration / self.time_step)):
            self.command(self.start_height - speed * k * self.time_step, -speed)
            self.step()

    def jam(self) -> None:
        """Evacuate until the bed is frozen."""
        self.jig.evacuate(self.context)
        while not self.jig.fixed(self.context):
            self.step()

    def let_go(self) -> None:
        """Open the grip; the carriage leaves."""
        self.plant.SetConstraintActiveStatus(self.plant_context, self.grip, False)
        self.command(self.start_height + 0.1)

    @property
    def X_JM(self) -> RigidTransform:
        """Pose of the motor in the jig frame."""
        X_WJ = self.jig.pose(self.plant_context)
        return X_WJ.InvertAndCompose(self.plant.EvalBodyPoseInWorld(self.plant_context, self.motor))

    @property
    def depth(self) -> float:
        """How far the can's end is below the apex of the inflated bag [m]."""
        return self.params.bag.cap_height - (self.X_JM.translation()[2] + CAN_REAR)

    @property
    def tilt(self) -> float:
        """Angle of the motor's axis to the vertical [rad]."""
        return float(np.arccos(np.clip(self.X_JM.rotation().matrix()[2, 2], -1, 1)))

    @property
    def velocity(self) -> NDArray[np.float64]:
        """Linear velocity of the motor's origin in W [m/s]."""
        V_WM = self.plant.EvalBodySpatialVelocityInWorld(self.plant_context, self.motor)
        return V_WM.translational()

    def pull(
        self,
        force: tuple[float, float, float],
        torque: tuple[float, float, float],
        p_MQ: tuple[float, float, float],
    ) -> None:
        """Load the motor at a point of it, in world axes, from the next step on."""
        F_W = SpatialForce(np.array(torque), np.array(force))
        load = applied_force(self.motor.index(), np.array(p_MQ), F_W)
        self.forces.fix(self.context, "external", [load])

    def unload(self) -> None:
        """End the load."""
        self.forces.fix(self.context, "external", [])

    @property
    def memory(self) -> JigMemory:
        """What the jig remembers, as it is now: bed, state, pressure, forces."""
        return self.jig.memory(self.context)
