"""How fast a path can be run: the fastest timing within the limits of arm, wrist and tool.

The arm limits speed, acceleration and torque of its joints. The wrist limits how hard tool and
payload are thrown about, so that a faster arm neither strains the sensor nor the grip. Beside
parts, a point of the tool has a speed limit as well.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.optimization import Toppra
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, Frame, SpatialInertia
from pydrake.systems.framework import Context
from pydrake.trajectories import PiecewisePolynomial

from cell.errors import RunFailure
from cell.machines.arm import Arm
from cell.paths import model_url, new_parser
from cell.simulation.vocabulary import in_programs
from planning.motion.joint_path import JointPath

GRID_STEP = 0.05  # Between two points at which the limits are imposed [rad] [A].
INSET = 1e-3  # Of the outermost of these points of a segment, as a share of its length.
SAMPLE_PERIOD = 0.005  # Of the resulting motion [s] [A].
CENTRE, POINT = "centre", "point"  # Frames of tool and payload as one lump.
ANY_TURN = 1e4  # Angular acceleration that no arm reaches [rad/s2].
TORQUE_SHARE = 0.9  # Of the torque limits; the rest is for the feedback [A].


class NoTiming(RunFailure):
    """A path that cannot be run within the limits."""

    def __init__(self, arm: str, length: float) -> None:
        super().__init__(
            f"The {arm} arm cannot run a path of {length:.2f} rad within its speed, acceleration "
            "and torque limits: gravity alone may exceed them, or the payload is too heavy."
        )


@dataclass(frozen=True)
class Pace:
    """What a motion keeps to, besides the torque limits of the joints.

    Attributes:
        velocity_scale: Share of the joints' speed limits.
        acceleration_limit: Of every joint [rad/s2].
        wrist_force: Force with which tool and payload are accelerated, along each axis of W [N].
        ramp_time: In which an acceleration rises or falls [s], above 0.
    """

    velocity_scale: float
    acceleration_limit: float
    wrist_force: float
    ramp_time: float


@dataclass(frozen=True)
class SpeedLimit:
    """How fast a point of the tool may go.

    Attributes:
        frame: Of the tool; its origin is the point.
        speed: [m/s].
    """

    frame: Frame
    speed: float


@in_programs
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

    @staticmethod
    def joined(motions: Iterable[JointMotion]) -> JointMotion:
        """Return motions one after the other; each begins where the one before ends."""
        first, *others = motions
        time, q, v = [first.time], [first.q], [first.v]
        for motion in others:
            time.append(time[-1][-1] + motion.time[1:])
            q.append(motion.q[1:])
            v.append(motion.v[1:])
        return JointMotion(np.concatenate(time), np.concatenate(q), np.concatenate(v))

    def delayed(self, delay: float) -> JointMotion:
        """Return the motion after a wait at its start [s], at least 0."""
        if delay == 0.0:
            return self
        time = np.concatenate([[0.0], self.time + delay])
        return JointMotion(
            time, self.q[[0, *range(len(self.q))]], np.vstack([0 * self.v[:1], self.v])
        )

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
    pace: Pace,
    *,
    payload: SpatialInertia | None = None,
    tool_limit: SpeedLimit | None = None,
) -> JointMotion:
    """Return the fastest motion along a path, from rest to rest.

    Where that is too hard for the solver, the motion stops at every waypoint.

    Args:
        arm: The arm; its joint speed and torque limits apply.
        context: Plant context; the tool's joints count as they are in it.
        path: Where to go.
        pace: Further limits.
        payload: What the tool holds, about and in the flange frame.
        tool_limit: Of a point of the tool; None: as fast as the rest allows.

    Raises:
        NoTiming: It cannot be run within the limits.
    """
    if len(path.waypoints) == 1:
        return JointMotion(np.zeros(1), path.waypoints, np.zeros((1, arm.dof)))
    inertia = _tool_inertia(arm, context, payload)
    plant = _arm_alone(arm, context, inertia, tool_limit)
    curve = path.curve()
    toppra = Toppra(curve, plant, _grid(curve))
    speed = pace.velocity_scale * plant.GetVelocityUpperLimits()
    toppra.AddJointVelocityLimit(-speed, speed)
    joints = np.full(arm.dof, pace.acceleration_limit)
    toppra.AddJointAccelerationLimit(-joints, joints)
    toppra.AddJointTorqueLimit(*(sign * TORQUE_SHARE * arm.effort_limits for sign in (-1, 1)))
    throw = np.full(3, pace.wrist_force / inertia.get_mass())
    most = np.concatenate([np.full(3, ANY_TURN), throw])
    toppra.AddFrameAccelerationLimit(plant.GetFrameByName(CENTRE), -most, most)
    if tool_limit is not None:
        toppra.AddFrameTranslationalSpeedLimit(plant.GetFrameByName(POINT), tool_limit.speed)
    progress = toppra.SolvePathParameterization()
    if progress is not None:
        return _sampled(curve, progress, pace.ramp_time)
    if len(path.waypoints) == 2:
        raise NoTiming(arm.name, path.length)
    # Beside a segment of a fraction of a milliradian, a corner is too sharp for the solver.
    return JointMotion.joined(
        time_path(
            arm,
            context,
            JointPath.through(path.waypoints[k : k + 2], 0.0),
            pace,
            payload=payload,
            tool_limit=tool_limit,
        )
        for k in range(len(path.waypoints) - 1)
    )


def _arm_alone(
    arm: Arm, context: Context, inertia: SpatialInertia, tool_limit: SpeedLimit | None
) -> MultibodyPlant:
    """Return the arm with tool and payload as one lump, standing as it does in the cell.

    Frames of the lump: its mass centre, and the point whose speed is limited.
    """
    plant = MultibodyPlant(time_step=0.0)
    parser, text = new_parser(plant), _without_shapes(arm.model.sdf)
    (instance,) = (
        parser.AddModelsFromUrl(model_url(arm.model.sdf))
        if text is None
        else parser.AddModelsFromString(*text)
    )
    base = plant.GetFrameByName(arm.model.base_frame, instance)
    X_WB = arm.plant.GetFrameByName(arm.model.base_frame, arm.instance).CalcPoseInWorld(context)
    plant.WeldFrames(plant.world_frame(), base, X_WB)
    lump = plant.AddRigidBody("lump", instance, inertia)
    plant.WeldFrames(plant.GetFrameByName(arm.model.flange_frame, instance), lump.body_frame())
    frames = {CENTRE: RigidTransform(inertia.get_com())}
    if tool_limit is not None:
        flange = arm.plant.GetFrameByName(arm.model.flange_frame, arm.instance)
        frames[POINT] = tool_limit.frame.CalcPose(context, flange)
    for name, X_LF in frames.items():
        plant.AddFrame(FixedOffsetFrame(name, lump.body_frame(), X_LF, instance))
    plant.Finalize()
    return plant


@cache
def _without_shapes(model: str) -> tuple[str, str] | None:
    """Return the text of a model file without what is seen and touched, and its type.

    A motion needs the dynamics only, and shapes take nine tenths of the time to read a model. None:
    the file includes others, which are found from its own place only.
    """
    package_map = new_parser(MultibodyPlant(time_step=0.0)).package_map()
    path = Path(package_map.ResolveUrl(model_url(model)))
    namespaces = dict(event for _, event in ElementTree.iterparse(path, ["start-ns"]))
    for prefix, uri in namespaces.items():
        ElementTree.register_namespace(prefix, uri)
    root = ElementTree.parse(path).getroot()
    if root.find(".//include") is not None:
        return None
    for link in root.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    return ElementTree.tostring(root, encoding="unicode"), path.suffix.removeprefix(".")


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


def _sampled(
    curve: PiecewisePolynomial, progress: PiecewisePolynomial, ramp_time: float
) -> JointMotion:
    """Return the curve at regular times, given the distance s(t) travelled on it.

    The distance is averaged over the ramp time that has just passed: the way stays the same, and an
    acceleration that would jump rises evenly over that time. Out of a corner of the way it may then
    pass the limits by 3 %.
    """
    start, duration = progress.start_time(), progress.end_time() - progress.start_time()
    period = min(SAMPLE_PERIOD, ramp_time) / 5
    grid = np.linspace(
        -ramp_time, duration + ramp_time, int(np.ceil((duration + 2 * ramp_time) / period)) + 1
    )
    distance = progress.vector_values(start + np.clip(grid, 0.0, duration))[0]
    area = np.concatenate([[0.0], np.cumsum(np.diff(grid) * (distance[1:] + distance[:-1]) / 2)])
    end = duration + ramp_time
    time = np.linspace(0.0, end, int(np.ceil(end / SAMPLE_PERIOD)) + 1)

    def change(values: np.ndarray) -> np.ndarray:
        now, before = np.interp(time, grid, values), np.interp(time - ramp_time, grid, values)
        return (now - before) / ramp_time

    s = np.clip(change(area), curve.start_time(), curve.end_time())
    s[[0, -1]] = curve.start_time(), curve.end_time()
    q = curve.vector_values(s).T
    v = curve.derivative().vector_values(s).T * change(distance)[:, None]
    v[[0, -1]] = 0.0
    return JointMotion(time, q, v)
