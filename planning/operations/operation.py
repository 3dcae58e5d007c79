"""What an operation is, and a step of an assembly that one of them carries out.

Each operation is a folder that offers one `Operation`: the joint it makes, its phases, what is
measured of it, the limits and plots. They are found through `planning.operations.registry`.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform

from cell.builder import Cell
from cell.errors import RunFailure
from cell.products.joints import Joint
from cell.products.product import Product
from cell.simulation.phase import Outcome, Phase
from planning.operations.limits import FailedCheck, Limit, failed_checks
from planning.operations.plot import Plot
from planning.operations.snapshot import Snapshot
from planning.operations.station import Placement, Station

Arrays = Mapping[str, np.ndarray]
Measured = dict[str, float]  # Quantity, with its SI unit in the name -> value.


class NoOperation(RunFailure):
    """A step of a well-formed plan that none of the operations can carry out."""


class Role(Enum):
    """What an operation does for an assembly: the sequence asks for a role, never for a name."""

    FIX = "puts a part on the empty fixture and lets it be held"
    REMOVE = "takes what stands on the fixture off it"
    BRING = "brings a part to what stands on the fixture"
    FINISH = "makes joints between parts that are all there"


@dataclass(frozen=True)
class Scene:
    """What stands on the fixture at one point of a plan.

    Attributes:
        product: Parts and joints.
        standing: Names of the parts on the fixture, the one that it holds first.
        finished: Names of the parts whose joints an operation has finished.
    """

    product: Product
    standing: tuple[str, ...] = ()
    finished: tuple[str, ...] = ()

    def after(self, step: Step) -> Scene:
        """Return the scene that a step leaves."""
        role = step.operation.role
        if role is Role.FIX:
            return replace(self, standing=step.parts)
        if role is Role.REMOVE:
            return replace(self, standing=())
        if role is Role.BRING:
            return replace(self, standing=(*self.standing, *step.parts, *step.riders))
        return replace(self, finished=(*self.finished, *step.parts))


@dataclass(frozen=True)
class Step:
    """One step of an assembly: an operation on certain parts.

    Attributes:
        name: For example "insert plate".
        operation: Which one.
        parts: Names of what it moves.
        joint: The joint that it makes, where it is a single one.
        riders: Names of the parts that lie loose on what it moves, and come along.
    """

    name: str
    operation: Operation
    parts: tuple[str, ...]
    joint: Joint | None = None
    riders: tuple[str, ...] = ()

    def phases(self, station: Station) -> Generator[Phase, Outcome, None]:
        """Yield its phases, each built from what is believed by then.

        At the end the station knows what the fixture holds now.
        """
        yield from self.operation.carry_out(station, self)
        station.fixed = self.fixed_after(station.cell.product, station.fixed)

    @property
    def limits(self) -> dict[str, Limit]:
        """What bounds its measured quantities, by their names."""
        parts = {"parts": self.parts, "riders": self.riders}
        return {name: limit for limit in self.operation.limits for name in limit.names(parts)}

    def failed_checks(self, measured: Mapping[str, float]) -> tuple[FailedCheck, ...]:
        """Return every limit of its operation that its measured quantities do not keep."""
        return failed_checks(self.limits, measured)

    def fixed_after(self, product: Product, fixed: tuple[str, ...]) -> tuple[str, ...]:
        """Return what the fixture holds after the step; ``fixed``: before it.

        Bolts do not count: loose ones sleep while nothing touches them.
        """
        before = Scene(product, standing=fixed)
        return tuple(n for n in before.after(self).standing if n not in product.screws)


@dataclass(frozen=True)
class PhaseRecord:
    """One phase that came to its end.

    Attributes:
        start, end: The truth before its first and after its last time step.
        peak_force: By arm name, largest force at its wrist, less the reading at the start [N].
        awake: Names of the parts that were: nothing acts on a part that sleeps.
        times: How often a phase of this subject and kind has come so far in its step.
    """

    start: Snapshot
    end: Snapshot
    peak_force: Mapping[str, float]
    awake: frozenset[str] = frozenset()
    times: int = 1


@dataclass
class StepRecord:
    """One step of an assembly, up to where it ended, well or not.

    Attributes:
        step: Which one.
        start, end: The truth around it.
        base: Name of the part that the fixture holds; None before one is placed.
        placed: The truth when it had been placed, or when the run began with it on the fixture.
        origin: X_WP from which the part that is moved was once taken to the fixture, if it was.
        placement: Where on the fixture the part that is moved was meant to go, if it was.
        phases: By subject and kind; of one that comes several times in a step, the latest.
    """

    step: Step
    start: Snapshot
    base: str | None = None
    placed: Snapshot | None = None
    origin: RigidTransform | None = None
    placement: Placement | None = None
    phases: dict[tuple[str, Enum], PhaseRecord] = field(default_factory=dict)
    end: Snapshot | None = None

    def of(self, subject: str, *kinds: Enum) -> list[PhaseRecord]:
        """Return those phases of a subject that ran, in the order of the kinds asked for."""
        keys = [(subject, kind) for kind in kinds]
        return [self.phases[key] for key in keys if key in self.phases]

    def last_awake(self, part: str) -> Snapshot | None:
        """Return the truth at the end of the latest phase in which a part was awake."""
        ends = [phase.end for phase in self.phases.values() if part in phase.awake]
        return max(ends, key=lambda end: end.time, default=None)


def foresees_nothing(station: Station, step: Step) -> tuple[str, ...]:
    """Return no remarks: the operation has no place in an assembly."""
    return ()


def plans_nothing(scene: Scene, parts: tuple[str, ...], riders: tuple[str, ...]) -> Step | None:
    """Offer no step: the operation has no place in an assembly plan."""
    return None


def no_plots(cell: Cell, record: StepRecord, log: Arrays) -> list[Plot]:
    """Return no plots."""
    return []


@dataclass(frozen=True)
class Operation:
    """An operation, as the registry lists it.

    Attributes:
        name: In results and on the command line.
        carry_out: Yields the phases of a step.
        measure: Returns what a recorded step is judged by, given the cell and the whole log.
        limits: What of it has to hold.
        plots: Returns what is worth drawing of a recorded step, given the cell and the whole log.
        role: What it does for an assembly; None: it has no place in one.
        joint: The kind of joint that it makes or helps to make; None: none.
        coarse: Whether it may take `simulation.coarse_factor` times the time step: nothing in it
            depends on the step but what links carry (docs/physics/time_step.md).
        plan: Returns the step that the operation can take in a scene, with these parts (of
            `Role.FINISH`: with none given) and with riders on them; None where it is not meant for
            them. Raises `NoOperation` where it is meant for them and something is missing.
        foresee: Without simulating, makes the choices of a step and believes that it succeeds;
            returns what is worth knowing. Raises `Unreachable` where the arms cannot do it.
    """

    name: str
    carry_out: Callable[[Station, Step], Iterator[Phase]]
    measure: Callable[[Cell, StepRecord, Arrays], Measured]
    limits: tuple[Limit, ...] = ()
    plots: Callable[[Cell, StepRecord, Arrays], list[Plot]] = no_plots
    role: Role | None = None
    joint: type[Joint] | None = None
    coarse: bool = False
    plan: Callable[[Scene, tuple[str, ...], tuple[str, ...]], Step | None] = plans_nothing
    foresee: Callable[[Station, Step], tuple[str, ...]] = foresees_nothing
