"""What an arm is before it stands in a cell: its links, limits, drives, homes and kinematics.

An arm is a chain of revolute joints. B is its base (``base_link``) and F its flange, +z out of it.
Every joint turns about the z axis of its own link's frame, so a table of links is a whole arm: the
models in models/sdf are drawn from it, and forward and inverse kinematics follow from it by
numbers. A family with a closed form overrides them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from cell.machines.arms.numeric import Chain, NumericInverse

LIMIT_MARGIN = 0.05  # Kept from each joint's limit [rad] [A].
LIMIT_ROOM = 0.15  # A regular configuration has this much left to every joint limit [rad] [A].
# A regular configuration's least gain from joint rates to the flange's velocity, with lengths
# measured in reaches of the arm; at it, 1 % of the reach per second takes 0.2 rad/s of a joint [A].
LEAST_GAIN = 0.05


@dataclass(frozen=True)
class Link:
    """One moving link and the joint that it hangs on; the joint turns about the link's z axis.

    Attributes:
        name: Of the link.
        joint: Name of its joint.
        xyz: Origin of the link's frame in the parent link's [m].
        rpy: Its roll, pitch and yaw there at joint angle 0 [rad].
        mass: [kg].
        com: Centre of mass in the link's frame [m].
        moments: Principal moments about it, axes along the link's [kg m2].
        lower, upper: Position limits of the joint [rad].
        speed: Its speed limit [rad/s].
        effort: Its torque limit [N m].
    """

    name: str
    joint: str
    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]
    mass: float
    com: tuple[float, float, float]
    moments: tuple[float, float, float]
    lower: float
    upper: float
    speed: float
    effort: float


@dataclass(frozen=True, eq=False)
class ArmModel:
    """One type of arm.

    Attributes:
        name: By which a configuration asks for it.
        links: From base to flange, without the base.
        base_mass: Of the link that stands still [kg].
        stiffness: Of each joint's position drive [N m/rad].
        damping: Of each joint's position drive [N m s/rad].
        home_deg: Joint angles to wait in [deg], for a "gripper" and for a "driver" on the flange.
        payload: Largest mass at the flange, tool and part together [kg].
        flange_z: How far the flange is in front of the last link's frame, along its z [m].
        joint_damping: Friction of every joint [N m s/rad] [A]: under 2 N m at full speed.
        rotor_inertia, gear_ratio: Of every joint's motor [kg m2], [-]; reflected 0.1 kg m2 [A], the
            order of such drives. It also keeps explicit impedance control stable at 1 ms [M].
    """

    name: str
    links: tuple[Link, ...]
    base_mass: float
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    home_deg: Mapping[str, tuple[float, ...]]
    payload: float = np.inf
    flange_z: float = 0.0
    joint_damping: float = 0.5
    rotor_inertia: float = 1e-5
    gear_ratio: float = 100.0

    base_frame = "base_link"
    flange_frame = "flange"

    @property
    def sdf(self) -> str:
        """Name of its model in models/sdf, or the URL of one elsewhere."""
        return self.name

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.links)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, from base to flange."""
        return tuple(link.joint for link in self.links)

    @cached_property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper position limits, each (dof,) [rad]."""
        return (
            np.array([link.lower for link in self.links]),
            np.array([link.upper for link in self.links]),
        )

    def flange_pose(self, q: np.ndarray) -> RigidTransform:
        """Return X_BF for joint angles ``q`` (dof,) [rad]."""
        return RigidTransform(self._chain.poses(np.asarray(q, dtype=float)[None])[0])

    def inverse(self, X_BF: RigidTransform, near: np.ndarray) -> np.ndarray:
        """Return joint angles that put the flange at a pose, nearest to ``near`` first.

        Args:
            X_BF: Pose of the flange in the base.
            near: (dof,) [rad]; where a joint angle is free to choose, it is chosen near this.

        Returns:
            (n, dof) [rad]. An arm with more joints than six has no end of solutions: some that
            differ, inside the limits by `LIMIT_MARGIN`. A closed form returns all there are, with
            angles in (-pi, pi] in any order and without regard to the limits.
        """
        return self._inverse.solutions(X_BF.GetAsMatrix4(), np.asarray(near, dtype=float))

    def is_regular(self, q: np.ndarray) -> bool:
        """Return whether the arm is well away from singularities and from its joint limits.

        Close to a singularity, a straight line of the tool asks for large turns of the joints;
        close to a joint limit it cannot go on.

        Args:
            q: (dof,) [rad].
        """
        lower, upper = self.limits
        if np.any(q < lower + LIMIT_ROOM) or np.any(q > upper - LIMIT_ROOM):
            return False
        jacobian = self._chain.jacobian(np.asarray(q, dtype=float)[None])[1][0]
        jacobian[3:] /= self._chain.reach
        return bool(np.linalg.svd(jacobian, compute_uv=False)[-1] > LEAST_GAIN)

    @cached_property
    def _chain(self) -> Chain:
        origins = [RigidTransform(RollPitchYaw(link.rpy), link.xyz) for link in self.links]
        return Chain(np.array([X.GetAsMatrix4() for X in origins]), self.flange_z)

    @cached_property
    def _inverse(self) -> NumericInverse:
        lower, upper = self.limits
        return NumericInverse(self._chain, lower + LIMIT_MARGIN, upper - LIMIT_MARGIN)
