"""The phases that push what stands on the jig straight along a line with the closed hand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform
from scipy.interpolate import CubicSpline

from cell.machines.arm import Unreachable
from cell.simulation.phase import Jaw, Phase, motion_finished
from cell.simulation.vocabulary import in_programs
from planning.motion.paths import NoPath, plan_line
from planning.motion.timing import JointMotion
from planning.operations.look import look
from planning.operations.operation import Step
from planning.operations.station import FIXTURE, Station
from planning.operations.stroke import Stroke

# The hand comes from above and behind, then straight down, then slowly forward to the start.
ABOVE, BEHIND_ABOVE = 0.12, 0.05  # [m] [A]
BEHIND = 0.02  # [m] [A]
MOTION_STEP = 1e-3  # Between two samples of the push's motion [s] [A].


@in_programs
class PushPhase(Enum):
    """Coming to the start of a push, and the push."""

    LOOK = "approach: look"
    ABOVE = "approach: above"
    DOWN = "approach: down"
    START = "approach: start"
    PUSH = "push"


@dataclass(frozen=True)
class PushLine:
    """A straight push of the closed hand, which keeps its orientation.

    Attributes:
        X_WT: Where the frame between the tip pads, T, starts.
        direction: (3,) unit vector in W, level.
        stroke: How far and how fast.
    """

    X_WT: RigidTransform
    direction: np.ndarray
    stroke: Stroke

    def at(self, distance: float, above: float = 0.0) -> RigidTransform:
        """Return X_WT a distance along the line, and a height above it [m]."""
        p_WT = self.X_WT.translation() + distance * self.direction + [0.0, 0.0, above]
        return RigidTransform(self.X_WT.rotation(), p_WT)


@dataclass(frozen=True)
class PushMotion:
    """The joints' part of a push.

    Attributes:
        q_high: (6,) above and behind the start.
        motion: Of the push itself.
    """

    q_high: np.ndarray
    motion: JointMotion


@dataclass(frozen=True)
class PushStep(Step):
    """A push of a part that stands on the jig.

    Attributes:
        line: Where and how.
    """

    line: PushLine | None = None


def carry_out(station: Station, step: Step) -> Iterator[Phase]:
    """Yield the phases of a whole push."""
    assert isinstance(step, PushStep) and step.line is not None
    (part,) = step.parts
    yield from approach(station, part, step.line)
    yield from push(station, part, step.line)


def can_push(station: Station, part: str, line: PushLine) -> bool:
    """Return whether the holder can bring its hand to a push and carry it out."""
    return _found(station, part, line) is not None


def approach(station: Station, part: str, line: PushLine) -> Iterator[Phase]:
    """Yield the phases that bring the closed hand to the start of a push."""
    arm = station.holder
    yield from look(station, PushPhase.LOOK, "")
    found = _found(station, part, line)
    if found is None:
        reason = f"no joint configuration carries '{part}' along the whole push"
        raise Unreachable(arm.name, "tip", line.X_WT, reason)
    yield Phase(
        PushPhase.ABOVE,
        motion_finished,
        timeout=20.0,
        commands={
            arm.name: station.move(arm, found.q_high, _may_touch(station, part)),
            arm.tool.name: Jaw(0.0),
        },
    )
    for kind, distance in ((PushPhase.DOWN, -BEHIND), (PushPhase.START, 0.0)):
        motion = station.line(arm, arm.frame("tip"), line.at(distance))
        yield Phase(kind, motion_finished, timeout=10.0, commands={arm.name: motion})


def push(station: Station, part: str, line: PushLine) -> Iterator[Phase]:
    """Yield the phase that pushes; the hand is at the start of the line."""
    arm = station.holder
    station.model.arrange(station.surroundings(_may_touch(station, part)))
    motion = _stroke(station, arm.positions(station.context), line)
    yield Phase(
        PushPhase.PUSH,
        motion_finished,
        5.0,
        commands={arm.name: motion},
        awake=frozenset([part]),
        # What a push puts to the test is not linked.
        mating=frozenset([frozenset([part, station.cell.fixture.name])]),
        tare=False,
    )


def _found(station: Station, part: str, line: PushLine) -> PushMotion | None:
    """Return the motion from the start configuration nearest to where the arm is, if any works."""
    arm, context = station.holder, station.context
    frame, near = arm.frame("tip"), arm.positions(context)
    for q in station.configurations(arm, frame, line.X_WT, near, _may_touch(station, part)):
        try:
            motion = _stroke(station, q, line)
            back = plan_line(arm, context, frame, q, line.at(-BEHIND)).waypoints[-1]
            high = line.at(-BEHIND_ABOVE, ABOVE)
            q_high = plan_line(arm, context, frame, back, high).waypoints[-1]
        except (NoPath, Unreachable):
            continue
        if station.model.is_free(arm.name, q_high):
            return PushMotion(q_high, motion)
    return None


def _may_touch(station: Station, part: str) -> Sequence[tuple[str, str]]:
    """Return what the hand may come close to: the push's rule keeps it clear of the bed."""
    return [(station.hand, part), (station.hand, FIXTURE)]


def _stroke(station: Station, q_start: np.ndarray, line: PushLine) -> JointMotion:
    """Return the joints' motion along a push line, in the arranged surroundings.

    Raises:
        Unreachable: The line leaves the workspace.
        NoPath: The arm would collide or flip, or a joint is too slow.
    """
    arm, stroke = station.holder, line.stroke
    frame = arm.frame("tip")
    X_WT = arm.tool_pose(station.context, frame, q_start)
    goal = RigidTransform(X_WT.rotation(), X_WT.translation() + stroke.way * line.direction)
    path = plan_line(
        arm,
        station.context,
        frame,
        q_start,
        goal,
        is_free=lambda q: station.model.is_free(arm.name, q),
    )
    # Waypoints are evenly spaced on the line; between them the spline is off by less than 1 um [D].
    curve = CubicSpline(np.linspace(0.0, stroke.way, len(path.waypoints)), path.waypoints)
    time = np.linspace(0.0, stroke.duration, int(np.ceil(stroke.duration / MOTION_STEP)) + 1)
    # Just before the end, for there it stops dead.
    gone = np.array([stroke.at(min(t, stroke.duration - 1e-9)) for t in time])
    q, v = curve(gone[:, 0]), curve(gone[:, 0], 1) * gone[:, 1:]
    limits = np.array([joint.velocity_upper_limits()[0] for joint in arm.joints])
    fastest = np.max(np.abs(v) / limits, axis=0)
    if fastest.max() > 1.0:
        joint = arm.joints[int(fastest.argmax())].name()
        raise NoPath(
            arm.name, f"{joint} would turn at {fastest.max():.1f} times its limit in a push"
        )
    return JointMotion(time, q, v)
