"""When a part counts as seated on its shaft."""

import numpy as np

from planning.operations.limits import BASE_STAYS, Limit, standing_limits

LIMITS = (
    Limit("gap_m", 2e-4, "a tightened bolt closes it without bending the plate"),
    Limit("tilt_rad", np.deg2rad(1.0), "0.5 mm at the bolt circle: bolts stand"),
    Limit("insertion_force_peak_N", 30.0, "less than what pushes parts off jigs"),
    *BASE_STAYS,
    *standing_limits("riders"),
)
