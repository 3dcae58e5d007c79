"""What the hand can push with, against what a press fit takes."""

from __future__ import annotations

from cell.configuration.config import InsertionConfig
from cell.machines.grippers.pads import borne_along
from cell.products.joints import Press
from planning.operations.operation import NoOperation
from planning.operations.station import Station

GRAVITY = 9.81  # [m/s2]


def needed(config: InsertionConfig, press: Press) -> float:
    """Return the force at which the seat is felt: that of the fit, and of an insertion [N]."""
    return press.force + config.force_limit


def borne_by_arm(station: Station) -> float:
    """Return the force with which the arm may push: that of its payload [N]."""
    return GRAVITY * station.holder.model.payload


def check_strength(station: Station, press: Press, part: str) -> None:
    """Refuse a press fit that the arm, or every grip of the part, is too weak for.

    Raises:
        NoOperation: With the force that it takes, and that there is.
    """
    other = next(name for name in press.parts if name != part)
    takes = needed(station.config.insertion, press)
    arm, by_arm = station.holder, borne_by_arm(station)
    grip = max((grasp.force for grasp in station.part(part).grasps), default=0.0)
    by_grip = borne_along(grip)
    if takes <= min(by_arm, by_grip):
        return
    limits = (
        f"the {arm.name} arm pushes with {by_arm:.0f} N at most, its payload of "
        f"{arm.model.payload:g} kg"
        if by_arm < by_grip
        else f"the pads, with {grip:.0f} N on each, slip beyond {by_grip:.0f} N"
    )
    raise NoOperation(
        f"'{part}' is pressed together with '{other}' by {press.force:.0f} N, {takes:.0f} N until "
        f"its seat is felt; {limits}."
    )
