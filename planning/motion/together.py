"""Arms that move at the same time: one waits at its start until their motions keep apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from planning.motion.collision_model import EDGE_STEP, CollisionModel
from planning.motion.paths import NoPath
from planning.motion.timing import JointMotion

DELAY_STEP = 0.05  # Between two delays that are tried [s] [A].


def delayed_beside(
    model: CollisionModel, arm: str, motion: JointMotion, others: Mapping[str, JointMotion]
) -> JointMotion:
    """Return a motion with the least delay at which it can start together with others.

    Both motions are checked at the same times, so that an arm may pass where another one was or
    will be. In the end the arm waits for the others, which is right by construction when the motion
    is planned around where they end, and they around where the arm starts.

    Args:
        model: The planning copy, arranged; it keeps the arms' clearance.
        arm: Name of the arm.
        motion: Its motion.
        others: Motions of other arms by name; they all start at once.

    Raises:
        NoPath: Not even waiting for the others helps.
    """
    latest = max((other.duration for other in others.values()), default=0.0)
    for delay in np.minimum(np.arange(0.0, latest + DELAY_STEP, DELAY_STEP), latest):
        late = motion.delayed(float(delay))
        if keep_apart(model, {arm: late, **others}):
            return late
    raise NoPath(arm, f"it meets the {', '.join(others)} arm, which moves at the same time")


def keep_apart(model: CollisionModel, motions: Mapping[str, JointMotion]) -> bool:
    """Return whether arms that start at once keep all clearances on their way.

    They are checked so often that no joint of any of them turns by more than `EDGE_STEP` between.

    Args:
        model: The planning copy, arranged.
        motions: By name of the arm.
    """
    end = max(motion.duration for motion in motions.values())
    fastest = max(float(np.abs(motion.v).max()) for motion in motions.values())
    count = int(np.ceil(end * fastest / EDGE_STEP)) + 1
    return all(
        model.are_free({name: motion.at(float(t))[0] for name, motion in motions.items()})
        for t in np.linspace(0.0, end, max(count, 2))
    )
