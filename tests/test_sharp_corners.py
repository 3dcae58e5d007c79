"""Paths with corners that are too sharp to be rounded."""

import numpy as np
from planning_cell import planning_cell

from planning.motion.joint_path import JointPath
from planning.motion.timing import Pace, time_path

PACE = Pace(0.3, 4.0, wrist_force=100.0, ramp_time=0.04)


def test_a_corner_beside_a_tiny_step_is_run_with_stops() -> None:
    """Out of a narrow place a planner may find a way that begins with a third of a milliradian."""
    model = planning_cell()
    arm = model.arms["right"]
    waypoints = np.array(
        [
            [-0.6234, -1.6547, 1.3861, -1.3027, -1.5708, 0.9475],
            [-0.6234, -1.6547, 1.3859, -1.3025, -1.5710, 0.9475],
            [-0.5997, -1.6077, 1.3386, -1.3027, -1.5736, 0.9710],
            [-0.5909, -1.5948, 1.3303, -1.3063, -1.5708, 0.9799],
        ]
    )
    motion = time_path(arm, model.context, JointPath.through(waypoints, 0.1), PACE)
    assert motion.duration < 1.0
    assert (np.diff(motion.time) > 0.0).all()
    np.testing.assert_allclose(motion.q[[0, -1]], waypoints[[0, -1]], atol=1e-9)
    for point in waypoints:
        assert np.abs(motion.q - point).max(axis=1).min() < 2e-3
