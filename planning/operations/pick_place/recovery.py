"""A step: a part is fixed and looked at, and what does not lie as planned is dealt with.

What has come to lie elsewhere, but upright and within reach of what is brought to it, stays: the
plan follows it, in the same posture at its new pose. What leans, or lies out of reach, is gripped
again, the fixture lets go and is made ready anew, and the part is placed once more.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cell.simulation.conditions import Signal
from cell.simulation.events import free_part, prepare_fixture, release_part
from cell.simulation.phase import Phase, after
from planning.operations.grasping import lift, lost_grasp, seize
from planning.operations.look import look
from planning.operations.operation import Step
from planning.operations.pick_place.limits import LIMITS
from planning.operations.pick_place.phases import LIFT, PlacePhase, choose, pick_place, put
from planning.operations.placement import (
    anywhere,
    brought_to,
    can_bring,
    moved_placement,
    placement_errors,
    planned_pose,
)
from planning.operations.station import Station

MOST_AGAIN = 2  # A part is placed again at most so often.
READY_TIME = 0.3  # The fixture is ready for the part again [s] [A].
BOUNDS = {limit.quantity: limit.limit for limit in LIMITS}


def carry_out(station: Station, step: Step) -> Iterator[Phase]:
    """Yield the phases of a step: the part upright, and so that later parts can be brought."""
    (part,) = step.parts
    product = station.cell.product
    later = brought_to(product, part)
    yield from pick_place(station, part, product.up, later)
    yield from look(station, PlacePhase.LOOK_AGAIN, part, closely=(part,))
    for time in range(MOST_AGAIN + 1):
        X_WP = station.pose_of(part)
        planned = planned_pose(station.cell, part, station.placements[part])
        errors = placement_errors(planned, X_WP)
        if all(error <= BOUNDS[name] for name, error in errors.items()):
            return
        leans = errors["upright_tilt_rad"] > BOUNDS["upright_tilt_rad"]
        where = (
            f"{part} lies {1e3 * errors['position_error_m']:.1f} mm and "
            f"{np.rad2deg(errors['angle_error_rad']):.1f} deg from its plan"
        )
        if not leans and can_bring(station, part, later, X_WP):
            station.placements[part] = moved_placement(station, part, product.up, X_WP)
            station.recoveries += (f"{where}: the plan follows it.",)
            return
        why = f"{where}, {'leaning' if leans else 'out of reach of what comes to it'}"
        if time == MOST_AGAIN:
            station.recoveries += (f"{why}: placed {MOST_AGAIN} times again, it stays so.",)
            return
        station.recoveries += (f"{why}: placed again.",)
        yield from place_again(station, part, later)
        yield from look(station, PlacePhase.LOOK_AGAIN, part, closely=(part,))


def place_again(station: Station, part: str, later: tuple[str, ...]) -> Iterator[Phase]:
    """Yield the phases that take a part off the fixture and fix it there anew.

    Args:
        station: The planner's view of the cell.
        part: Name of the part on the fixture.
        later: Names of the parts that will be mated with it.
    """
    awake = frozenset([part])
    reach, placement = choose(station, part, station.cell.product.up, later, anywhere)
    station.placements[part] = placement
    yield from seize(station, part, reach)
    # Freed first: pulled out of a frozen bed, the part would take its suction along.
    yield Phase(
        PlacePhase.FREE,
        Signal("fixture freed"),
        timeout=5.0,
        subject=part,
        guard=lost_grasp(station),
        start=(free_part,),
        awake=awake,
    )
    yield from lift(station, part, reach, LIFT)
    yield Phase(
        PlacePhase.READY,
        after(READY_TIME),
        timeout=READY_TIME + 1.0,
        subject=part,
        guard=lost_grasp(station),
        start=(release_part(part), prepare_fixture),
        awake=awake,
    )
    yield from put(station, part, reach, placement)
