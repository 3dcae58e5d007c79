"""How deep a part goes into what guides it, whatever its shape: a lip, a key, a plate in a slot.

The part is drawn back along its way in, and shaken: as long as it hits something to both sides, it
is guided. Lengths in mm.
"""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

PLAY = 1.0  # [A] Looser guides leave a part to where the hand puts it.
HEIGHTS = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 15.0, 20.0, 30.0, 40.0)
PRECISE = 0.1  # Of the depth that is returned.
HIT = 0.05  # [A] Volume that parts share when they have met, beyond what they share as drawn [mm3].


def engagement(part: Manifold, others: Manifold, up: np.ndarray) -> float:
    """Return how far above its seat a part is guided by others on its way down; 0: not at all.

    Args:
        part: As assembled.
        others: Everything that is there when it comes, as one.
        up: (3,) direction that it comes from, an axis.
    """
    sides = [PLAY * side for side in np.eye(3)[np.abs(up) < 0.5]]
    shared = (part ^ others).volume()

    def guided(height: float) -> bool:
        def hits(shift: np.ndarray) -> bool:
            moved = part.translate((height * up + shift).tolist())
            return (moved ^ others).volume() > shared + HIT

        return any(hits(side) and hits(-side) for side in sides)

    inside = [height for height in HEIGHTS if guided(height)]
    if not inside:
        return 0.0
    low = max(inside)
    high = next((height for height in HEIGHTS if height > low), 2.0 * low)
    while high - low > PRECISE:
        middle = (low + high) / 2.0
        low, high = (middle, high) if guided(middle) else (low, middle)
    return low
