"""When a part counts as pressed in."""

import numpy as np

from planning.operations.limits import BASE_STAYS, Limit, standing_limits

LIMITS = (
    Limit("gap_m", 1e-4, "the seat is felt, and stops it"),
    Limit("tilt_rad", np.deg2rad(0.5), "its hole holds it straight, and its flange lies on"),
    Limit(
        "press_force_deviation", 0.15, "another force is of another interference: it may not hold"
    ),
    *BASE_STAYS,
    *standing_limits("riders"),
)
