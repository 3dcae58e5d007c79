"""Waiting for what is measured: end conditions that hold once a reading has come to rest.

A fixed time would be too long in most cases and too short in the worst one. A condition serves one
phase, for it remembers what it has read.
"""

from __future__ import annotations

from cell.simulation.conditions import All, JawOpening, Steady, WristForce
from cell.simulation.phase import Condition, motion_finished

QUIET_TIME = 0.03  # What has not changed for this long is at rest [s] [A].
STEADY_FORCE = 0.2  # Change of a wrist's force that does not count [N] [A].
STEADY_OPENING = 5e-5  # Change of the jaws' opening that does not count [m] [A].


def steady_wrist(arm: str) -> Steady:
    """Return the condition that an arm's wrist feels a steady force."""
    return Steady(WristForce(arm), STEADY_FORCE, QUIET_TIME)


def at_rest(arm: str) -> Condition:
    """Return the condition that an arm's motion has ended and it does not swing any more."""
    return All((motion_finished, steady_wrist(arm)))


def steady_jaws(gripper: str) -> Steady:
    """Return the condition that the jaws have come to rest: open, or on what is in between."""
    return Steady(JawOpening(gripper), STEADY_OPENING, QUIET_TIME)
