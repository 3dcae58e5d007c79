"""A hand on a carriage over the soft jig, which slides freely on the force plate.

The rig is the cell without its arms: the same gripper model, the same jig, force plate and parts.
A carriage with five driven joints carries the hand: three slides, a turn about the vertical and a
tilt. It stands in for an arm whose path is given: its drives follow stiffly up to stated forces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import trimesh
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Convex,
    Cylinder,
    GeometryId,
    ProximityProperties,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    WeldJoint,
)
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from cell.builder import JAW_REST, add_workcell, plant_config
from cell.configuration.config import CellConfig
from cell.fixtures.soft_jig import SoftJig, SurfaceSamples
from cell.machines.arm import Drive
from cell.machines.jig_base import JigBase
from cell.machines.sensors import WrenchSensor
from cell.machines.tools import connect_gripper, set_gripper_gains
from cell.paths import model_url, new_parser
from cell.products.product import Product
from cell.workpieces.parts import add_parts
from experiments.paper.rig.stage import Stage

# Drives of the carriage: stiffness, damping and largest effort; slides [N/m, N s/m, N], turn and
# tilt [N m/rad, N m s/rad, N m]. Stiffness and damping are those of the left arm's hand at the jig,
# from the drives of its joints: 37 to 49 kN/m, 3.3 to 5.0 kN m/rad [D]; the efforts are [A].
SLIDE_DRIVE = (4.5e4, 1e3, 200.0)
TURN_DRIVE = (5e3, 60.0, 30.0)
LINK_MASS = 2.0  # Of each slide [kg] [A].
CARRIAGE_JOINTS = ("x", "y", "z", "turn", "tilt")

RIGID_FRICTION = 0.3  # Metal on metal [A].


@dataclass(frozen=True)
class HandPose:
    """Where the carriage puts the hand.

    Attributes:
        p_WT: (3,) position of the frame between the tip pads, T [m].
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
    """Handles to a built rig; holding it keeps everything alive that a simulation needs.

    Attributes:
        diagram: Plain Drake.
        drive: Targets of the carriage: x, y, z [m], turn, tilt [rad].
        hand_length: From the carriage to T [m].
    """

    diagram: Diagram
    drive: Drive
    hand_length: float

    def joints(self, pose: HandPose) -> np.ndarray:
        """Return the carriage's joint positions (5,) for a hand pose."""
        mount = pose.p_WT - pose.R_WT @ np.array([0.0, 0.0, self.hand_length])
        return np.array([*mount, pose.turn, pose.tilt])

    def reset(
        self, root: Context, X_WJ: RigidTransform, X_WP: RigidTransform, q: np.ndarray
    ) -> None:
        """Put a new Context into the initial state: bag inflated, part held by a stand.

        Args:
            root: Context of the diagram.
            X_WJ: Where the jig stands on the force plate.
            X_WP: Where the stand holds the part (it keeps the pose until `let_part_go`).
            q: (5,) where the carriage is.
        """
        context = self.plant.GetMyMutableContextFromRoot(root)
        self.jig_base.reset(root, X_WJ)
        self.part.joint.SetPose(context, X_WP)
        self.part.joint.Lock(context)
        self.plant.SetPositions(context, self.drive.instance, q)
        self.drive.set_target(root, q, np.zeros(len(q)))
        self.part.sleep_filter = None  # A new Context knows of no filter.
        if self.soft_jig is not None:
            for body in self.soft_jig.pressing:
                self.soft_jig.release(body)
            self.soft_jig.inflate(root)

    def let_part_go(self, root: Context) -> None:
        """Take the stand away."""
        self.part.joint.Unlock(self.plant.GetMyMutableContextFromRoot(root))


def build_push_rig(config: CellConfig, product: Product, part: str, bed: str = "soft") -> Rig:
    """Build the rig for one part.

    Args:
        config: Of the cell; the jig's base is free whatever it says.
        product: Where the part is described.
        part: Its name.
        bed: "soft" for the soft jig, "rigid" for a flat block as high as the inflated bag.
    """
    config = replace(config, workcell=replace(config.workcell, jig_base_fixed=False))
    product = replace(product, parts={part: product.parts[part]}, tray=None)
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(plant_config(config), builder)
    plate_weld, base = add_workcell(plant, config, product)
    jig_base = JigBase.prepare(plant, scene_graph, plate_weld, base, config)
    parts = add_parts(plant, scene_graph, product, config.workcell.X_WT)
    soft_jig = None
    if bed == "soft":
        soft_jig = SoftJig.add(plant, scene_graph, base, config.jig)
    else:
        _add_block(plant, base, config)
        _add_details(plant, parts[part].body, product.parts[part].mesh)
    wrist, hand = _add_carriage(plant)
    plant.Finalize()
    gripper = connect_gripper(builder, plant, hand, JAW_REST)
    instance = plant.GetModelInstanceByName("carriage")
    drive = Drive.connect(builder, plant, instance, np.zeros(len(CARRIAGE_JOINTS)))
    X_MountT = plant.GetFrameByName("tip", hand).GetFixedPoseInBodyFrame()
    return Rig(
        config=config,
        plant=plant,
        scene_graph=scene_graph,
        diagram=builder.Build(),
        jig_base=jig_base,
        soft_jig=soft_jig,
        part=parts[part],
        samples=SurfaceSamples.of(part, product.parts[part].mesh),
        drive=drive,
        gripper=gripper,
        hand_length=float(X_MountT.translation()[2]),
        wrist=WrenchSensor(plant, wrist),
        force_plate=WrenchSensor(plant, plate_weld),
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
    (hand,) = new_parser(plant).AddModelsFromUrl(model_url("hand_e"))
    set_gripper_gains(plant, hand)
    down = RigidTransform(RotationMatrix.MakeXRotation(np.pi), np.zeros(3))
    flange = plant.AddFrame(FixedOffsetFrame("flange", link.body_frame(), down))
    wrist = plant.WeldFrames(flange, plant.GetFrameByName("mount", hand))
    plant.set_gravity_enabled(instance, False)
    plant.set_gravity_enabled(hand, False)
    return wrist, hand


def _add_block(plant: MultibodyPlant, jig_base: RigidBody, config: CellConfig) -> GeometryId:
    """Put a flat block where the bag would be."""
    bag = config.jig.bag
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(0.03, 1e9, properties)
    _add_metal(properties)
    block = Cylinder(bag.aperture_radius, bag.cap_height)
    X_JB = RigidTransform([0.0, 0.0, bag.cap_height / 2])
    plant.RegisterVisualGeometry(jig_base, X_JB, block, "block", np.array([0.6, 0.6, 0.62, 1.0]))
    return plant.RegisterCollisionGeometry(jig_base, X_JB, block, "block", properties)


def _add_details(plant: MultibodyPlant, body: RigidBody, mesh: trimesh.Trimesh) -> None:
    """Let what the bed-contact pieces leave out, the motor's pins, touch a rigid plate.

    Each connected piece of the mesh below its main face counts, as its convex hull.
    """
    for k, piece in enumerate(_protrusions(mesh)):
        properties = ProximityProperties()
        AddRigidHydroelasticProperties(0.005, properties)
        _add_metal(properties)
        hull = Convex(points=piece.T, label=f"pin_{k}")
        plant.RegisterCollisionGeometry(body, RigidTransform(), hull, f"pin_{k}", properties)


def _protrusions(mesh: trimesh.Trimesh) -> list[np.ndarray]:
    """Return the points (n, 3) of each piece that stands out below the largest rear face (-z)."""
    down = mesh.face_normals[:, 2] < -0.99
    heights = mesh.triangles_center[:, 2]
    levels, inverse = np.unique(np.round(heights[down], 4), return_inverse=True)
    area = np.bincount(inverse, weights=mesh.area_faces[down])
    rear = levels[np.argmax(area)]
    below = np.flatnonzero(heights < rear - 1e-4)
    pieces = trimesh.graph.connected_components(mesh.face_adjacency, nodes=below, min_len=2)
    return [mesh.vertices[np.unique(mesh.faces[piece])] for piece in pieces]


def _add_metal(properties: ProximityProperties) -> None:
    friction = CoulombFriction(RIGID_FRICTION, RIGID_FRICTION)
    AddContactMaterial(dissipation=10.0, friction=friction, properties=properties)
