"""Screw threads: a bolt that is driven into a tapped hole.

What is modelled instead of simulated: the flanks of the thread and those of the bit. A *follower*
body rides on a ``ScrewJoint`` of the threaded part (axis along the hole, lead = pitch). It is
locked until the thread *catches*: then three ball constraints tie the bolt to it, and the bolt
advances one pitch per turn and carries axial force through the joint, whose reaction is the clamp
force.
Three more ball constraints tie the bolt to the bit while it is engaged. Both ties are gated: the
measured axial, lateral, tilt and phase errors must be small first, so nothing is pulled into place.
A bit that is not over the drive of a bolt meets its head: see `cell.workpieces.bit_end`.

When they close and open is decided in `cell.workpieces.threads`.

Head friction, seating, the clamped stack and the reaction of both arms are plain contact. Thread
friction is lumped into the head's friction coefficient, computed from the nut factor K.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    RoleAssign,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    MultibodyConstraintId,
    RigidBody,
    ScrewJoint,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.framework import Context

from cell.errors import BadPart
from cell.products.joints import Screw, head_friction

# Ball constraints must sit at about the bolt's radius of gyration: there they are stiffest
# (measured in Drake: 3.7e6 N/m at 3 mm against 4e5 at 10 mm for a 1.2 g bolt at 1 ms) [M].
TIE_RADIUS = 3e-3
TIE_ANGLES = np.deg2rad([0.0, 120.0, 240.0])
# Follower: light, but with enough axial inertia that locking it does not jerk the bolt [M].
FOLLOWER_MASS = 1e-3
FOLLOWER_INERTIA = 1e-6
# Inertia added to an engaged bolt: below it 0.6 N m is lost to constraint regularisation [M].
ENGAGED_MASS_FACTOR = 8.0
ENGAGED_INERTIA_FACTOR = 100.0


@dataclass(frozen=True)
class Gate:
    """Largest errors at which a tie may close.

    Attributes:
        axial: Along the axis [m].
        lateral: Between the axes [m].
        tilt: Between the axes [rad].
        angle: About the axis [rad].
    """

    axial: float
    lateral: float
    tilt: float
    angle: float


# The bit has 0.05 mm play in a 2.5 mm socket whose edge is chamfered by about 0.3 mm [A].
BIT_GATE = Gate(axial=3e-4, lateral=4e-4, tilt=np.deg2rad(5.0), angle=np.deg2rad(3.0))
# Half the diametral clearance of a bolt in its 3.4 mm hole is 0.2 mm; the plate adds its own
# 0.075 mm. At 15 um of axial error a thread that turns at 30 rad/s is met within six steps.
THREAD_GATE = Gate(axial=1.5e-5, lateral=4e-4, tilt=np.deg2rad(5.0), angle=np.pi)


@dataclass(frozen=True)
class Misfit:
    """Errors between two frames that should meet: axial, lateral [m], tilt, angle [rad]."""

    axial: float
    lateral: float
    tilt: float
    angle: float

    @staticmethod
    def between(X_AB: RigidTransform) -> Misfit:
        """Measure the pose of B in A against identity, with z as the axis."""
        p_AB, R_AB = X_AB.translation(), X_AB.rotation().matrix()
        return Misfit(
            axial=float(p_AB[2]),
            lateral=float(np.hypot(p_AB[0], p_AB[1])),
            tilt=float(np.arccos(np.clip(R_AB[2, 2], -1.0, 1.0))),
            angle=float(np.arctan2(R_AB[1, 0] - R_AB[0, 1], R_AB[0, 0] + R_AB[1, 1])),
        )

    def within(self, gate: Gate) -> bool:
        """Return whether every error is inside the gate."""
        return (
            abs(self.axial) <= gate.axial
            and self.lateral <= gate.lateral
            and self.tilt <= gate.tilt
            and abs(self.angle) <= gate.angle
        )


class ThreadState(Enum):
    """FREE: loose. CAUGHT: follows the helix. LOCKED: caught, and held by static friction."""

    FREE = "free"
    CAUGHT = "caught"
    LOCKED = "locked"


STATES = tuple(ThreadState)
NO_BIT = -1  # Position of a bit that is not in the drive.


@dataclass(frozen=True)
class Engagement:
    """What is remembered of one thread; a row of the state of `cell.workpieces.threads.Threads`.

    Attributes:
        state: Of the thread.
        bit_position: In which of its ways the bit is in the drive, or `NO_BIT`.
        caught_angle: Angle of the follower when the thread caught [rad].
    """

    state: ThreadState = ThreadState.FREE
    bit_position: int = NO_BIT
    caught_angle: float = 0.0

    def row(self) -> np.ndarray:
        """Return the row (3,)."""
        return np.array([STATES.index(self.state), self.bit_position, self.caught_angle])

    @staticmethod
    def of(row: np.ndarray) -> Engagement:
        """Undo `row`."""
        return Engagement(STATES[int(row[0])], int(row[1]), float(row[2]))


@dataclass(frozen=True)
class Thread:
    """One bolt and its tapped hole in the plant, and the ties that can be closed.

    Frames: H is the thread frame, where the bolt's frame F is when it is seated; E is the frame
    of the bit's end face.

    Attributes:
        head_height: Of the top of the head above its underside [m].
    """

    screw: Screw
    head_height: float
    plant: MultibodyPlant
    scene_graph: SceneGraph
    bolt: RigidBody
    follower: RigidBody
    joint: ScrewJoint
    thread_frame: Frame
    bit_frame: Frame
    thread_tie: tuple[MultibodyConstraintId, ...]
    bit_ties: tuple[tuple[MultibodyConstraintId, ...], ...]

    def X_HF(self, context: Context) -> RigidTransform:
        """Pose of the bolt in its thread frame (plant context)."""
        return self.bolt.body_frame().CalcPose(context, self.thread_frame)

    def clamp_force(self, plant_context: Context) -> float:
        """Axial force that the thread carries, positive when it clamps [N].

        A clamped bolt is pulled into the hole, along -z of the joint frame.
        """
        forces = self.plant.get_reaction_forces_output_port().Eval(plant_context)
        return -float(forces[int(self.joint.index())].translational()[2])

    def bit_misfit(self, context: Context) -> tuple[Misfit, int]:
        """Return the error between bit and drive, for the nearest way in which it fits."""
        X_FE = self.bit_frame.CalcPose(context, self.bolt.body_frame())
        fits = [
            Misfit.between(_X_FE_seated(self.screw, position).inverse() @ X_FE)
            for position in range(self.screw.drive.positions)
        ]
        position = int(np.argmin([abs(fit.angle) for fit in fits]))
        return fits[position], position

    def takes_bit(self, context: Context) -> bool:
        """Return whether the bit's end is over the drive or in it, however it is turned.

        Of a bit in the drive only its depth is asked: the walls keep it there.
        """
        X_FE = self.bit_frame.CalcPose(context, self.bolt.body_frame())
        x, y, _ = X_FE.translation()
        if math.hypot(x, y) > 2 * BIT_GATE.lateral:
            return False  # Nearly always, and asked in every step.
        misfit = Misfit.between(_X_FE_seated(self.screw, 0).inverse() @ X_FE)
        below_top = self.head_height - self.screw.bit_seat + misfit.axial
        if below_top > BIT_GATE.axial:
            return True
        return misfit.lateral <= BIT_GATE.lateral and misfit.tilt <= BIT_GATE.tilt

    def thread_misfit(self, context: Context) -> tuple[Misfit, float]:
        """Return the bolt's error against the helix, and the follower angle that fits best."""
        free = Misfit.between(self.X_HF(context))
        pitch = self.screw.pitch
        turns = round((free.axial - pitch * free.angle / (2 * np.pi)) / pitch)
        theta = free.angle + 2 * np.pi * turns
        axial = free.axial - pitch * theta / (2 * np.pi)
        return Misfit(axial, free.lateral, free.tilt, 0.0), theta

    def apply(self, root: Context, engagement: Engagement) -> None:
        """Close and open ties, joint and contact as a state asks for."""
        context = self.plant.GetMyMutableContextFromRoot(root)
        caught = engagement.state is not ThreadState.FREE
        self._set_inertia(context, engaged=caught)
        self._filter_shank(root, caught=caught)
        for constraint in self.thread_tie:
            self.plant.SetConstraintActiveStatus(context, constraint, caught)
        self.set_bit(root, engagement.bit_position)
        turns = engagement.state is ThreadState.CAUGHT
        (self.joint.Unlock if turns else self.joint.Lock)(context)

    def set_bit(self, root: Context, position: int) -> None:
        """Tie the bit in one of the ways it fits; `NO_BIT` opens all ties."""
        context = self.plant.GetMyMutableContextFromRoot(root)
        for k, tie in enumerate(self.bit_ties):
            for constraint in tie:
                self.plant.SetConstraintActiveStatus(context, constraint, k == position)

    def set_angle(self, root: Context, theta: float) -> None:
        """Turn the follower, without load, to an angle [rad]."""
        context = self.plant.GetMyMutableContextFromRoot(root)
        q = self.plant.GetPositions(context).copy()
        q[self.joint.position_start()] = theta
        self.plant.SetPositions(context, q)

    def _set_inertia(self, context: Context, *, engaged: bool) -> None:
        """Real inertia while loose; added inertia while the thread is engaged."""
        mass = self.bolt.default_mass() * (ENGAGED_MASS_FACTOR if engaged else 1.0)
        real = self.bolt.default_spatial_inertia()
        scale = ENGAGED_INERTIA_FACTOR / ENGAGED_MASS_FACTOR if engaged else 1.0
        about_com = real.Shift(real.get_com()).get_unit_inertia()
        moments = about_com.get_moments() * scale
        inertia = SpatialInertia(mass, np.zeros(3), UnitInertia(*moments)).Shift(-real.get_com())
        self.bolt.SetSpatialInertiaInBodyFrame(context, inertia)

    def _filter_shank(self, root: Context, *, caught: bool) -> None:
        """A caught shank is inside the threaded part: their contact is the thread itself."""
        context = self.scene_graph.GetMyMutableContextFromRoot(root)
        bolt = self.plant.GetCollisionGeometriesForBody(self.bolt)
        parent = self.plant.GetCollisionGeometriesForBody(self.thread_frame.body())
        declaration = CollisionFilterDeclaration()
        declare = declaration.ExcludeBetween if caught else declaration.AllowBetween
        filters = self.scene_graph.collision_filter_manager(context)
        filters.Apply(declare(GeometrySet(bolt), GeometrySet(parent)))


def _X_FE_seated(screw: Screw, position: int) -> RigidTransform:
    """Pose of the seated bit end in the bolt frame, for one of the ways in which it fits."""
    spin = RotationMatrix.MakeZRotation(position * 2 * np.pi / screw.drive.positions)
    return RigidTransform(RotationMatrix.MakeXRotation(np.pi) @ spin, [0.0, 0.0, screw.bit_seat])


def _tie_points(z: float) -> list[np.ndarray]:
    return [
        np.array([TIE_RADIUS * np.cos(angle), TIE_RADIUS * np.sin(angle), z])
        for angle in TIE_ANGLES
    ]


def set_head_friction(
    plant: MultibodyPlant, scene_graph: SceneGraph, screw: Screw, bolt: RigidBody, clamps: RigidBody
) -> None:
    """Give a bolt's head the friction of its nut factor, before the plant is finalized.

    The head is the geometry "head" of the bolt's model; what it bears on are the geometries
    "washer..." of the clamped part, where there are such.

    Raises:
        BadPart: The bolt's model has no geometry "head".
    """
    inspector = scene_graph.model_inspector()

    def named(body: RigidBody, prefix: str) -> list[GeometryId]:
        ids = plant.GetCollisionGeometriesForBody(body)
        return [i for i in ids if inspector.GetName(i).split("::")[-1].startswith(prefix)]

    heads, washers = named(bolt, "head"), named(clamps, "washer")
    if not heads:
        raise BadPart(screw.part, "its model has no collision geometry 'head' for the bolt's head")
    counter = None
    if washers:
        properties = inspector.GetProximityProperties(washers[0])
        counter = properties.GetProperty("material", "coulomb_friction").static_friction()
    friction = head_friction(screw, counter)
    for head in heads:
        properties = ProximityProperties(inspector.GetProximityProperties(head))
        material = CoulombFriction(friction, friction)
        properties.UpdateProperty("material", "coulomb_friction", material)
        source = plant.get_source_id()
        scene_graph.AssignRole(source, head, properties, RoleAssign.kReplace)


def add_thread(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    screw: Screw,
    bolt: RigidBody,
    into: RigidBody,
    X_IH: RigidTransform,
    bit_frame: Frame,
    head_height: float,
) -> Thread:
    """Add the follower and the (open) ties of one screw, before the plant is finalized.

    Args:
        plant: Not finalized yet.
        scene_graph: Where collision filters are set.
        screw: Pitch and names.
        bolt: The bolt; its z axis points from the shank to the head.
        into: The part that carries the thread.
        X_IH: Thread frame H in the frame of ``into``: the bolt's pose when seated.
        bit_frame: Frame E at the bit's end face, +z out of the tool.
        head_height: Of the top of the head above its underside [m].
    """
    name = f"thread_{screw.part}"
    H = plant.AddFrame(FixedOffsetFrame(name, into.body_frame(), X_IH))
    unit = FOLLOWER_INERTIA / FOLLOWER_MASS
    follower = plant.AddRigidBody(
        f"{name}_follower",
        plant.GetModelInstanceByName("threads"),
        SpatialInertia(FOLLOWER_MASS, np.zeros(3), UnitInertia(unit, unit, unit)),
    )
    # Right-hand thread: a positive rotation about +z (out of the hole) moves out of the hole.
    joint = plant.AddJoint(
        ScrewJoint(name, H, follower.body_frame(), np.array([0.0, 0.0, 1.0]), screw.pitch, 0.0)
    )
    thread_tie = tuple(
        plant.AddBallConstraint(follower, point, bolt, point) for point in _tie_points(0.0)
    )
    bit_ties = tuple(
        tuple(
            plant.AddBallConstraint(
                bit_frame.body(),
                bit_frame.GetFixedPoseInBodyFrame()
                @ _X_FE_seated(screw, position).inverse()
                @ point,
                bolt,
                point,
            )
            for point in _tie_points(screw.bit_seat)
        )
        for position in range(screw.drive.positions)
    )
    return Thread(
        screw,
        head_height,
        plant,
        scene_graph,
        bolt,
        follower,
        joint,
        H,
        bit_frame,
        thread_tie,
        bit_ties,
    )
