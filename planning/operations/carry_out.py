"""From an operation to its phases, each built from what is sensed by then."""

from __future__ import annotations

from collections.abc import Generator, Iterator

from cell.simulation.phase import Outcome, Phase, after
from planning.operations.counter_hold import hold, park, release_hold
from planning.operations.insert_shaft import insert_shaft
from planning.operations.pick_place import pick_place
from planning.operations.place_bolts import place_bolt
from planning.operations.sequence import Operation, fixed_after
from planning.operations.set_aside import set_aside
from planning.operations.station import Station
from planning.operations.tighten_bolts import star_order, tighten_bolt

REST_TIME = 0.2  # [s] [A]


def phases(station: Station, operation: Operation) -> Generator[Phase, Outcome, None]:
    """Yield the phases of one operation, each built from what is sensed then."""
    yield from _PHASES[operation.kind](station, operation)
    station.fixed = fixed_after(station.cell.product, station.fixed, operation)


def _pick_place(station: Station, operation: Operation) -> Iterator[Phase]:
    product = station.cell.product
    (part,) = operation.parts
    later = tuple(fit.hole for fit in product.fits if fit.shaft == part)
    return pick_place(station, part, product.up, later)


def _set_aside(station: Station, operation: Operation) -> Iterator[Phase]:
    (part,) = operation.parts
    return set_aside(station, part, operation.riders)


def _insert_shaft(station: Station, operation: Operation) -> Iterator[Phase]:
    assert operation.fit is not None
    return insert_shaft(station, operation.fit, operation.riders)


def _place_bolts(station: Station, operation: Operation) -> Iterator[Phase]:
    for bolt in operation.parts:
        yield from place_bolt(station, bolt)


def _tighten_bolts(station: Station, operation: Operation) -> Generator[Phase, Outcome, None]:
    clamped = station.cell.product.fasteners[operation.parts[0]].clamps
    assembly = frozenset([*station.fixed, *operation.parts])
    if station.config.driver.counter_hold:
        grasp = yield from hold(station, clamped)
        yield from _drive(station, operation.parts)
        yield from release_hold(station, clamped, grasp, assembly)
    else:
        yield from park(station)
        yield from _drive(station, operation.parts)
    # Nothing holds the assembly now but the jig: what it measures here is what the user gets.
    yield Phase("assembly: rest", after(REST_TIME), timeout=1.0, awake=assembly)


def _drive(station: Station, bolts: tuple[str, ...]) -> Iterator[Phase]:
    for bolt in star_order(station, bolts):
        yield from tighten_bolt(station, bolt)


_PHASES = {
    "pick_place": _pick_place,
    "set_aside": _set_aside,
    "insert_shaft": _insert_shaft,
    "place_bolts": _place_bolts,
    "place_loose_bolts": _place_bolts,
    "tighten_bolts": _tighten_bolts,
}
