"""Which joint angles of an arm are free of collision, in a copy of the cell made for planning.

The copy is built once. Where everything stands is then set by one value, `Surroundings`: the other
arm, the jaws, the loose parts, what is in the hand, and which pairs may come close to each other.
A held part is not a body of its own here: its shapes hang on an empty body welded to the hand, so
that they move with the arm. Every mesh counts as its convex hull, so holes are filled.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np
from pydrake.common import Parallelism
from pydrake.geometry import Role, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    ModelInstanceIndex,
    QuaternionFloatingJoint,
    RigidBody,
    SpatialInertia,
)
from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker
from pydrake.systems.framework import Context

from cell.errors import UnknownName
from cell.machines.arm import Arm

HELD = "held"  # Stands for what is in the hand.
MOUNT = "mount"  # The frame of every tool that is on the flange.
ANYTHING = "*"
# Parts that are not placed wait here, out of everyone's way [m].
AWAY = RigidTransform([0.0, 0.0, -100.0])
# Configurations along a motion are checked this far apart [rad]: the tip of a stretched arm then
# moves 17 mm, less than any tool's or part's size plus its clearance [D].
EDGE_STEP = 0.02


@dataclass(frozen=True)
class Surroundings:
    """Everything that stands still, or hangs on the hand, while one arm moves.

    Attributes:
        arms: Joint angles (dof,) of each arm that is not the moving one; arms left out are at home.
        tools: Joint positions of each tool by model instance, for example
            ``{"<arm>_tool": [s/2, s/2]}``; tools left out are at their default.
        X_WP: Pose of each loose part that stands in the cell; parts left out are not there.
        X_HandP: Pose of each held part in the model's hand frame.
        may_touch: Pairs that are not checked: model instances, "held" for what is in the hand,
            "*" for anything.
        obstacle_clearance: Least distance between a robot and anything that is not one [m];
            None: the model's.
    """

    arms: Mapping[str, np.ndarray] = field(default_factory=dict)
    tools: Mapping[str, Sequence[float] | np.ndarray] = field(default_factory=dict)
    X_WP: Mapping[str, RigidTransform] = field(default_factory=dict)
    X_HandP: Mapping[str, RigidTransform] = field(default_factory=dict)
    may_touch: Iterable[tuple[str, str]] = ()
    obstacle_clearance: float | None = None


class CollisionModel:
    """The planning copy of the cell and its collision checker.

    Args:
        populate: Adds arms, tools, surroundings and loose parts to a plant that is not finalized
            yet and returns the arms by name. A loose part is a free body alone in its model
            instance and goes by that instance's name.
        arm_clearance: Least distance between robots [m].
        obstacle_clearance: Least distance between a robot and anything that is not one [m].
        hand: Name of the arm that holds parts, and the frame of its tool in which their poses are
            given.
    """

    def __init__(
        self,
        populate: Callable[[MultibodyPlant, SceneGraph], Mapping[str, Arm]],
        *,
        arm_clearance: float,
        obstacle_clearance: float,
        hand: tuple[str, str],
    ) -> None:
        builder = RobotDiagramBuilder()
        self.plant = builder.plant()
        self.arms = populate(self.plant, builder.scene_graph())
        self._held = _add_held_body(self.plant, self.arms[hand[0]], hand[1])
        self._hand = self.arms[hand[0]]
        self._clearances = (arm_clearance, obstacle_clearance)
        robots = [index for arm in self.arms.values() for index in _instances(self.plant, arm)]
        with _quiet_drake():
            self._checker = SceneGraphCollisionChecker(
                model=builder.Build(),
                robot_model_instances=robots,
                edge_step_size=EDGE_STEP,
                env_collision_padding=0.0,
                self_collision_padding=0.0,
                configuration_distance_function=_largest_turn,
                implicit_context_parallelism=Parallelism(num_threads=1),
            )
        self._parts = _free_joints(self.plant)
        self._q = self._checker.plant().GetPositions(self.context).copy()
        self._filter = self._checker.GetNominalFilteredCollisionMatrix()
        self.arrange(Surroundings())

    @property
    def context(self) -> Context:
        """Plant context of the copy, as of the latest check: good for frames within a tool."""
        return self._checker.plant_context()

    @property
    def part_names(self) -> tuple[str, ...]:
        """Names of the loose parts of the copy."""
        return tuple(self._parts)

    def arrange(self, surroundings: Surroundings) -> None:
        """Put everything in its place; holds for all checks until the next call."""
        self._q = self._positions(surroundings)
        self._checker.RemoveAllAddedCollisionShapes(HELD)
        for name, X_HandP in surroundings.X_HandP.items():
            self._hang(self._part(name).child_body(), X_HandP)
        self._checker.SetCollisionFilterMatrix(self._filter_matrix(surroundings.may_touch))
        arm_clearance, obstacle_clearance = self._clearances
        if surroundings.obstacle_clearance is not None:
            obstacle_clearance = surroundings.obstacle_clearance
        self._checker.SetPaddingMatrix(self._padding(arm_clearance, obstacle_clearance))

    def is_free(self, arm: str, q: np.ndarray) -> bool:
        """Return whether the arm at ``q`` (dof,) keeps its clearances."""
        return self.are_free({arm: q})

    def are_free(self, q: Mapping[str, np.ndarray]) -> bool:
        """Return whether arms keep their clearances with each at its joint angles (dof,)."""
        return self._checker.CheckConfigCollisionFree(self._full(q))

    def is_edge_free(self, arm: str, q_from: np.ndarray, q_to: np.ndarray) -> bool:
        """Return whether the arm keeps its clearances on the straight way in joint space."""
        return self._checker.CheckEdgeCollisionFree(
            self._full({arm: q_from}), self._full({arm: q_to})
        )

    def collisions(self, arm: str, q: np.ndarray) -> tuple[str, ...]:
        """Return which bodies come too close at ``q``: "left_tool palm - tray (-3.2 mm)" ..."""
        reach = max(self._checker.GetLargestPadding(), 0.0) + 1e-6
        clearance = self._checker.CalcRobotClearance(self._full({arm: q}), reach)
        nearest: dict[tuple[str, str], float] = {}
        for one, other, distance in zip(
            clearance.robot_indices(), clearance.other_indices(), clearance.distances(), strict=True
        ):
            if distance <= self._checker.GetPaddingBetween(one, other):
                pair = self._label(one), self._label(other)
                nearest[pair] = min(distance, nearest.get(pair, np.inf))
        return tuple(f"{a} - {b} ({d * 1e3:.1f} mm)" for (a, b), d in nearest.items())

    def _full(self, q: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the positions of the whole plant with some arms at other joint angles."""
        full = self._q.copy()
        for arm, q_arm in q.items():
            if arm not in self.arms:
                raise UnknownName("arm", arm, self.arms)
            self.plant.SetPositionsInArray(self.arms[arm].instance, q_arm, full)
        return full

    def _positions(self, surroundings: Surroundings) -> np.ndarray:
        """Return the positions of the whole plant with all arms where the surroundings say."""
        plant, context = self.plant, self.plant.CreateDefaultContext()
        for arm in self.arms.values():
            plant.SetPositions(context, arm.instance, surroundings.arms.get(arm.name, arm.home))
        for name, q in surroundings.tools.items():
            plant.SetPositions(context, plant.GetModelInstanceByName(name), np.asarray(q))
        for name in surroundings.X_WP:
            self._part(name)
        for name, joint in self._parts.items():
            joint.SetPose(context, surroundings.X_WP.get(name, AWAY))
        return plant.GetPositions(context).copy()

    def _hang(self, part: RigidBody, X_HandP: RigidTransform) -> None:
        """Copy a part's collision shapes onto the hand."""
        inspector = self._checker.model().scene_graph().model_inspector()
        frame = self.plant.GetBodyFrameIdOrThrow(part.index())
        for shape_id in inspector.GetGeometries(frame, Role.kProximity):
            X_HandG = X_HandP @ inspector.GetPoseInFrame(shape_id)
            self._checker.AddCollisionShapeToBody(
                HELD, self._held, inspector.GetShape(shape_id), X_HandG
            )

    def _filter_matrix(self, may_touch: Iterable[tuple[str, str]]) -> np.ndarray:
        """Return the checker's filter matrix (1: not checked) with the allowed pairs added."""
        matrix = self._filter.copy()
        fingers = [int(index) for index in self.plant.GetBodyIndices(self._hand.tool_instance)]
        pairs = [(int(self._held.index()), index) for index in fingers]
        for one, other in may_touch:
            pairs += product(self._indices(one), self._indices(other))
        for one, other in pairs:
            # Negative entries are fixed: pairs without a robot, and a body with itself.
            if matrix[one, other] >= 0:
                matrix[one, other] = matrix[other, one] = 1
        return matrix

    def _padding(self, between_arms: float, to_obstacles: float) -> np.ndarray:
        """Return the padding of all body pairs; none within one arm, whose shapes are generous."""
        owner = {
            int(index): arm.name
            for arm in self.arms.values()
            for instance in _instances(self.plant, arm)
            for index in self.plant.GetBodyIndices(instance)
        }
        padding = np.zeros((self.plant.num_bodies(),) * 2)
        for one, other in combinations(range(self.plant.num_bodies()), 2):
            owners = {owner.get(one), owner.get(other)}
            if len(owners) == 2:
                value = to_obstacles if None in owners else between_arms
                padding[one, other] = padding[other, one] = value
        return padding

    def _indices(self, name: str) -> list[int]:
        """Return the indices of the bodies that a name of ``may_touch`` stands for."""
        held = int(self._held.index())
        if name == HELD:
            return [held]
        if name == ANYTHING:
            return list(range(self.plant.num_bodies()))
        if not self.plant.HasModelInstanceNamed(name):
            raise UnknownName("model in the cell", name, [*self._instances(), HELD, ANYTHING])
        instance = self.plant.GetModelInstanceByName(name)
        return [int(i) for i in self.plant.GetBodyIndices(instance) if int(i) != held]

    def _part(self, name: str) -> QuaternionFloatingJoint:
        if name not in self._parts:
            raise UnknownName("part in the cell", name, self._parts)
        return self._parts[name]

    def _instances(self) -> list[str]:
        indices = map(ModelInstanceIndex, range(self.plant.num_model_instances()))
        return [self.plant.GetModelInstanceName(index) for index in indices]

    def _label(self, index: BodyIndex) -> str:
        """Return "instance body", or the instance alone where that says it all."""
        body = self.plant.get_body(index)
        if body.index() == self._held.index():
            return HELD
        instance = self.plant.GetModelInstanceName(body.model_instance())
        alone = len(self.plant.GetBodyIndices(body.model_instance())) == 1
        return instance if alone else f"{instance} {body.name()}"


@contextmanager
def _quiet_drake() -> Iterator[None]:
    """Keep Drake's remark on the number of contexts off the terminal."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        yield
    finally:
        logger.setLevel(level)


def _instances(plant: MultibodyPlant, arm: Arm) -> list[ModelInstanceIndex]:
    """Return the model instances of an arm: its own, its tool's, and those of what that carries."""
    mount = plant.GetFrameByName(MOUNT, arm.tool_instance).body()
    carried = {body.model_instance() for body in plant.GetBodiesWeldedTo(mount)}
    own = [arm.instance, arm.tool_instance]
    return own + sorted(carried - set(own), key=int)


def _add_held_body(plant: MultibodyPlant, arm: Arm, frame: str) -> RigidBody:
    """Add an empty body welded to the hand; the shapes of held parts are hung on it."""
    inertia = SpatialInertia.SolidSphereWithMass(1e-3, 1e-3)  # No dynamics in the planning copy.
    body = plant.AddRigidBody(HELD, arm.tool_instance, inertia)
    plant.WeldFrames(arm.frame(frame), body.body_frame())
    return body


def _free_joints(plant: MultibodyPlant) -> dict[str, QuaternionFloatingJoint]:
    """Return the joint of every free body, by the name of its model instance."""
    joints = map(plant.get_joint, plant.GetJointIndices())
    return {
        plant.GetModelInstanceName(joint.child_body().model_instance()): joint
        for joint in joints
        if isinstance(joint, QuaternionFloatingJoint)
    }


def _largest_turn(q_from: np.ndarray, q_to: np.ndarray) -> float:
    """Return the distance that edges are stepped by: the largest change of any joint."""
    return float(np.max(np.abs(q_to - q_from)))
