"""When a part counts as lying where it belongs."""

import numpy as np

from planning.operations.limits import BASE_STAYS, Limit, standing_limits

LIMITS = (
    Limit("gap_m", 2e-4, "a tightened bolt closes it without bending the part"),
    Limit("tilt_rad", np.deg2rad(1.0), "it lies flat: what comes next finds it level"),
    Limit("off_place_m", 1e-3, "what comes to it next is brought by a look, and searches so far"),
    Limit("screw_play_share", 1.0, "the screws pass its holes into their threads"),
    Limit("insertion_force_peak_N", 30.0, "less than what pushes parts off jigs"),
    *BASE_STAYS,
    *standing_limits("riders"),
)
