"""Classes of phases that cost alike, told from what is in a phase, never from its name.

What a step of the plant costs is decided by what may touch: a part that sleeps touches nothing.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import Enum

from cell.simulation.phase import Follow, Impedance, Jaw, Phase, Spin, motion_finished


class PhaseClass(Enum):
    """What goes on, in the order in which it is reported."""

    FREE = "free"
    CARRYING = "carrying"
    DWELL = "dwell"
    CONTACT = "contact"


def classify(*, moves: bool, awake: bool, carried: bool = False) -> PhaseClass:
    """Return the class of what goes on.

    Args:
        moves: Whether anything is commanded to move: an arm, jaws, a spindle.
        awake: Whether any part is awake.
        carried: Whether whatever is awake is in a hand that moves it on a given path through free
            space, to its end.
    """
    if not moves:
        return PhaseClass.DWELL
    if not awake:
        return PhaseClass.FREE
    return PhaseClass.CARRYING if carried else PhaseClass.CONTACT


def class_of(phase: Phase, in_hand: Collection[str]) -> PhaseClass:
    """Return the class of a phase.

    An arm that is compliant, follows what is felt, or moves until something is felt is in contact
    or about to be; so are jaws and spindles that turn to a part that is awake, and whatever moves
    while a part outside of the hand is awake.

    Args:
        phase: The phase.
        in_hand: Names of the parts in the hand at its start.
    """
    commands = phase.commands.values()
    paths_only = not any(isinstance(c, Follow | Impedance | Jaw | Spin) for c in commands)
    return classify(
        moves=any(not isinstance(c, Spin) or c.speed != 0.0 for c in commands),
        awake=bool(phase.awake),
        carried=paths_only and phase.until is motion_finished and phase.awake <= set(in_hand),
    )
