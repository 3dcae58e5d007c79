"""How fast a path can be run: the fastest timing within speed, acceleration and torque limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.optimization import Toppra
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import Context
from pydrake.trajectories import PiecewisePolynomial

from cell.errors import RunFailure
from cell.machines.arm import Arm
from cell.paths import model_url, new_parser
from planning.motion.joint_path import JointPath

GRID_STEP = 0.05  # Between two points at which the limits are imposed [rad] [A].
INSET = 1e-3  # Of the outermost of these points of a segment, as a share of its length.
SAMPLE_PERIOD = 0.005  # Of the resulting motion [s] [A].
TORQUE_SHARE = 0.9  # Of the torque limits; the rest is for the feedback [A].


class NoTiming(RunFailure):
    """A path that cannot be run within the limits."""

    def __init__(self, arm: str, length: float) -> None:
        super().__init__(
            f"The {arm} arm cannot run a path of {length:.2f} rad within its speed, acceleration "
            "and torque limits: gravity alone may exceed them, or the payload is too heavy."
        )


@dataclass(frozen=True)
class JointMotion:
    """Joint angles over time, from rest to rest.

    Attributes:
        time: (n,) rising from 0 [s].
        q: (n, dof) [rad].
        v: (n, dof) [rad/s].
    """

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        return float(self.time[-1])

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return q and v (dof,), by cubic interpolation; at rest before the start and after."""
        if not 0.0 < time < self.duration:
            return self.q[0 if time <= 0.0 < self.duration else -1], np.zeros(self.q.shape[1])
        i = int(np.searchsorted(self.time, time, side="right")) - 1
        h = self.time[i + 1] - self.time[i]
        x = (time - self.time[i]) / h
        q0, q1, v0, v1 = self.q[i], self.q[i + 1], h * self.v[i], h * self.v[i + 1]
        dq = q1 - q0
        c2, c3 = 3 * dq - 2 * v0 - v1, v0 + v1 - 2 * dq
        return q0 + x * (v0 + x * (c2 + x * c3)), (v0 + x * (2 * c2 + x * 3 * c3)) / h


def time_path(
    arm: Arm,
    context: Context,
    path: JointPath,
    *,
    velocity_scale: float,
    acceleration_limit: float,
    payload: SpatialInertia | None = None,
) -> JointMotion:
    """Return the fastest motion along a path, from rest to rest.

    Args:
        arm: The arm; its joint speed and torque limits apply.
        context: Plant context; the tool's joints count as they are in it.
        path: Where to go.
        velocity_scale: Share of the speed limits.
        acceleration_limit: Of every joint [rad/s2].
        payload: What the tool holds, about and in the flange frame.
    """
    if len(path.waypoints) == 1:
        return JointMotion(np.zeros(1), path.waypoints, np.zeros((1, arm.dof)))
    plant = _arm_alone(arm, context, payload)
    curve = path.curve()
    toppra = Toppra(curve, plant, _grid(curve))
    speed = velocity_scale * plant.GetVelocityUpperLimits()
    toppra.AddJointVelocityLimit(-speed, speed)
    toppra.AddJointAccelerationLimit(
        *(sign * np.full(arm.dof, acceleration_limit) for sign in (-1, 1))
    )
    toppra.AddJointTorqueLimit(*(sign * TORQUE_SHARE * arm.effort_limits for sign in (-1, 1)))
    progress = toppra.SolvePathParameterization()
    if progress is None:
        raise NoTiming(arm.name, path.length)
    return _sampled(curve, progress)


def _arm_alone(arm: Arm, context: Context, payload: SpatialInertia | None) -> MultibodyPlant:
    """Return the arm with tool and payload as one lump, standing as it does in the cell."""
    plant = MultibodyPlant(time_step=0.0)
    (instance,) = new_parser(plant).AddModelsFromUrl(model_url(arm.model.sdf))
    base = plant.GetFrameByName(arm.model.base_frame, instance)
    X_WB = arm.plant.GetFrameByName(arm.model.base_frame, arm.instance).CalcPoseInWorld(context)
    plant.WeldFrames(plant.world_frame(), base, X_WB)
    lump = plant.AddRigidBody("lump", instance, _tool_inertia(arm, context, payload))
    plant.WeldFrames(plant.GetFrameByName(arm.model.flange_frame, instance), lump.body_frame())
    plant.Finalize()
    return plant


def _tool_inertia(arm: Arm, context: Context, payload: SpatialInertia | None) -> SpatialInertia:
    """Return the spatial inertia of tool and payload about and in the flange frame."""
    flange = arm.plant.GetFrameByName(arm.model.flange_frame, arm.instance)
    bodies = arm.plant.GetBodyIndices(arm.tool_instance)
    inertia = arm.plant.CalcSpatialInertia(context, flange, bodies)
    if payload is not None:
        inertia += payload
    return inertia


def _grid(curve: PiecewisePolynomial) -> np.ndarray:
    """Return the points at which the limits are imposed.

    The second derivative jumps between segments, so each segment has points of its own just inside
    both of its ends.
    """
    breaks = np.asarray(curve.get_segment_times())
    points = [breaks[:1]]
    for start, end in zip(breaks[:-1], breaks[1:], strict=True):
        inset = INSET * (end - start)
        count = max(int(np.ceil((end - start) / GRID_STEP)), 2) + 1
        points.append(np.linspace(start + inset, end - inset, count))
    return np.concatenate([*points, breaks[-1:]])


def _sampled(curve: PiecewisePolynomial, progress: PiecewisePolynomial) -> JointMotion:
    """Return the curve at regular times, given the distance s(t) travelled on it."""
    start, end = progress.start_time(), progress.end_time()
    time = np.linspace(start, end, int(np.ceil((end - start) / SAMPLE_PERIOD)) + 1)
    s = np.clip(progress.vector_values(time)[0], curve.start_time(), curve.end_time())
    rate = progress.derivative().vector_values(time)[0]
    q = curve.vector_values(s).T
    v = curve.derivative().vector_values(s).T * rate[:, None]
    v[[0, -1]] = 0.0
    return JointMotion(time - start, q, v)
