"""A hand on a carriage over the fixture, whose base slides freely on the force plate.

The rig is the cell without its arms: the same gripper model, jig, force plate and parts. A carriage
with five driven joints carries the hand: three slides, a turn about the vertical and a tilt. It
replaces an arm with a prescribed path: its drives follow stiffly up to stated forces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import trimesh
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    WeldJoint,
)
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from cell.builder import plant_config
from cell.configuration.config import CellConfig
from cell.contact.links import ContactLinks
from cell.fixtures import add_fixture
from cell.fixtures.wiring import wire_fixture
from cell.link_policy import add_links
from cell.machines.drive import JointDrive
from cell.machines.gripper import Gripper, GripperDrive
from cell.machines.grippers import HAND_E
from cell.machines.jig_base import JigBase, fit_to_bag, stand_on
from cell.machines.sensors import WrenchSensor
from cell.machines.workcell import add_workcell
from cell.monitor import Monitor, StepCounter
from cell.paths import model_url, new_parser
from cell.products.product import Product
from cell.sleep import Sleep
from cell.workpieces.parts import add_parts
from cell.workpieces.work import fixture_work
from experiments.paper.rig.palm import LowPalm
from experiments.paper.rig.stage import Stage

# Drives of the carriage: stiffness, damping and largest effort; slides [N/m, N s/m, N], turn and
# tilt [N m/rad, N m s/rad, N m]. Stiffness and damping are those of the hand of the left arm at the
# jig, from its joint drives: 37 to 49 kN/m, 3.3 to 5.0 kN m/rad [D]; the efforts are [A].
SLIDE_DRIVE = (4.5e4, 1e3, 200.0)
TURN_DRIVE = (5e3, 60.0, 30.0)
LINK_MASS = 2.0  # Of each slide [kg] [A].
CARRIAGE_JOINTS = ("x", "y", "z", "turn", "tilt")


@dataclass(frozen=True)
class HandPose:
    """A pose of the hand that the carriage can take.

    Attributes:
        p_WT: (3,) position of the frame T between the tip pads [m].
        turn: About the vertical [rad]; at 0 the jaws close along x of W.
        tilt: 0 with the hand pointing down, pi/2 with it pointing along -y of the turned carriage
            and the recessed jaws above the tip pads [rad].
    """

    p_WT: np.ndarray
    turn: float
    tilt: float = 0.0

    @property
    def R_WT(self) -> RotationMatrix:
        """Orientation of the hand."""
        tilted = RotationMatrix.MakeXRotation(np.pi - self.tilt)
        return RotationMatrix.MakeZRotation(self.turn) @ tilted

    @property
    def X_WT(self) -> RigidTransform:
        """Pose of the frame between the tip pads."""
        return RigidTransform(self.R_WT, self.p_WT)

    @staticmethod
    def of(X_WT: RigidTransform) -> HandPose:
        """Return the hand pose for a frame whose closing direction is horizontal."""
        R = X_WT.rotation().matrix()
        turn = float(np.arctan2(R[1, 0], R[0, 0]))
        tilt = float(np.arctan2(R[2, 1], -R[2, 2]))
        return HandPose(X_WT.translation(), turn, tilt)


@dataclass(frozen=True)
class Rig(Stage):
    """Handles to a built rig; it owns everything that a simulation needs.

    Attributes:
        diagram: Drake's.
        drive: Targets of the carriage: x, y, z [m], turn, tilt [rad].
        carriage: Its model instance.
        hand_length: From the carriage to T [m].
        palm: What lowers the palm for the push; None if it is low already.
        sleeper: Locks part and base while they are at rest.
        links: Of contacts that stick.
        monitor: Of the diagram.
    """

    diagram: Diagram
    drive: JointDrive
    carriage: ModelInstanceIndex
    hand_length: float
    palm: LowPalm | None
    sleeper: Sleep
    links: ContactLinks
    monitor: Monitor

    def joints(self, pose: HandPose) -> np.ndarray:
        """Return the carriage's joint positions (5,) for a hand pose."""
        mount = pose.p_WT - pose.R_WT @ np.array([0.0, 0.0, self.hand_length])
        return np.array([*mount, pose.turn, pose.tilt])

    def set_up(
        self, root: Context, X_WJ: RigidTransform, X_WP: RigidTransform, q: np.ndarray
    ) -> None:
        """Set the initial state in a new Context, with the part on a stand.

        Args:
            root: Context of the diagram.
            X_WJ: Of the jig on the force plate.
            X_WP: Of the part, which is fixed to the stand until `let_part_go`.
            q: (5,) joint positions of the carriage.
        """
        self.monitor.initialize(root)
        if self.palm:
            self.palm.stay_up(root)
        context = self.plant.GetMyMutableContextFromRoot(root)
        self.jig_base.set_down(root, X_WJ)
        self.part.joint.SetPose(context, X_WP)
        self.part.joint.Lock(context)
        self.plant.SetPositions(context, self.carriage, q)
        self.drive.set_target(root, q, np.zeros(len(q)))

    def let_part_go(self, root: Context) -> None:
        """Remove the stand."""
        self.part.joint.Unlock(self.plant.GetMyMutableContextFromRoot(root))


def build_push_rig(
    config: CellConfig, product: Product, part: str, surface: trimesh.Trimesh | None = None
) -> Rig:
    """Build the rig for one part, with the fixture that the configuration names.

    Args:
        config: Of the cell; the base of the jig is free in any case.
        product: With the part.
        part: Name of the part.
        surface: That a fixture made for the part meets; None: as it is drawn.
    """
    config = config.with_changes({"workcell.jig_base_fixed": False})
    builder = DiagramBuilder()
    counter = builder.AddNamedSystem("steps", StepCounter(config.simulation.time_step))
    drive = builder.AddNamedSystem("carriage_drive", JointDrive(np.zeros(len(CARRIAGE_JOINTS))))
    jaws = builder.AddNamedSystem("gripper_drive", GripperDrive(HAND_E))
    plant, scene_graph = AddMultibodyPlant(plant_config(config), builder)
    workcell = add_workcell(plant, config, tray=None)
    fit_to_bag(plant, scene_graph, workcell.base, config.jig.bag)
    stand_on(plant, scene_graph, workcell.plate, workcell.base, config)
    alone = replace(product, parts={part: product.parts[part]}, joints=())
    (loose,) = add_parts(plant, alone, config.workcell.X_WT)
    kind = config.workcell.fixture
    work = fixture_work(config, alone, HAND_E)
    fixture = add_fixture(kind, plant, scene_graph, workcell.base, config.jig, work)
    fixture.add_part(plant, loose.body, loose.part.mesh if surface is None else surface)
    wrist, hand = _add_carriage(plant)
    gripper = Gripper.add(plant, hand, "gripper", HAND_E, jaws)
    palm = LowPalm.add(plant, scene_graph, hand, HAND_E, config.push.palm_height)
    contact = config.simulation.contact
    links = add_links(plant, scene_graph, contact, [gripper], fixture, [loose])
    plant.Finalize()
    bearers = (workcell.base, workcell.plate)
    sleeper = wire_fixture(builder, plant, scene_graph, fixture, bearers, links).sleeper
    jig_base = JigBase(config, plant, workcell.base, workcell.plate, sleeper)
    carriage = plant.GetModelInstanceByName("carriage")
    drive.connect(builder, plant, carriage)
    jaws.connect(builder, plant, hand)
    X_MountT = plant.GetFrameByName("tip", hand).GetFixedPoseInBodyFrame()

    def reset(root: Context) -> None:
        links.install(root)
        jig_base.reset(root)
        fixture.install(root)

    return Rig(
        config=config,
        plant=plant,
        scene_graph=scene_graph,
        diagram=builder.Build(),
        jig_base=jig_base,
        fixture=fixture,
        part=loose,
        drive=drive,
        carriage=carriage,
        gripper=gripper,
        hand_length=float(X_MountT.translation()[2]),
        palm=palm,
        wrist=WrenchSensor(plant, wrist),
        force_plate=WrenchSensor(plant, workcell.plate_weld),
        sleeper=sleeper,
        links=links,
        monitor=Monitor(counter, reset, (fixture, links)),
    )


def _add_carriage(plant: MultibodyPlant) -> tuple[WeldJoint, ModelInstanceIndex]:
    """Add the carriage with the hand; return the weld between them and the hand's instance."""
    instance = plant.AddModelInstance("carriage")
    axes = np.eye(3)
    link = plant.world_body()
    for k, name in enumerate(CARRIAGE_JOINTS):
        below = link
        size = 0.05
        inertia = SpatialInertia.SolidBoxWithMass(LINK_MASS, size, size, size)
        link = plant.AddRigidBody(f"carriage_{name}", instance, inertia)
        parent, child = below.body_frame(), link.body_frame()
        if k < 3:
            joint = plant.AddJoint(PrismaticJoint(name, parent, child, axes[k]))
        else:
            axis = axes[2] if name == "turn" else -axes[0]
            joint = plant.AddJoint(RevoluteJoint(name, parent, child, axis))
        stiffness, damping, limit = SLIDE_DRIVE if k < 3 else TURN_DRIVE
        actuator = plant.AddJointActuator(name, joint, limit)
        actuator.set_controller_gains(PdControllerGains(p=stiffness, d=damping))
    (hand,) = new_parser(plant).AddModelsFromUrl(model_url(HAND_E.sdf))
    down = RigidTransform(RotationMatrix.MakeXRotation(np.pi), np.zeros(3))
    flange = plant.AddFrame(FixedOffsetFrame("flange", link.body_frame(), down))
    wrist = plant.WeldFrames(flange, plant.GetFrameByName("mount", hand))
    plant.set_gravity_enabled(instance, False)
    plant.set_gravity_enabled(hand, False)
    return wrist, hand
