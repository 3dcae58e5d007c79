"""What operations plan with: believed poses in, collision-free timed motions of the arms out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import InitVar, dataclass, field

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import Frame, SpatialInertia
from pydrake.systems.framework import Context

from cell.builder import Cell
from cell.configuration.config import CellConfig
from cell.machines.arm import Arm, Unreachable
from cell.products.product import Part
from planning.motion.collision_model import CollisionModel, Surroundings
from planning.motion.joint_path import JointPath
from planning.motion.paths import plan_line, plan_path
from planning.motion.timing import JointMotion, Pace, SpeedLimit, time_path
from planning.motion.together import delayed_beside, keep_apart
from planning.operations.planning_copy import collision_model
from planning.perception.belief import Belief, Source, State

FINE_CLEARANCE = 5e-4  # Kept next to neighbours of a hole; smaller than any gap there [m] [A].
UNFELT = 0.2  # Share of a force under which it is not taken for that force [A].
ANY_OVERLAP = -1.0  # As a clearance: parts and surroundings are not checked [m].
FIXTURE = "jig_base"  # The model instance that carries the fixture.
SAVED = "station/"  # Before the names in a saved state.
TUPLES = ("riders", "fixed", "driven", "recoveries")  # Of texts.


@dataclass(frozen=True)
class Placement:
    """Where on the fixture a part is meant to go: a pose that suits all arms.

    Attributes:
        yaw: About the vertical [rad].
        X_WP: Pose of the part while it hovers over the fixture.
        q: Joint angles (n,) of the holder there [rad].
    """

    yaw: float
    X_WP: RigidTransform
    q: np.ndarray


@dataclass
class Station:
    """The planner's view of a running cell.

    Attributes:
        cell: The cell.
        root: Context of the diagram, only read.
        source: How it sees where parts are.
        seed: Seeds every sampling planner, together with the number of the call.
        nominal: What the planner believes the cell to be; None: exactly as it was built.
        planning_copy: That of a cell with the same arms, parts and surroundings; None: a new one.
        context: Context of the plant, only read: joint angles of arms and tools.
        belief: Where the parts are, as far as it knows.
        model: The planning copy.
        held: Name of the part in the hand; None when it is empty.
        riders: Names of the parts that lie loose on the one in the hand.
        fixed: Names of the parts that the fixture holds, with what has been mated to them.
        driven: Names of the bolts that the driver has run into their threads.
        recoveries: What did not come out as planned, and what was done about it, in words.
        origins: By name of a part, the pose X_WP from which it was taken to the fixture.
        placements: By name of a part, where on the fixture it was meant to go.
        held_opening: Opening of the tip pads when it was gripped [m].
    """

    cell: Cell
    root: Context
    source: Source
    seed: int
    nominal: CellConfig | None = None
    planning_copy: InitVar[CollisionModel | None] = None
    context: Context = field(init=False)
    belief: Belief = field(init=False)
    model: CollisionModel = field(init=False)
    held: str | None = None
    riders: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    driven: tuple[str, ...] = ()
    recoveries: tuple[str, ...] = ()
    origins: dict[str, RigidTransform] = field(default_factory=dict)
    placements: dict[str, Placement] = field(default_factory=dict)
    held_opening: float = 0.0
    _calls: int = 0

    def __post_init__(self, planning_copy: CollisionModel | None) -> None:
        self.context = self.cell.plant.GetMyContextFromRoot(self.root)
        self.belief = Belief(self.source, hand=lambda: self.tool_pose(self.holder, "tip"))
        self.model = planning_copy or collision_model(self.cell, self.config)

    @property
    def config(self) -> CellConfig:
        """Configuration of the cell, as far as the planner knows."""
        return self.cell.config if self.nominal is None else self.nominal

    @property
    def holder(self) -> Arm:
        """The arm that carries the gripper."""
        return self.cell.holder

    @property
    def driver(self) -> Arm:
        """The arm that carries the screwdriver."""
        return self.cell.driver

    @property
    def hand(self) -> str:
        """Name of the gripper's model, for pairs that may touch."""
        return f"{self.holder.name}_tool"

    def part(self, name: str) -> Part:
        """Return a part's description."""
        return self.cell.product.parts[name]

    # What is known of the parts.

    @property
    def in_hand(self) -> tuple[str, ...]:
        """Names of the part in the hand and of what rides on it."""
        return () if self.held is None else (self.held, *self.riders)

    def look(self, *parts: str) -> frozenset[str]:
        """Refresh the belief about some parts, or about all; everything must stand still.

        Returns:
            The names of those that were seen.
        """
        return self.belief.look(parts or [part.part.name for part in self.cell.parts])

    def pose_of(self, part: str) -> RigidTransform:
        """Return the believed pose X_WP of a part."""
        return self.belief.pose(part)

    def carry(self, part: str, riders: tuple[str, ...] = ()) -> None:
        """Take note that the hand holds a part, with others riding on it."""
        self.held, self.riders = part, riders
        self.belief.carry(self.in_hand)

    def put_down(self) -> None:
        """Take note that the hand has let go."""
        self.held, self.riders = None, ()
        self.belief.put_down()

    # Motions.

    def tool_pose(self, arm: Arm, frame: str) -> RigidTransform:
        """Return the pose of a frame of an arm's tool as it is now."""
        return arm.frame(frame).CalcPoseInWorld(self.context)

    def surroundings(
        self,
        may_touch: Iterable[tuple[str, str]] = (),
        clearance: float | None = None,
        elsewhere: Mapping[str, np.ndarray] | None = None,
    ) -> Surroundings:
        """Return everything as it is believed to be now, without parts that were never seen.

        Args:
            may_touch: Pairs that are not checked, see `Surroundings`.
            clearance: Least distance to what is not a robot [m]; None: the configured one.
            elsewhere: Joint positions (n,) of some arms by name, or of the hand, where they will
                not be what they are now.
        """
        context, elsewhere = self.context, elsewhere or {}
        jaws = self.cell.plant.GetPositions(context, self.holder.tool_instance)
        X_HandW = self.tool_pose(self.holder, "tip").inverse()
        others = [name for name in self.belief.estimates if name not in self.in_hand]
        return Surroundings(
            arms={n: elsewhere.get(n, a.positions(context)) for n, a in self.cell.arms.items()},
            tools={self.hand: elsewhere.get(self.hand, np.asarray(jaws))},
            X_WP={name: self.pose_of(name) for name in others},
            X_HandP={name: X_HandW @ self.pose_of(name) for name in self.in_hand},
            may_touch=tuple(may_touch),
            obstacle_clearance=clearance,
        )

    def configurations(
        self,
        arm: Arm,
        frame: Frame,
        X_WF: RigidTransform,
        near: np.ndarray,
        may_touch: Iterable[tuple[str, str]] = (),
        clearance: float | None = None,
        elsewhere: Mapping[str, np.ndarray] | None = None,
    ) -> list[np.ndarray]:
        """Return the collision-free joint angles (n,) [rad] with a tool frame at a pose.

        Args:
            arm: The arm.
            frame: Of its tool.
            X_WF: Where the frame shall be.
            near: (n,) joint angles; the nearest solution comes first.
            may_touch: Pairs that are not checked, see `Surroundings`.
            clearance: Least distance to what is not a robot [m]; None: the configured one.
            elsewhere: See `surroundings`.
        """
        self.model.arrange(self.surroundings(may_touch, clearance, elsewhere))
        solutions = arm.configurations(self.context, frame, X_WF, near)
        return [q for q in solutions if arm.model.is_regular(q) and self.model.is_free(arm.name, q)]

    def configuration(
        self,
        arm: Arm,
        frame: Frame,
        X_WF: RigidTransform,
        near: np.ndarray,
        may_touch: Iterable[tuple[str, str]] = (),
        clearance: float | None = None,
    ) -> np.ndarray:
        """Return the nearest of the `configurations` (n,) [rad].

        Raises:
            Unreachable: There is none.
        """
        for q in self.configurations(arm, frame, X_WF, near, may_touch, clearance):
            return q
        reason = "out of reach, or every way there collides"
        raise Unreachable(arm.name, frame.name(), X_WF, reason)

    def move(
        self,
        arm: Arm,
        q_goal: np.ndarray,
        may_touch: Iterable[tuple[str, str]] = (),
        clearance: float | None = None,
        elsewhere: Mapping[str, np.ndarray] | None = None,
        beside: Mapping[str, JointMotion] | None = None,
    ) -> JointMotion:
        """Return a collision-free motion from where the arm is to ``q_goal`` (n,) [rad].

        Args:
            arm: The arm.
            q_goal: Where to.
            may_touch: Pairs that are not checked, see `Surroundings`.
            clearance: Least distance to what is not a robot [m]; None: the configured one.
            elsewhere: See `surroundings`.
            beside: Motions of other arms, by name, that start together with this one; the arm waits
                at its start as long as it would come too close to them. None: all others stand.

        Raises:
            NoPath: None was found.
        """
        beside = beside or {}
        ends = {name: motion.q[-1] for name, motion in beside.items()}
        elsewhere = {**(elsewhere or {}), **ends}
        self.model.arrange(self.surroundings(may_touch, clearance, elsewhere))
        self._calls += 1
        path = plan_path(
            self.model,
            arm.name,
            arm.positions(self.context),
            q_goal,
            seed=self.seed * 1009 + self._calls,
            max_iterations=self.config.motion.max_iterations,
        )
        motion = self._timed(arm, path, self.config.motion.wrist_force)
        return delayed_beside(self.model, arm.name, motion, beside) if beside else motion

    def line(
        self,
        arm: Arm,
        frame: Frame,
        X_WGoal: RigidTransform,
        *,
        speed: float | None = None,
        felt: float | None = None,
        q_start: np.ndarray | None = None,
    ) -> JointMotion:
        """Return the motion that takes a tool frame straight to a pose.

        Collisions are not checked on it: it is meant for the last stretch before a contact.

        Args:
            arm: The arm.
            frame: Of its tool.
            X_WGoal: Where the frame goes.
            speed: Largest speed of the frame's origin [m/s]; None: that of tools beside parts.
            felt: Force at the wrist that the motion, or what follows it, is watched for [N]: the
                tool is thrown about with much less, for braking must not feel like touching.
            q_start: (n,) where it begins [rad]; None: where the arm is.

        Raises:
            Unreachable: A point of the line is out of reach.
            NoPath: The joints would have to jump.
        """
        q_start = arm.positions(self.context) if q_start is None else q_start
        path = plan_line(arm, self.context, frame, q_start, X_WGoal)
        motion = self.config.motion
        limit = SpeedLimit(frame, motion.tool_speed if speed is None else speed)
        throw = np.inf if felt is None else UNFELT * felt
        return self._timed(arm, path, min(throw, motion.wrist_force), limit)

    def clear_of_arms(self, arm: Arm, motion: JointMotion) -> bool:
        """Return whether a motion keeps the arm's clearance to the others, which stand still.

        Nothing else is checked: a straight line begins or ends beside parts.
        """
        self.model.arrange(self.surroundings(clearance=ANY_OVERLAP))
        return keep_apart(self.model, {arm.name: motion})

    def _timed(
        self, arm: Arm, path: JointPath, wrist_force: float, tool_limit: SpeedLimit | None = None
    ) -> JointMotion:
        motion = self.config.motion
        pace = Pace(motion.velocity_scale, motion.acceleration_limit, wrist_force, motion.ramp_time)
        payload = self._payload() if arm is self.holder else None
        return time_path(arm, self.context, path, pace, payload=payload, tool_limit=tool_limit)

    def _payload(self) -> SpatialInertia | None:
        """Return what hangs on the hand, about and in the flange frame; None if it is empty."""
        if self.held is None:
            return None
        arm, payload = self.holder, SpatialInertia.Zero()
        flange = self.cell.plant.GetFrameByName(arm.model.flange_frame, arm.instance)
        X_FW = flange.CalcPoseInWorld(self.context).inverse()
        for name in self.in_hand:
            X_FP = X_FW @ self.pose_of(name)
            inertia = self.cell.parts[name].body.default_spatial_inertia()
            payload += inertia.ReExpress(X_FP.rotation()).Shift(-X_FP.translation())
        return payload

    # Saving.

    def save(self) -> State:
        """Return everything that the planner remembers, as named arrays."""
        state: State = {f"belief/{name}": value for name, value in self.belief.save().items()}
        state["held"] = np.array(self.held or "", dtype=str)
        for name in TUPLES:
            state[name] = np.array(getattr(self, name), dtype=str)
        state["held_opening"], state["calls"] = np.array(self.held_opening), np.array(self._calls)
        for name, X_WP in self.origins.items():
            state[f"origin/{name}"] = X_WP.GetAsMatrix4()
        for name, placement in self.placements.items():
            state[f"placement/{name}/yaw"] = np.array(placement.yaw)
            state[f"placement/{name}/X_WP"] = placement.X_WP.GetAsMatrix4()
            state[f"placement/{name}/q"] = placement.q
        return {f"{SAVED}{name}": value for name, value in state.items()}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Return to what `save` returned; other names in the state are left alone."""
        own = _below(state, SAVED)
        self.belief.restore(_below(own, "belief/"))
        self.held = str(own["held"]) or None
        for name in TUPLES:
            setattr(self, name, tuple(str(part) for part in own[name]))
        self.held_opening, self._calls = float(own["held_opening"]), int(own["calls"])
        self.origins = {n: RigidTransform(X_WP) for n, X_WP in _below(own, "origin/").items()}
        placements = _below(own, "placement/")
        self.placements = {
            name: Placement(
                float(placements[f"{name}/yaw"]),
                RigidTransform(placements[f"{name}/X_WP"]),
                placements[f"{name}/q"],
            )
            for name in (key.removesuffix("/yaw") for key in placements if key.endswith("/yaw"))
        }


def _below(state: Mapping[str, np.ndarray], prefix: str) -> State:
    """Return the entries whose names begin with a prefix, without it."""
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
