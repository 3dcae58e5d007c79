"""Press fits: a shaft that is pushed into a hole that is narrower than it.

What is modelled instead of simulated: the interference. In the contact models the wall of such a
hole is wide enough for its shaft; what holds the shaft is a *follower* body that rides along the
axis of the hole, on a `PrismaticJoint` of the part with the hole. Once the tip of the shaft is in
the mouth, within a gate, three ball constraints tie the shaft to the follower: from then on it can
only slide along the axis, against a friction that grows with the depth to which it is engaged,

    F(d) = F_seat d / d_seat,

as it follows from F = mu p 2 pi r d with Lame's pressure p (`cell.products.press_force`). It is
Coulomb's friction, decided by events and not by a regularised speed: what is stuck is held by a
locked joint, whatever the time step, until the joint carries more than F(d). The step of a slide is
explicit: the friction of a step is that of the depth at its start.

When a fit catches, slips and sticks is decided in `cell.workpieces.press_fits`. The stop, a flange
or the bottom of the hole, is plain contact. So are the edges that lead the shaft in.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    MultibodyConstraintId,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.framework import Context

from cell.products.joints import Press

INSTANCE = "press_fits"  # The model instance of all followers.
FOLLOWER_MASS = 1e-3  # [A] As light as that of a thread [kg].
FOLLOWER_INERTIA = 1e-6
# Of the follower while it slides. The friction of a step is explicit: it would throw a bush of some
# grams back from its seat, to where it was before, again and again [M].
SLIDING_MASS = 0.5
# The wall leaves 50 um of play (`PRESS_PLAY` of drafted contact models): a tip in the mouth is
# within that of the axis, but for its facets, and tilts by 1 degree at most once it is 6 mm deep.
LATERAL_GATE, TILT_GATE = 1e-4, float(np.deg2rad(1.0))
TIE_ANGLES = np.deg2rad([0.0, 120.0, 240.0])


class FitState(Enum):
    """FREE: not in the hole. STUCK: held by static friction. IN, OUT: slides, and which way."""

    FREE = "free"
    STUCK = "stuck"
    IN = "in"
    OUT = "out"


STATES = tuple(FitState)


@dataclass(frozen=True)
class Grip:
    """What is remembered of one press fit; a row of the state of `press_fits.PressFits`.

    Attributes:
        state: Of the fit.
        friction: Force on the shaft along the axis, out of the hole, while it slides [N].
    """

    state: FitState = FitState.FREE
    friction: float = 0.0

    def row(self) -> np.ndarray:
        """Return the row (2,)."""
        return np.array([STATES.index(self.state), self.friction])

    @staticmethod
    def of(row: np.ndarray) -> Grip:
        """Undo `row`."""
        return Grip(STATES[int(row[0])], float(row[1]))


@dataclass(frozen=True)
class PressFit:
    """One shaft and its hole in the plant, and the tie that can be closed.

    Frames: H is fixed to the part with the hole, T to the shaft; both are at the tip of the seated
    shaft, z along the axis and out of the hole. When the shaft is seated, they coincide.
    """

    press: Press
    plant: MultibodyPlant
    hole_frame: Frame
    tip_frame: Frame
    slide: PrismaticJoint
    turn: RevoluteJoint
    tie: tuple[MultibodyConstraintId, ...]

    def X_HT(self, context: Context) -> RigidTransform:
        """Pose of the shaft's tip relative to where it is seated (plant context)."""
        return self.tip_frame.CalcPose(context, self.hole_frame)

    def depth(self, context: Context) -> float:
        """Return how deep the shaft is in the hole, by its tip; negative before it [m]."""
        return self.press.depth - float(self.X_HT(context).translation()[2])

    def friction_at(self, depth: float) -> float:
        """Return the largest friction at a depth [N]; no more than engages, none before it."""
        return self.press.force * float(np.clip(depth / self.press.depth, 0.0, 1.0))

    def meets(self, context: Context) -> bool:
        """Return whether the tip is in the mouth, near enough to the axis and along it."""
        X_HT = self.X_HT(context)
        x, y, z = X_HT.translation()
        tilt = np.arccos(np.clip(X_HT.rotation().matrix()[2, 2], -1.0, 1.0))
        entered = 0.0 < self.press.depth - z <= self.press.depth
        return bool(entered and np.hypot(x, y) <= LATERAL_GATE and tilt <= TILT_GATE)

    def asleep(self, context: Context) -> bool:
        """Return whether one of the two parts is: nothing acts on a part that sleeps."""
        ends = self.hole_frame, self.tip_frame
        return any(frame.body().is_locked(context) for frame in ends)

    def speed(self, context: Context) -> float:
        """Return how fast the follower moves along the axis, out of the hole [m/s]."""
        return float(self.slide.get_translation_rate(context))

    def push(self, context: Context) -> float:
        """Return the force that the locked slide carries, positive into the hole [N]."""
        forces = self.plant.get_reaction_forces_output_port().Eval(context)
        return float(forces[int(self.slide.index())].translational()[2])

    def place_follower(self, context: Context) -> None:
        """Put the follower where the shaft is."""
        X_HT = self.X_HT(context)
        self.turn.set_angle(context, float(RollPitchYaw(X_HT.rotation()).yaw_angle()))
        self.slide.set_translation(context, float(X_HT.translation()[2]))

    def apply(self, context: Context, state: FitState) -> None:
        """Close or open tie and joints as a state asks for (plant context)."""
        for constraint in self.tie:
            self.plant.SetConstraintActiveStatus(context, constraint, state is not FitState.FREE)
        self.turn.Lock(context)
        slides = state in (FitState.IN, FitState.OUT)
        mass = SLIDING_MASS if slides else FOLLOWER_MASS
        slider = self.slide.child_body()
        slider.SetSpatialInertiaInBodyFrame(context, _small_inertia(mass))
        (self.slide.Unlock if slides else self.slide.Lock)(context)


def add_press_fit(
    plant: MultibodyPlant,
    name: str,
    press: Press,
    shaft: tuple[RigidBody, RigidTransform],
    hole: tuple[RigidBody, RigidTransform],
    axis: np.ndarray,
) -> PressFit:
    """Add the follower and the (open) tie of one press fit, before the plant is finalized.

    Args:
        plant: Not finalized yet, with the model instance `INSTANCE`.
        name: Of what is added.
        press: Mouth, depth and force.
        shaft: The part with the shaft, and its assembled pose X_AP.
        hole: The part with the hole, and its assembled pose X_AP.
        axis: (3,) unit vector in A, along which the shaft leaves the hole.
    """
    instance = plant.GetModelInstanceByName(INSTANCE)
    R_AH = RotationMatrix.MakeFromOneVector(axis, 2)
    X_AH = RigidTransform(R_AH, press.p_AoF - press.depth * axis)
    H, T = (
        plant.AddFrame(FixedOffsetFrame(f"{name}_{end}", body.body_frame(), X_AP.inverse() @ X_AH))
        for end, (body, X_AP) in (("hole", hole), ("tip", shaft))
    )
    slider, follower = (
        plant.AddRigidBody(f"{name}_{part}", instance, _small_inertia(FOLLOWER_MASS))
        for part in ("slider", "follower")
    )
    z = np.array([0.0, 0.0, 1.0])
    slide = plant.AddJoint(PrismaticJoint(f"{name}_slide", H, slider.body_frame(), z))
    plant.AddJointActuator(f"{name}_friction", slide)
    turn = plant.AddJoint(
        RevoluteJoint(f"{name}_turn", slider.body_frame(), follower.body_frame(), z)
    )
    tie = tuple(
        plant.AddBallConstraint(follower, p_TQ, shaft[0], T.GetFixedPoseInBodyFrame() @ p_TQ)
        for p_TQ in _tie_points(shaft[0], T)
    )
    return PressFit(press, plant, H, T, slide, turn, tie)


def _small_inertia(mass: float) -> SpatialInertia:
    """Return the inertia of a follower, or of the half of it that slides, with a mass [kg]."""
    unit = FOLLOWER_INERTIA / mass
    return SpatialInertia(mass, np.zeros(3), UnitInertia(unit, unit, unit))


def _tie_points(shaft: RigidBody, T: FixedOffsetFrame) -> list[np.ndarray]:
    """Return points in T around the axis, at the height of the shaft's centre of mass.

    At the radius of gyration about the axis ball constraints are stiffest, see `thread.TIE_RADIUS`.
    """
    inertia = shaft.default_spatial_inertia()
    p_TCom = T.GetFixedPoseInBodyFrame().inverse() @ inertia.get_com()
    about_com = inertia.Shift(inertia.get_com()).get_unit_inertia()
    moments = about_com.ReExpress(T.GetFixedPoseInBodyFrame().rotation().inverse()).get_moments()
    radius = float(np.sqrt(moments[2]))
    return [
        np.array([radius * np.cos(angle), radius * np.sin(angle), p_TCom[2]])
        for angle in TIE_ANGLES
    ]
