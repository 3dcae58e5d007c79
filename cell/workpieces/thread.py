"""Screw threads: a bolt that is driven into a tapped hole.

What is modelled instead of simulated: the flanks of the thread and the hex of the bit. A *follower*
body rides on a ``ScrewJoint`` of the threaded part (axis along the hole, lead = pitch). It is
locked until the thread *catches*: then three ball constraints tie the bolt to it, and the bolt
advances one pitch per turn and carries axial force through the joint, whose reaction is the clamp
force.
Three more ball constraints tie the bolt to the bit while it is engaged. Both ties are gated: the
measured axial, lateral, tilt and phase errors must be small first, so nothing is pulled into place.

Head friction, seating, the clamped stack and the reaction of both arms are plain contact. Thread
friction is lumped into the head's friction coefficient, computed from the nut factor K.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from enum import Enum

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometrySet,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
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

from cell.products.product import Fastener

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
# A hex bit fits in six ways.
HEX_POSITIONS = 6
# Bit end above the underside of the head: M3 hex sockets are 1.3 to 2 mm deep in a 3 mm head [R].
BIT_SEAT = 1.2e-3


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
    """FREE: loose. CAUGHT: follows the helix. LOCKED: tightened, does not turn any more."""

    FREE = "free"
    CAUGHT = "caught"
    LOCKED = "locked"


@dataclass
class Thread:
    """One bolt, its tapped hole and the bit that drives it.

    Frames: H is the thread frame, where the bolt's frame F is when it is seated; E is the frame
    of the bit's end face.
    """

    fastener: Fastener
    plant: MultibodyPlant
    scene_graph: SceneGraph
    bolt: RigidBody
    follower: RigidBody
    screw: ScrewJoint
    thread_frame: Frame
    bit_frame: Frame
    thread_tie: tuple[MultibodyConstraintId, ...]
    bit_ties: tuple[tuple[MultibodyConstraintId, ...], ...]
    state: ThreadState = ThreadState.FREE
    bit_position: int | None = None
    caught_angle: float = 0.0
    filters_lifted: Callable[[Context], AbstractContextManager[None]] = nullcontext

    def reset(self, root: Context) -> None:
        """Make the bolt loose: ties open, follower locked, its own inertia, contact all over."""
        context = self.plant.GetMyMutableContextFromRoot(root)
        self._set_inertia(context, engaged=False)
        self._filter_shank(root, caught=False)
        for tie in (self.thread_tie, *self.bit_ties):
            self._tie(context, tie, active=False)
        self.screw.Lock(context)
        self.state, self.bit_position = ThreadState.FREE, None

    def restore(
        self, root: Context, state: ThreadState, bit_position: int | None, caught_angle: float
    ) -> None:
        """Return to a saved state; the positions are restored with the plant's."""
        self.reset(root)
        context = self.plant.GetMyMutableContextFromRoot(root)
        self.state, self.bit_position, self.caught_angle = state, bit_position, caught_angle
        if state is not ThreadState.FREE:
            self._set_inertia(context, engaged=True)
            self._tie(context, self.thread_tie, active=True)
            self._filter_shank(root, caught=True)
        if state is ThreadState.CAUGHT:
            self.screw.Unlock(context)
        if bit_position is not None:
            self._tie(context, self.bit_ties[bit_position], active=True)

    def _tie(
        self, context: Context, tie: tuple[MultibodyConstraintId, ...], *, active: bool
    ) -> None:
        for constraint in tie:
            self.plant.SetConstraintActiveStatus(context, constraint, active)

    def X_HF(self, context: Context) -> RigidTransform:
        """Pose of the bolt in its thread frame (plant context)."""
        return self.bolt.body_frame().CalcPose(context, self.thread_frame)

    def bit_misfit(self, context: Context) -> tuple[Misfit, int]:
        """Return the error between bit and socket, for the nearest of the six hex positions."""
        X_FE = self.bit_frame.CalcPose(context, self.bolt.body_frame())
        fits = [
            Misfit.between(_X_FE_seated(position).inverse() @ X_FE)
            for position in range(HEX_POSITIONS)
        ]
        position = int(np.argmin([abs(fit.angle) for fit in fits]))
        return fits[position], position

    def try_engage_bit(self, root: Context) -> bool:
        """Tie the bit to the bolt if it is inside the socket; return whether it is tied."""
        if self.bit_position is None:
            context = self.plant.GetMyMutableContextFromRoot(root)
            misfit, position = self.bit_misfit(context)
            if misfit.within(BIT_GATE):
                self._tie(context, self.bit_ties[position], active=True)
                self.bit_position = position
        return self.bit_position is not None

    def release_bit(self, root: Context) -> None:
        """Pull the bit out of the socket."""
        if self.bit_position is not None:
            context = self.plant.GetMyMutableContextFromRoot(root)
            self._tie(context, self.bit_ties[self.bit_position], active=False)
            self.bit_position = None

    def thread_misfit(self, context: Context) -> tuple[Misfit, float]:
        """Return the bolt's error against the helix, and the follower angle that fits best."""
        X_HF = self.X_HF(context)
        free = Misfit.between(X_HF)
        pitch = self.fastener.pitch
        turns = round((free.axial - pitch * free.angle / (2 * np.pi)) / pitch)
        theta = free.angle + 2 * np.pi * turns
        axial = free.axial - pitch * theta / (2 * np.pi)
        return Misfit(axial, free.lateral, free.tilt, 0.0), theta

    def try_catch(self, root: Context) -> bool:
        """Let the thread catch if the turning bolt meets it; return whether it is caught."""
        if self.state is not ThreadState.FREE:
            return True
        if self.bit_position is None:
            return False
        context = self.plant.GetMyMutableContextFromRoot(root)
        misfit, theta = self.thread_misfit(context)
        if misfit.within(THREAD_GATE):
            self._catch(root, context, theta)
        return self.state is not ThreadState.FREE

    def _catch(self, root: Context, context: Context, theta: float) -> None:
        self.screw.Unlock(context)
        self.plant.SetPositions(context, self._with_theta(context, theta))
        self._set_inertia(context, engaged=True)
        self._tie(context, self.thread_tie, active=True)
        self._filter_shank(root, caught=True)
        self.state, self.caught_angle = ThreadState.CAUGHT, theta

    def _with_theta(self, context: Context, theta: float) -> np.ndarray:
        q = self.plant.GetPositions(context).copy()
        q[self.screw.position_start()] = theta
        return q

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
        declare(GeometrySet(bolt), GeometrySet(parent))
        with self.filters_lifted(root):
            self.scene_graph.collision_filter_manager(context).Apply(declaration)

    def lock(self, root: Context) -> None:
        """The clutch has tripped: from now on static thread friction holds the bolt."""
        self.screw.Lock(self.plant.GetMyMutableContextFromRoot(root))
        self.state = ThreadState.LOCKED

    def turns(self, context: Context) -> float:
        """Turns since the thread caught, positive for tightening."""
        return (self.caught_angle - self.screw.get_rotation(context)) / (2 * np.pi)

    def clamp_force(self, plant_context: Context) -> float:
        """Axial force that the thread carries, positive when it clamps [N].

        A clamped bolt is pulled into the hole, along -z of the joint frame.
        """
        forces = self.plant.get_reaction_forces_output_port().Eval(plant_context)
        return -float(forces[int(self.screw.index())].translational()[2])


def _X_FE_seated(position: int) -> RigidTransform:
    """Pose of the seated bit end in the bolt frame, for one of the six hex positions."""
    spin = RotationMatrix.MakeZRotation(position * 2 * np.pi / HEX_POSITIONS)
    return RigidTransform(RotationMatrix.MakeXRotation(np.pi) @ spin, [0.0, 0.0, BIT_SEAT])


def _tie_points(z: float) -> list[np.ndarray]:
    return [
        np.array([TIE_RADIUS * np.cos(angle), TIE_RADIUS * np.sin(angle), z])
        for angle in TIE_ANGLES
    ]


def add_thread(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    fastener: Fastener,
    bolt: RigidBody,
    into: RigidBody,
    X_IH: RigidTransform,
    bit_frame: Frame,
) -> Thread:
    """Add the follower and the (open) ties of one fastener, before the plant is finalized.

    Args:
        plant: Not finalized yet.
        scene_graph: Where collision filters are set.
        fastener: Pitch and names.
        bolt: The bolt; its z axis points from the shank to the head.
        into: The part that carries the thread.
        X_IH: Thread frame H in the frame of ``into``: the bolt's pose when seated.
        bit_frame: Frame E at the bit's end face, +z out of the tool.
    """
    name = f"thread_{fastener.part}"
    H = plant.AddFrame(FixedOffsetFrame(name, into.body_frame(), X_IH))
    unit = FOLLOWER_INERTIA / FOLLOWER_MASS
    follower = plant.AddRigidBody(
        f"{name}_follower",
        plant.GetModelInstanceByName("threads"),
        SpatialInertia(FOLLOWER_MASS, np.zeros(3), UnitInertia(unit, unit, unit)),
    )
    # Right-hand thread: a positive rotation about +z (out of the hole) moves out of the hole.
    screw = plant.AddJoint(
        ScrewJoint(name, H, follower.body_frame(), np.array([0.0, 0.0, 1.0]), fastener.pitch, 0.0)
    )
    thread_tie = tuple(
        plant.AddBallConstraint(follower, point, bolt, point) for point in _tie_points(0.0)
    )
    bit_ties = tuple(
        tuple(
            plant.AddBallConstraint(
                bit_frame.body(),
                bit_frame.GetFixedPoseInBodyFrame() @ _X_FE_seated(position).inverse() @ point,
                bolt,
                point,
            )
            for point in _tie_points(BIT_SEAT)
        )
        for position in range(HEX_POSITIONS)
    )
    return Thread(
        fastener, plant, scene_graph, bolt, follower, screw, H, bit_frame, thread_tie, bit_ties
    )
