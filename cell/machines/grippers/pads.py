"""What the pads of a gripper bear along themselves, by friction."""

from __future__ import annotations

# [D] 2 a b / (a + b) of the pads' 0.8 and of 0.2, the least of any part's contact pieces.
PAD_FRICTION = 0.32
# [M] Of that, before pads creep by a millimetre: 26.6 N where 32 would be friction. What they are
# squeezed by takes force from the grip.
HOLDS = 0.8


def borne_along(grip: float) -> float:
    """Return the force along two pads that they bear under a grip force on each [N]."""
    return 2.0 * HOLDS * PAD_FRICTION * grip


def grip_for(along: float) -> float:
    """Return the grip force per pad under which two pads bear a force along them [N]."""
    return along / borne_along(1.0)
