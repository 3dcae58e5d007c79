"""When a part counts as set aside."""

import numpy as np

from planning.operations.limits import CAPTIVE, LEANING, LOOSE, Limit

LIMITS = (
    Limit("return_error_m", 3e-3, "it is taken from there again"),
    Limit("return_angle_rad", np.deg2rad(3.0), "it is taken from there again"),
    Limit("speed_at_rest_m_per_s", 1e-3, "a part that creeps does not stand"),
    Limit("protrusion_m", 5e-4, "it hangs by its head", each="riders"),
    Limit("off_hole_m", 5e-4, CAPTIVE, each="riders"),
    Limit("lean_rad", LEANING, LOOSE, each="riders"),
)
