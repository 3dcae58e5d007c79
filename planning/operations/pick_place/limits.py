"""When a part counts as placed."""

import numpy as np

from cell.fixtures.custom.fixture import ON_SUPPORTS
from planning.operations.limits import Limit

# [D] A part that is thrown up with this rises by 0.02 mm, v2 / (2 g): out of no imprint.
KICK = 0.02  # [m/s]

LIMITS = (
    Limit("position_error_m", 3e-3, "later grasps are planned around the place"),
    Limit("angle_error_rad", np.deg2rad(3.0), "later grasps are planned around it"),
    Limit("upright_tilt_rad", np.deg2rad(5.0), "the wrist still reaches the shaft"),
    Limit("jam_kick_m", 3e-4, "freezing must not move what was placed"),
    Limit("jam_kick_m_per_s", KICK, "freezing must not throw it up"),
    Limit("release_kick_m", 3e-4, "the frozen bed carries the weight"),
    Limit("release_kick_m_per_s", KICK, "it springs back, it is not thrown up"),
    Limit("off_supports_m", ON_SUPPORTS, "what hangs on a lead-in is wedged", optional=True),
    Limit("speed_after_1_s_m_per_s", 1e-3, "a part that creeps is not fixed"),
)
