"""What operations plan with: sensed poses in, collision-free timed motions of the arms out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.geometry import Convex, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import Frame, SpatialInertia
from pydrake.systems.framework import Context

from cell.builder import Cell, add_arms, add_workcell
from cell.configuration.config import CellConfig
from cell.machines.arm import Arm
from cell.products.product import Part, Product
from cell.workpieces.parts import add_parts
from planning.motion.collision_model import CollisionModel, Surroundings
from planning.motion.joint_path import JointPath
from planning.motion.kinematics import Unreachable, ik_solutions, tool_pose
from planning.motion.paths import plan_line, plan_path
from planning.motion.timing import JointMotion, time_path

FINE_CLEARANCE = 5e-4  # Kept next to neighbours of a hole; smaller than any gap there [m] [A].
SINGULAR_SINE = 0.2  # Of wrist 2 and of the elbow [A].
WOUND_UP = np.deg2rad(310.0)  # Joints turn by 360 degrees either way [A].


def collision_model(config: CellConfig, product: Product) -> CollisionModel:
    """Return the planning copy of a cell, with the inflated bag as an obstacle."""

    def populate(plant: MultibodyPlant, scene_graph: SceneGraph) -> Mapping[str, Arm]:
        _, jig_base = add_workcell(plant, config, product)
        plant.RegisterCollisionGeometry(
            jig_base, RigidTransform(), _cap(config), "bag", CoulombFriction(1.0, 1.0)
        )
        left, right = add_arms(plant, config)
        add_parts(plant, scene_graph, product, config.workcell.X_WT)
        return {"left": left, "right": right}

    motion = config.motion
    return CollisionModel(
        populate,
        arm_clearance=motion.arm_clearance,
        obstacle_clearance=motion.obstacle_clearance,
        hand=("left", "tip"),
    )


def _cap(config: CellConfig) -> Convex:
    """Return the convex hull of the inflated bag, in J."""
    bag = config.jig.bag
    angles = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
    rings = []
    for height in np.linspace(0.0, bag.cap_height, 5):
        below_centre = bag.cap_radius - bag.cap_height + height
        radius = np.sqrt(max(bag.cap_radius**2 - below_centre**2, 0.0))
        ring = [radius * np.cos(angles), radius * np.sin(angles), np.full(16, height)]
        rings.append(np.array(ring))
    return Convex(points=np.hstack(rings), label="bag")


@dataclass
class Station:
    """The planner's view of a running cell.

    Attributes:
        cell: The cell.
        context: Plant context, only read: joint angles of arms and tools.
        sense: Returns the sensed pose X_WP of a part.
        seed: Seeds every sampling planner, together with the number of the call.
        nominal: What the planner believes the cell to be; None: exactly as it was built.
        model: The planning copy.
        held: Name of the part in the left hand; None when it is empty.
        riders: Names of the parts that lie loose on the one in the hand.
        fixed: Names of the parts that the jig holds, with what has been mated to them.
        origins: By name of a part, the sensed pose X_WP from which it was taken to the jig.
        held_opening: Opening of the tip pads when it was gripped [m].
    """

    cell: Cell
    context: Context
    sense: Callable[[str], RigidTransform]
    seed: int
    nominal: CellConfig | None = None
    model: CollisionModel = field(init=False)
    held: str | None = None
    riders: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    origins: dict[str, RigidTransform] = field(default_factory=dict)
    held_opening: float = 0.0
    _calls: int = 0

    def __post_init__(self) -> None:
        self.model = collision_model(self.config, self.cell.product)

    @property
    def config(self) -> CellConfig:
        """Configuration of the cell, as far as the planner knows."""
        return self.cell.config if self.nominal is None else self.nominal

    def part(self, name: str) -> Part:
        """Return a part's description."""
        return self.cell.product.parts[name]

    def arm(self, name: str) -> Arm:
        """Return an arm."""
        return self.cell.arms[name]

    @property
    def in_hand(self) -> tuple[str, ...]:
        """Names of the part in the left hand and of what rides on it."""
        return () if self.held is None else (self.held, *self.riders)

    def pose(self, arm: str, frame: str) -> RigidTransform:
        """Return the pose of a tool frame as it is now."""
        return self.arm(arm).frame(frame).CalcPoseInWorld(self.context)

    def surroundings(
        self, may_touch: Iterable[tuple[str, str]] = (), clearance: float | None = None
    ) -> Surroundings:
        """Return everything as it is sensed now."""
        plant, cell = self.cell.plant, self.cell
        names = [part.part.name for part in cell.parts]
        X_HandW = self.pose("left", "tip").inverse()
        return Surroundings(
            arms={arm.name: arm.positions(self.context) for arm in cell.arms.values()},
            tools={"left_tool": plant.GetPositions(self.context, cell.left.tool)},
            X_WP={name: self.sense(name) for name in names if name not in self.in_hand},
            X_HandP={name: X_HandW @ self.sense(name) for name in self.in_hand},
            may_touch=tuple(may_touch),
            obstacle_clearance=clearance,
        )

    def configurations(
        self,
        arm: str,
        frame: Frame,
        X_WF: RigidTransform,
        near: np.ndarray,
        may_touch: Iterable[tuple[str, str]] = (),
        clearance: float | None = None,
    ) -> list[np.ndarray]:
        """Return the collision-free joint angles that put a tool frame at a pose, nearest first."""
        self.model.arrange(self.surroundings(may_touch, clearance))
        solutions = ik_solutions(self.arm(arm), self.context, frame, X_WF, near)
        return [q for q in solutions if is_regular(q) and self.model.is_free(arm, q)]

    def configuration(
        self,
        arm: str,
        frame: Frame,
        X_WF: RigidTransform,
        near: np.ndarray,
        may_touch: Iterable[tuple[str, str]] = (),
        clearance: float | None = None,
    ) -> np.ndarray:
        """Return the nearest of the `configurations` (6,).

        Raises:
            Unreachable: There is none.
        """
        for q in self.configurations(arm, frame, X_WF, near, may_touch, clearance):
            return q
        raise Unreachable(arm, frame.name(), X_WF, "out of reach, or every way there collides")

    def move(
        self,
        arm: str,
        q_goal: np.ndarray,
        may_touch: Iterable[tuple[str, str]] = (),
        clearance: float | None = None,
    ) -> JointMotion:
        """Return a collision-free motion from where the arm is to ``q_goal`` (6,)."""
        self.model.arrange(self.surroundings(may_touch, clearance))
        self._calls += 1
        path = plan_path(
            self.model,
            arm,
            self.arm(arm).positions(self.context),
            q_goal,
            seed=self.seed * 1009 + self._calls,
            max_iterations=self.config.motion.max_iterations,
        )
        return self._timed(arm, path)

    def line(
        self,
        arm: str,
        frame: Frame,
        X_WGoal: RigidTransform,
        *,
        speed: float,
        q_start: np.ndarray | None = None,
    ) -> JointMotion:
        """Return the motion that takes a tool frame straight to a pose.

        Only the arms are kept apart on it: it is meant for the last stretch before a contact.

        Args:
            arm: Name of the arm.
            frame: Of its tool.
            X_WGoal: Where the frame goes.
            speed: Largest mean speed of the frame's origin [m/s].
            q_start: (6,) where it begins; None: where the arm is.
        """
        arm_ = self.arm(arm)
        q_start = arm_.positions(self.context) if q_start is None else q_start
        self.model.arrange(self.surroundings([(f"{arm}_tool", "*"), ("held", "*")]))
        path = plan_line(arm_, self.context, frame, q_start, X_WGoal)
        start = tool_pose(arm_, self.context, frame, q_start)
        distance = float(np.linalg.norm(X_WGoal.translation() - start.translation()))
        return slowed(self._timed(arm, path), distance / speed)

    def _timed(self, arm: str, path: JointPath) -> JointMotion:
        motion = self.config.motion
        return time_path(
            self.arm(arm),
            self.context,
            path,
            velocity_scale=motion.velocity_scale,
            acceleration_limit=motion.acceleration_limit,
            payload=self._payload() if arm == "left" else None,
        )

    def _payload(self) -> SpatialInertia | None:
        """Return what hangs on the left hand, about and in its flange frame."""
        if self.held is None:
            return None
        plant = self.cell.plant
        flange = plant.GetFrameByName("flange", self.cell.left.instance)
        bodies = [self.cell.parts[name].body.index() for name in self.in_hand]
        return plant.CalcSpatialInertia(self.context, flange, bodies)


def is_regular(q: np.ndarray) -> bool:
    """Return whether the arm is well away from its singularities and from winding itself up.

    Close to a singularity of wrist or elbow, a straight line of the tool asks for large turns of
    the joints; close to a joint limit it cannot go on.
    """
    singular = min(abs(np.sin(q[4])), abs(np.sin(q[2]))) < SINGULAR_SINE
    return bool(not singular and np.max(np.abs(q)) < WOUND_UP)


def slowed(motion: JointMotion, duration: float) -> JointMotion:
    """Return the motion stretched to last at least ``duration`` [s]."""
    factor = duration / motion.duration if motion.duration > 0 else 1.0
    if factor <= 1.0:
        return motion
    return replace(motion, time=motion.time * factor, v=motion.v / factor)
