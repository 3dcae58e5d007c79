"""From a fixing plan to operations: which of them, on which parts, in which order."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass

from cell.errors import CellError
from cell.phase import Outcome, Phase, after
from cell.product import Fit, Product
from planning.fixing.planner import FixingPlan
from planning.operations.counter_hold import hold, park, release_hold
from planning.operations.insert_shaft import insert_shaft
from planning.operations.pick_place import pick_place
from planning.operations.place_bolts import place_bolt
from planning.operations.station import Station
from planning.operations.tighten_bolts import star_order, tighten_bolt

REST_TIME = 0.2  # [s] [A]


class NoOperation(CellError):
    """A step of a plan that none of the operations can carry out."""


@dataclass(frozen=True)
class Operation:
    """One step of the assembly.

    Attributes:
        name: For example "insert plate".
        kind: "pick_place", "insert_shaft", "place_bolts" or "tighten_bolts".
        parts: What it moves.
        fit: Of "insert_shaft": which shaft, which hole.
    """

    name: str
    kind: str
    parts: tuple[str, ...]
    fit: Fit | None = None


def operations(product: Product, plan: FixingPlan) -> list[Operation]:
    """Return the operations that carry out a feasible plan, in order.

    Raises:
        NoOperation: A step that is neither a fit nor fastening, or that fixes another part than the
            first step does.
    """
    base = plan.steps[0].fixed_part
    if any(step.fixed_part != base for step in plan.steps):
        raise NoOperation(
            f"The plan fixes {', '.join(step.fixed_part for step in plan.steps)} in turn; "
            f"the operations can keep one part on the jig only. Another order may do."
        )
    result = [Operation(f"place {base}", "pick_place", (base,))]
    for step in plan.steps:
        result += _mating(product, step.incoming, step.target)
    return result


def _mating(
    product: Product, incoming: tuple[str, ...], target: tuple[str, ...]
) -> list[Operation]:
    if all(name in product.fasteners for name in incoming):
        return [
            Operation("place bolts", "place_bolts", incoming),
            Operation("tighten bolts", "tighten_bolts", incoming),
        ]
    found = []
    for name in incoming:
        fits = [fit for fit in product.fits if fit.hole == name and fit.shaft in target]
        if not fits:
            raise NoOperation(
                f"No operation brings '{name}' to {', '.join(target)}: it is neither a fastener "
                f"nor the hole of a fit. Fits: {', '.join(f.hole for f in product.fits) or 'none'}."
            )
        found.append(Operation(f"insert {name}", "insert_shaft", (name,), fits[0]))
    return found


def phases(station: Station, operation: Operation) -> Iterator[Phase]:
    """Yield the phases of one operation, each built from what is sensed then."""
    return _PHASES[operation.kind](station, operation)


def _pick_place(station: Station, operation: Operation) -> Iterator[Phase]:
    product = station.cell.product
    (part,) = operation.parts
    later = tuple(fit.hole for fit in product.fits if fit.shaft == part)
    yield from pick_place(station, part, product.up, later)
    station.fixed = (part,)


def _insert_shaft(station: Station, operation: Operation) -> Iterator[Phase]:
    assert operation.fit is not None
    yield from insert_shaft(station, operation.fit)
    station.fixed = (*station.fixed, operation.fit.hole)


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
    "insert_shaft": _insert_shaft,
    "place_bolts": _place_bolts,
    "tighten_bolts": _tighten_bolts,
}
