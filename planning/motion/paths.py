"""Ways of an arm through the cell: around obstacles, and straight lines of its tool."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import ompl.base as ob
import ompl.geometric as og
import ompl.util as ou
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import Context

from cell.errors import RunFailure
from cell.machines.arm import Arm, Unreachable
from planning.motion.collision_model import EDGE_STEP, CollisionModel
from planning.motion.joint_path import JointPath

CORNER_RADIUS = 0.15  # Rounding of the corners of a planned path [rad] [A].
SHORTCUTS = 100  # Attempts to shorten a planned path [A].
# The search looks this far beyond the range of each joint between start and goal [rad] first,
# which keeps the arm from swinging around, and everywhere only when that fails [A].
NEIGHBOURHOOD = 1.0
LINE_STEP = 0.005  # Between two points of a straight line of the tool [m] [A].
LINE_TURN = 0.05  # The same for its orientation [rad] [A].
# A larger change of a joint between two points of a line is a flip to another branch [rad] [A].
LINE_JUMP = 0.3


class NoPath(RunFailure):
    """A motion that was not found, with what is in its way."""

    def __init__(self, arm: str, reason: str, evidence: tuple[str, ...] = ()) -> None:
        blocked = f" ({'; '.join(evidence)})" if evidence else ""
        super().__init__(f"No path for the {arm} arm: {reason}{blocked}.")
        self.evidence = evidence


def plan_path(
    model: CollisionModel,
    arm: str,
    q_start: np.ndarray,
    q_goal: np.ndarray,
    *,
    seed: int,
    max_iterations: int,
) -> JointPath:
    """Return a collision-free way between two configurations in the arranged surroundings.

    The straight way in joint space is taken when it is free; otherwise RRT-Connect searches and
    random shortcuts straighten its result. The same seed gives the same path.

    Args:
        model: The planning copy of the cell.
        arm: Name of the arm that moves.
        q_start: (dof,).
        q_goal: (dof,).
        seed: Of both random searches.
        max_iterations: Of RRT-Connect, per attempt.
    """
    for name, q in (("start", q_start), ("goal", q_goal)):
        if not model.is_free(arm, q):
            raise NoPath(arm, f"the {name} collides", model.collisions(arm, q))
    if model.is_edge_free(arm, q_start, q_goal):
        return JointPath.through(np.array([q_start, q_goal]), CORNER_RADIUS)
    waypoints = _search(model, arm, q_start, q_goal, seed, max_iterations)
    waypoints = _shortened(model, arm, waypoints, np.random.default_rng(seed))
    return _rounded(model, arm, waypoints)


def plan_line(
    arm: Arm,
    context: Context,
    frame: Frame,
    q_start: np.ndarray,
    X_WGoal: RigidTransform,
    *,
    is_free: Callable[[np.ndarray], bool] | None = None,
) -> JointPath:
    """Return the joint path that moves a tool frame straight, turning evenly, to a pose.

    Args:
        arm: The arm.
        context: Plant context; the tool's joints count as they are in it.
        frame: Of the tool.
        q_start: (dof,) where the line begins.
        X_WGoal: Where it ends.
        is_free: Which joint angles are acceptable; None: all.

    Raises:
        Unreachable: A point of the line is out of reach.
        NoPath: The joints would have to jump, or a point is not acceptable.
    """
    X_WStart = arm.tool_pose(context, frame, q_start)
    waypoints = [q_start]
    poses = straight_line(X_WStart, X_WGoal)
    for i, X_WT in enumerate(poses):
        where = f"at {100 * (i + 1) / len(poses):.0f} % of the straight line of '{frame.name()}'"
        solutions = arm.configurations(context, frame, X_WT, waypoints[-1])
        if not solutions:
            raise Unreachable(arm.name, frame.name(), X_WT, f"out of reach {where}")
        jump = np.abs(solutions[0] - waypoints[-1])
        if jump.max() > LINE_JUMP:
            joint = arm.joints[int(jump.argmax())].name()
            raise NoPath(arm.name, f"{joint} would jump by {jump.max():.2f} rad {where}")
        if is_free is not None and not is_free(solutions[0]):
            raise NoPath(arm.name, f"collision {where}")
        waypoints.append(solutions[0])
    return JointPath.through(np.array(waypoints), CORNER_RADIUS)


def straight_line(X_WStart: RigidTransform, X_WGoal: RigidTransform) -> list[RigidTransform]:
    """Return poses on the straight way, without the start and with the goal."""
    p0, p1 = X_WStart.translation(), X_WGoal.translation()
    Q0, Q1 = X_WStart.rotation().ToQuaternion(), X_WGoal.rotation().ToQuaternion()
    turn = (X_WStart.rotation().inverse() @ X_WGoal.rotation()).ToAngleAxis().angle()
    count = max(
        int(np.ceil(np.linalg.norm(p1 - p0) / LINE_STEP)), int(np.ceil(turn / LINE_TURN)), 1
    )
    inner = [
        RigidTransform(RotationMatrix(Q0.slerp(x, Q1)), (1 - x) * p0 + x * p1)
        for x in np.arange(1, count) / count
    ]
    return [*inner, X_WGoal]


def _search(
    model: CollisionModel,
    arm: str,
    q_start: np.ndarray,
    q_goal: np.ndarray,
    seed: int,
    max_iterations: int,
) -> np.ndarray:
    """Return (n, dof) waypoints found by RRT-Connect, near the endpoints if possible."""
    limits = model.arms[arm].joint_limits
    ends = np.array([q_start, q_goal])
    for margin in (NEIGHBOURHOOD, np.inf):
        lower = np.minimum(np.maximum(limits[0], ends.min(axis=0) - margin), ends.min(axis=0))
        upper = np.maximum(np.minimum(limits[1], ends.max(axis=0) + margin), ends.max(axis=0))
        found = _rrt_connect(
            lambda q: model.is_free(arm, q), ends, (lower, upper), seed, max_iterations
        )
        if found is not None:
            return found
    raise NoPath(arm, f"RRT-Connect found none in {max_iterations} iterations")


def _rrt_connect(
    is_free: Callable[[np.ndarray], bool],
    ends: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    seed: int,
    max_iterations: int,
) -> np.ndarray | None:
    """Run OMPL's planner, which stops after a number of iterations and never by the clock."""
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    ou.RNG.setSeed(seed + 1)  # Zero would be ignored.
    dof = ends.shape[1]
    space = ob.RealVectorStateSpace(dof)
    box = ob.RealVectorBounds(dof)
    for joint in range(dof):
        box.setLow(joint, float(bounds[0][joint]))
        box.setHigh(joint, float(bounds[1][joint]))
    space.setBounds(box)
    setup = og.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: is_free(_values(state, dof)))
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(EDGE_STEP / space.getMaximumExtent())
    setup.setPlanner(og.RRTConnect(information))
    setup.setStartAndGoalStates(_state(space, ends[0]), _state(space, ends[1]))
    setup.solve(_after(max_iterations))
    if not setup.haveExactSolutionPath():
        return None
    return np.array([_values(state, dof) for state in setup.getSolutionPath().getStates()])


# OMPL's type information leaves out that states of a real vector space are indexable.
def _values(state: Any, dof: int) -> np.ndarray:
    return np.array([state[joint] for joint in range(dof)])


def _state(space: ob.RealVectorStateSpace, q: np.ndarray) -> ob.State:
    state: Any = space.allocState()
    for joint, angle in enumerate(q):
        state[joint] = float(angle)
    return state


def _after(iterations: int) -> ob.PlannerTerminationCondition:
    """Return a condition that ends a search when it has been asked ``iterations`` times."""
    left = iter(range(iterations))
    return ob.PlannerTerminationCondition(lambda: next(left, None) is None)


def _shortened(
    model: CollisionModel, arm: str, waypoints: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Replace pieces between random points of the polyline by straight segments that are free."""
    for _ in range(SHORTCUTS):
        if len(waypoints) == 2:
            break
        lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
        marks = np.concatenate([[0.0], np.cumsum(lengths)])
        first, last = np.sort(rng.uniform(0.0, marks[-1], 2))
        a, b = _point(waypoints, marks, first), _point(waypoints, marks, last)
        i, j = np.searchsorted(marks, [first, last])
        if i < j and model.is_edge_free(arm, a, b):
            waypoints = np.concatenate([waypoints[:i], [a, b], waypoints[j:]])
    return _pruned(model, arm, waypoints)


def _pruned(model: CollisionModel, arm: str, waypoints: np.ndarray) -> np.ndarray:
    """Leave out every waypoint whose neighbours are joined by a free straight segment."""
    kept = [waypoints[0]]
    for here, after in zip(waypoints[1:-1], waypoints[2:], strict=True):
        if not model.is_edge_free(arm, kept[-1], after):
            kept.append(here)
    return np.array([*kept, waypoints[-1]])


def _point(waypoints: np.ndarray, marks: np.ndarray, distance: float) -> np.ndarray:
    """Return the point of the polyline at a distance from its start."""
    return np.array([np.interp(distance, marks, column) for column in waypoints.T])


def _rounded(model: CollisionModel, arm: str, waypoints: np.ndarray) -> JointPath:
    """Round the corners as far as the rounded path is free."""
    radius = CORNER_RADIUS
    while radius > EDGE_STEP:
        path = JointPath.through(waypoints, radius)
        if all(model.is_free(arm, q) for q in path.samples(EDGE_STEP)):
            return path
        radius /= 2
    # Deviates from the checked polyline by less than the spacing of the checks.
    return JointPath.through(waypoints, radius)
