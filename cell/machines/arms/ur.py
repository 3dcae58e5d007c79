"""Six-axis arms of the UR e-series: published tables and closed-form inverse kinematics.

Frames follow the maker's Denavit-Hartenberg convention. A pose has up to eight solutions (shoulder
left or right, elbow up or down, wrist flipped or not), each joint of which may also be turned by a
full circle. With all joints at zero the arm points along -x of its base.

Sources: [R] Universal_Robots_ROS2_Description: ur5e at commit 2221ec0f, joint limits of ur3e and
ur10e at commit 8ef39b34, masses, centres of mass and inertias of ur3e at commit 3426d674, of ur10e
in the fork RocketfarmAS at commit 0d100270; Denavit-Hartenberg parameters: Universal Robots, "DH
Parameters for calculations of kinematics and dynamics". The few products of inertia of ur3e and
ur10e are left out [A].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from pydrake.math import RigidTransform

from cell.machines.arms.base import ArmModel, Link

ALPHA = np.array([np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0])  # [rad] of the whole family.

# A cosine this far beyond 1 is rounding at the edge of the workspace, not out of reach.
ROUNDING = 1e-9
# Below this sine of wrist 2, wrist 1 and wrist 3 turn about the same axis.
SINGULAR = 1e-7
SINGULAR_SINE = 0.2  # Of wrist 2 and of the elbow in a regular configuration [A].
WOUND_UP = np.deg2rad(310.0)  # Joints turn by 360 degrees either way [A].

HALF, FULL = math.pi, 2 * math.pi


@dataclass(frozen=True, eq=False, kw_only=True)
class UrArm(ArmModel):
    """An arm of the family.

    Attributes:
        d, a: (6,) Denavit-Hartenberg lengths [m].
    """

    d: np.ndarray
    a: np.ndarray

    def flange_pose(self, q: np.ndarray) -> RigidTransform:
        """Return X_BF for joint angles ``q`` (6,) [rad]."""
        return RigidTransform(self._product(q, 0, 6))

    def inverse(self, X_BF: RigidTransform, near: np.ndarray) -> np.ndarray:
        """Return all joint angles that put the flange at X_BF.

        Args:
            X_BF: Pose of the flange in the base.
            near: (6,) [rad]. Where wrist 1 and wrist 3 are aligned and only their sum counts,
                wrist 3 is as in it.

        Returns:
            (n, 6) with n in 0..8, every angle in (-pi, pi].
        """
        T_BF = X_BF.GetAsMatrix4()
        solutions = []
        for pan, flip in product(self._pan_angles(T_BF), (1.0, -1.0)):
            wrist = self._wrist_angles(T_BF, pan, flip, float(near[5]))
            if wrist is not None:
                solutions += self._elbow_solutions(T_BF, pan, *wrist)
        return np.array([_wrapped(q) for q in solutions]).reshape(-1, 6)

    def is_regular(self, q: np.ndarray) -> bool:
        """Return whether the arm is well away from its singularities and from winding itself up.

        Close to a singularity of wrist or elbow, a straight line of the tool asks for large turns
        of the joints; close to a joint limit it cannot go on.
        """
        singular = min(abs(np.sin(q[4])), abs(np.sin(q[2]))) < SINGULAR_SINE
        return bool(not singular and np.max(np.abs(q)) < WOUND_UP)

    def _link_transform(self, joint: int, angle: float) -> np.ndarray:
        """Return the 4x4 transform of one Denavit-Hartenberg row."""
        c, s = np.cos(angle), np.sin(angle)
        ca, sa = np.cos(ALPHA[joint]), np.sin(ALPHA[joint])
        a, d = self.a[joint], self.d[joint]
        return np.array(
            [
                [c, -s * ca, s * sa, a * c],
                [s, c * ca, -c * sa, a * s],
                [0, sa, ca, d],
                [0, 0, 0, 1.0],
            ]
        )

    def _product(self, q: Sequence[float] | np.ndarray, start: int, end: int) -> np.ndarray:
        """Return the product of link transforms ``start`` .. ``end`` - 1."""
        T = np.eye(4)
        for joint, angle in zip(range(start, end), q, strict=True):
            T = T @ self._link_transform(joint, angle)
        return T

    def _pan_angles(self, T_BF: np.ndarray) -> tuple[float, ...]:
        """Shoulder pan: the wrist centre stands d4 beside the plane of the arm."""
        x, y = (T_BF[:3, 3] - self.d[5] * T_BF[:3, 2])[:2]
        spread = _arccos(self.d[3] / np.hypot(x, y)) if np.hypot(x, y) > 0 else None
        if spread is None:
            return ()
        middle = np.arctan2(y, x) + np.pi / 2
        return (middle + spread, middle - spread)

    def _wrist_angles(
        self, T_BF: np.ndarray, pan: float, flip: float, wrist_3: float
    ) -> tuple[float, float] | None:
        """Wrist 2 and wrist 3: the flange's distance and direction beside the plane of the arm."""
        aside = np.array([np.sin(pan), -np.cos(pan), 0.0])
        tilt = _arccos((aside @ T_BF[:3, 3] - self.d[3]) / self.d[5])
        if tilt is None:
            return None
        wrist_2 = flip * tilt
        sine = np.sin(wrist_2)
        if abs(sine) < SINGULAR:
            return wrist_2, wrist_3
        return wrist_2, float(np.arctan2(-aside @ T_BF[:3, 1] / sine, aside @ T_BF[:3, 0] / sine))

    def _elbow_solutions(
        self, T_BF: np.ndarray, pan: float, wrist_2: float, wrist_3: float
    ) -> list[tuple[float, ...]]:
        """Lift, elbow and wrist 1: a planar arm of two links with the elbow up or down."""
        T_14 = np.linalg.solve(self._product([pan], 0, 1), T_BF) @ np.linalg.inv(
            self._product([wrist_2, wrist_3], 4, 6)
        )
        p_13 = T_14[:3, 3] - self.d[3] * T_14[:3, 1]
        reach = float(np.hypot(p_13[0], p_13[1]))
        a2, a3 = self.a[1], self.a[2]
        bend = _arccos((reach**2 - a2**2 - a3**2) / (2 * a2 * a3))
        if bend is None:
            return []
        solutions = []
        for elbow in (bend, -bend):
            lift = np.arctan2(-p_13[1], -p_13[0]) + np.arcsin(a3 * np.sin(elbow) / reach)
            T_34 = np.linalg.solve(self._product([lift, elbow], 1, 3), T_14)
            wrist_1 = np.arctan2(T_34[1, 0], T_34[0, 0])
            solutions.append((pan, lift, elbow, wrist_1, wrist_2, wrist_3))
        return solutions


def _wrapped(q: Sequence[float]) -> np.ndarray:
    """Return the angles in (-pi, pi]."""
    return np.pi - np.mod(np.pi - np.asarray(q), 2 * np.pi)


def _arccos(value: float) -> float | None:
    """Return the arc cosine, or None where there is none."""
    if abs(value) > 1.0 + ROUNDING:
        return None
    return float(np.arccos(np.clip(value, -1.0, 1.0)))


# Moving link and its joint, in the order of the chain, and the joint's range either way [rad]. The
# elbow's is half the maker's: the upper arm is in the way beyond [R].
CHAIN = (
    ("shoulder_link", "shoulder_pan_joint", FULL),
    ("upper_arm_link", "shoulder_lift_joint", FULL),
    ("forearm_link", "elbow_joint", HALF),
    ("wrist_1_link", "wrist_1_joint", FULL),
    ("wrist_2_link", "wrist_2_joint", FULL),
    ("wrist_3_link", "wrist_3_joint", FULL),
)
Body = tuple[float, tuple[float, float, float], tuple[float, float, float]]


def _ur_arm(
    name: str,
    d: Sequence[float],
    a: Sequence[float],
    bodies: Sequence[Body],
    speed_deg: Sequence[float],
    effort: Sequence[float],
    damping: tuple[float, ...],
    payload: float,
    base_mass: float = 4.0,  # "Might be incorrect" [R].
) -> UrArm:
    """Return an arm from its tables.

    Args:
        name: Of the model.
        d: (6,) [m].
        a: (6,) [m].
        bodies: Mass [kg], centre of mass [m], moments [kg m2] of each moving link, in link axes.
        speed_deg: Speed limits (6,) [deg/s].
        effort: Torque limits (6,) [N m].
        damping: Of the position drives (6,) [N m s/rad].
        payload: [kg].
        base_mass: [kg].
    """
    quarter = math.pi / 2
    origins = (
        ((0.0, 0.0, d[0]), (0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (quarter, 0.0, 0.0)),
        ((a[1], 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((a[2], 0.0, d[3]), (0.0, 0.0, 0.0)),
        ((0.0, -d[4], 0.0), (quarter, 0.0, 0.0)),
        ((0.0, d[5], 0.0), (quarter, math.pi, math.pi)),
    )
    links = tuple(
        Link(link, joint, xyz, rpy, *body, -turn, turn, math.radians(speed), torque)
        for (link, joint, turn), (xyz, rpy), body, speed, torque in zip(
            CHAIN, origins, bodies, speed_deg, effort, strict=True
        )
    )
    return UrArm(
        name=name,
        links=links,
        base_mass=base_mass,
        payload=payload,
        stiffness=(2e4, 2e4, 2e4, 5e3, 5e3, 5e3),  # Stable at any gain [A].
        damping=damping,
        # Forearm 10 deg up, tool down; the driver's arm waits to the side of the jig [A].
        home_deg={
            "gripper": (180.0, -110.0, 100.0, -80.0, -90.0, 0.0),
            "driver": (60.0, -110.0, 110.0, -90.0, -90.0, 0.0),
        },
        d=np.array(d),
        a=np.array(a),
    )


# Damping of the drives: about critical with the arm stretched [D].
UR3E = _ur_arm(
    "ur3e",
    d=(0.15185, 0.0, 0.0, 0.13105, 0.08535, 0.0921),
    a=(0.0, -0.24355, -0.2132, 0.0, 0.0, 0.0),
    bodies=(
        (1.98, (0, 0, -0.02), (0.0027657, 0.0025626, 0.0021501)),
        (3.4445, (-0.11355, 0, 0.1157), (0.0042623, 0.0460284, 0.0448947)),
        (1.437, (-0.1632, 0, 0.0238), (0.0010511, 0.0113396, 0.0110895)),
        (0.871, (0, -0.01, 0), (0.0008174, 0.0005497, 0.0006844)),
        (0.805, (0, 0.01, 0), (0.0006059, 0.0003831, 0.0005837)),
        (0.261, (0, 0, -0.02), (0.0001080, 0.0001086, 0.0001371)),
    ),
    speed_deg=(180, 180, 180, 360, 360, 360),
    effort=(56.0, 56.0, 28.0, 12.0, 12.0, 12.0),
    damping=(250.0, 250.0, 150.0, 50.0, 50.0, 50.0),
    payload=3.0,  # [R] As resellers list it, not from the maker.
    base_mass=2.0,
)
# The inertia of upper arm and forearm is published about an axis along x; here in link axes [R].
UR5E = _ur_arm(
    "ur5e",
    d=(0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996),
    a=(0.0, -0.425, -0.3922, 0.0, 0.0, 0.0),
    bodies=(
        (3.761, (0, -0.00193, -0.02561), (0.0102675, 0.0102675, 0.00666)),
        (8.058, (-0.2125, 0, 0.11336), (0.0151074, 0.1338858, 0.1338858)),
        (2.846, (-0.2422, 0, 0.0265), (0.004095, 0.0312094, 0.0312094)),
        (1.37, (0, -0.01634, -0.0018), (0.0025599, 0.0025599, 0.0021942)),
        (1.3, (0, 0.01634, -0.0018), (0.0025599, 0.0025599, 0.0021942)),
        (0.365, (0, 0, -0.001159), (9.8904e-5, 9.8904e-5, 1.32117e-4)),
    ),
    speed_deg=(180, 180, 180, 180, 180, 180),
    effort=(150.0, 150.0, 150.0, 28.0, 28.0, 28.0),
    damping=(500.0, 500.0, 300.0, 60.0, 60.0, 60.0),
    payload=5.0,  # [A] The class that its name says.
)
UR10E = _ur_arm(
    "ur10e",
    d=(0.1807, 0.0, 0.0, 0.17415, 0.11985, 0.11655),
    a=(0.0, -0.6127, -0.57155, 0.0, 0.0, 0.0),
    bodies=(
        (7.369, (0.021, -0.027, 0), (0.03408, 0.02156, 0.03529)),
        (13.051, (-0.2327, 0, 0.158), (0.02814, 0.77068, 0.76943)),
        (3.989, (-0.33155, 0, 0.068), (0.01014, 0.30928, 0.30646)),
        (2.1, (0, -0.018, 0.007), (0.00296, 0.00258, 0.00222)),
        (1.98, (0, 0.018, -0.007), (0.00296, 0.00258, 0.00222)),
        (0.615, (0, 0, -0.026), (0.00040, 0.00041, 0.00034)),
    ),
    speed_deg=(120, 120, 180, 180, 180, 180),
    effort=(330.0, 330.0, 150.0, 56.0, 56.0, 56.0),
    damping=(900.0, 900.0, 500.0, 60.0, 60.0, 60.0),
    payload=12.5,  # [R] User manual; 10 kg on older arms, see the label.
)
