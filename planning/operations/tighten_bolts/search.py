"""The driver feels for a socket that is not where it is believed to be.

The bit has come down and has not dropped in. What it stands on is felt by the bit holder's spring,
and how high it stands by the joint encoders: on the head's top, or on nothing. It is lifted, set
down beside, turning slowly, and so on round the believed place, until it stands as deep as the
socket is below the top that was felt, and is borne there. Nothing else is asked.
"""

from __future__ import annotations

from collections.abc import Generator
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform

from cell.simulation.conditions import All, BitPushedIn, Either
from cell.simulation.phase import Condition, Outcome, Phase, PhaseFailed, after, motion_finished
from cell.simulation.vocabulary import in_programs
from cell.workpieces.thread import BIT_GATE
from planning.operations.grasping import raised
from planning.operations.station import Station

FIND_SPEED = 3.0  # The bit turns this slowly until its hex drops into the socket [rad/s] [A].
TURN_MARGIN = 1.3  # Longer than the bit needs to the next way in which it fits, by this [A].
TOUCH_FORCE = 2.0  # The bit stands on something when its spring is pushed in so hard [N] [A].
PRESSED = 1.5e-3  # The feed goes on by this to feel what bears the bit; 1 mm are 2 N [m] [A].
CLEAR = 5e-4  # The bit goes aside this far above the head's top [m] [A].
SPEED = 0.04  # Of the bit [m/s] [A].
# Between neighbours of a triangular grid: no point is farther than 0.29 mm from one, the bit drops
# in within 0.4 mm, and the rest is for bolts that lean as the bit stands on them [m] [D].
PITCH = 5e-4
CERTAIN = 3.0  # Standard deviations within which the bolt stands [A].


@in_programs
class SearchPhase(Enum):
    """What comes when the bit has not dropped in."""

    LIFT = "lift the bit"
    ASIDE = "bit aside"
    DOWN = "search for the socket"
    PRESS = "press the bit in"


def places(radius: float) -> np.ndarray:
    """Return where the bit comes down (n, 3) about the believed place, the nearest first [m].

    Every point within ``radius`` [m] is at most PITCH / sqrt(3) from one of them.
    """
    rings = int(np.ceil(2 * radius / PITCH)) + 1
    steps = np.arange(-rings, rings + 1)
    across, along = (grid.ravel() for grid in np.meshgrid(steps, steps))
    grid = PITCH * np.stack([across + along / 2, np.sqrt(0.75) * along, 0.0 * along], axis=1)
    distance = np.hypot(grid[:, 0], grid[:, 1])
    angle = np.round(np.arctan2(grid[:, 1], grid[:, 0]) % (2 * np.pi), 9)
    order = np.lexsort((angle, np.round(distance, 9)))
    return grid[order][distance[order] <= radius + PITCH / np.sqrt(3)]


def search_radius(station: Station, bolt: str) -> float:
    """Return how far from its believed place the socket of a bolt is searched for [m].

    As far as the belief is uncertain, but not less than configured, and not beyond the head's rim:
    there nothing is felt of it.
    """
    covariance = station.belief.estimates[bolt].covariance
    sigma = float(np.sqrt(max(np.linalg.eigvalsh(covariance[3:5, 3:5])[-1], 0.0)))
    rim = float(station.part(bolt).mesh.bounds[1][0])
    return min(max(CERTAIN * sigma, station.config.driver.search_radius), rim)


def stands_on_something(station: Station) -> Condition:
    """Return the condition that something bears the bit."""
    return BitPushedIn(station.driver.tool.name, TOUCH_FORCE)


def has_turned(station: Station, bolt: str, duration: float) -> Condition:
    """Return the condition that a bit fits, if it can: a motion's end [s] and part of a turn on."""
    way = 2 * np.pi / station.cell.product.screws[bolt].drive.positions
    return All((motion_finished, after(duration + TURN_MARGIN * way / FIND_SPEED)))


def find_socket(
    station: Station, bolt: str, outcome: Outcome, awake: frozenset[str]
) -> Generator[Phase, Outcome, Outcome]:
    """Yield the phases that find the socket of a bolt; return the outcome with the bit in it.

    Args:
        station: The planner's view of the cell.
        bolt: Whose socket; it is believed to stand elsewhere afterwards.
        outcome: Of the bit's coming down to where the socket is believed to be.
        awake: Names of the parts that are.

    Raises:
        PhaseFailed: There is no socket within the `search_radius`.
    """
    driver, screw = station.driver, station.cell.product.screws[bolt]
    tip, bit = driver.frame("tool_tip"), driver.frame("bit_tip")
    X_WF = station.pose_of(bolt)
    middle = RigidTransform(
        station.tool_pose(driver, "tool_tip").rotation(),
        X_WF @ np.array([0.0, 0.0, screw.bit_seat]),
    )
    depth = float(station.part(bolt).mesh.bounds[1][2]) - screw.bit_seat
    pushed_in, radius = stands_on_something(station), search_radius(station, bolt)

    def at(offset: np.ndarray, height: float) -> RigidTransform:
        p = middle.translation() + offset
        return RigidTransform(middle.rotation(), [p[0], p[1], height])

    def go(kind: SearchPhase, X_WE: RigidTransform) -> Phase:
        line = station.line(driver, tip, X_WE, speed=SPEED)
        end = has_turned(station, bolt, line.duration)
        ends = {
            SearchPhase.DOWN: Either((pushed_in, end)),
            SearchPhase.PRESS: Either((pushed_in, motion_finished)),
        }
        return Phase(
            kind,
            ends.get(kind, motion_finished),
            timeout=line.duration + 5.0,
            subject=bolt,
            commands={driver.name: line},
            awake=awake,
            tare=False,
        )

    seat = float(middle.translation()[2])  # Height of the bit's end when it is in.
    pending, offset, tries, top_felt = list(places(radius)[1:]), np.zeros(3), 0, False
    while True:
        if not pushed_in(outcome.sensed):
            press = raised(station.tool_pose(driver, "tool_tip"), -PRESSED)
            outcome = yield go(SearchPhase.PRESS, press)
        height = float(outcome.sensed.X_WF(bit).translation()[2])
        borne = pushed_in(outcome.sensed)
        if borne and abs(height - seat) < depth / 2:
            break
        if borne and height > seat and not top_felt:
            # Now it is known how high the bolt stands: what was too deep before may have been it.
            off, top_felt, seat = height - depth - seat, True, height - depth
            if abs(off) > BIT_GATE.axial:
                pending = list(places(radius))
        if not pending:
            within = f"within {1e3 * radius:.2g} mm of where {bolt} is believed to stand"
            nothing = "" if top_felt else ", and no head is felt there"
            raise PhaseFailed(
                f"{bolt}: {SearchPhase.DOWN.value}",
                f"no socket found {within}, at {tries + 1} places{nothing}",
            )
        here = station.tool_pose(driver, "tool_tip").translation() - middle.translation()
        yield go(SearchPhase.LIFT, at(here, seat + depth + CLEAR))
        offset, tries = pending.pop(0), tries + 1
        yield go(SearchPhase.ASIDE, at(offset, seat + depth + CLEAR))
        outcome = yield go(SearchPhase.DOWN, at(offset, seat))
    if tries:
        found = raised(X_WF, seat - float(middle.translation()[2]))
        aside = RigidTransform(found.rotation(), found.translation() + offset)
        station.belief.rest(bolt, aside)
        distance = 1e3 * float(np.linalg.norm(offset))
        station.recoveries += (
            f"{bolt}: its socket was found {distance:.2f} mm beside where it was believed, at "
            f"place {tries + 1}.",
        )
    return outcome
