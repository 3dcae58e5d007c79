"""A run as a program: its steps and phases as data, taken down as they run, and carried out again.

A program holds what was commanded, and on what conditions: trajectories of both arms, jaws, spindle
and fixture, when each phase ends, when it fails. Nothing is planned when it is carried out. It
holds the way that was taken: what an operation would have decided otherwise, it does not contain.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cell.errors import InputError, RunFailure
from cell.products.product import Product
from cell.simulation.phase import Outcome, Phase, PhaseFailed
from cell.simulation.vocabulary import NotInWords, from_data, to_data
from planning.operations.operation import Step
from planning.operations.registry import operation_named
from planning.operations.station import Placement, Station

Data = dict[str, Any]

# Fields of a phase that stand in a program as they are.
PLAIN = ("subject", "timeout", "fine_log", "tare")
WORDS = ("kind", "until", "guard", "start", "every_step")


@dataclass
class Transcript:
    """Takes down the phases of steps while these are carried out.

    Attributes:
        product: That is assembled.
        steps: Data of each step, in order.
        commands: Data of every command; a servo that goes on in the next phase is there once.
        problem: Why there is no program, if there is none: a phase without words.
    """

    product: Product
    steps: list[Data] = field(default_factory=list)
    commands: list[Data] = field(default_factory=list)
    problem: str | None = None
    _known: list[Any] = field(default_factory=list)

    def of(self, step: Step) -> Step:
        """Return a step that is carried out as before, and taken down."""

        def carry_out(station: Station, same: Step) -> Iterator[Phase]:
            own = self._begin(step)
            pending = step.operation.carry_out(station, same)
            send = getattr(pending, "send", lambda _: next(pending))
            outcome: Outcome | None = None
            try:
                while True:
                    phase = send(outcome)
                    self._take_down(own, phase, station)
                    outcome = yield phase
            except StopIteration:
                pass
            except RunFailure as error:  # No motion was found: that is part of the story.
                failed = isinstance(error, PhaseFailed)
                own["ends"] = [error.phase, error.evidence] if failed else [None, str(error)]
                raise

        return replace(step, operation=replace(step.operation, carry_out=carry_out))

    def _begin(self, step: Step) -> Data:
        """Return the data of a step without phases; what there was of it is forgotten."""
        self.steps = [other for other in self.steps if other["name"] != step.name]
        joint = None if step.joint is None else self.product.joints.index(step.joint)
        self.steps.append(
            {
                "name": step.name,
                "operation": step.operation.name,
                "parts": list(step.parts),
                "riders": list(step.riders),
                "joint": joint,
                "phases": [],
                "origins": {},
                "placements": {},
            }
        )
        return self.steps[-1]

    def _take_down(self, own: Data, phase: Phase, station: Station) -> None:
        try:
            own["phases"].append(
                {
                    "name": phase.name,
                    **{name: getattr(phase, name) for name in PLAIN},
                    **{name: to_data(getattr(phase, name)) for name in WORDS},
                    "awake": sorted(phase.awake),
                    "mating": sorted(sorted(pair) for pair in phase.mating),
                    "riding": sorted(phase.riding),
                    "commands": {d: self._number(c) for d, c in phase.commands.items()},
                    "in_hand": list(station.in_hand),
                }
            )
        except NotInWords as error:
            self.problem = f"phase '{phase.name}': {error}"
        _remember(own, station)

    def _number(self, command: Any) -> int:
        """Return the row of a command; one that was given before keeps its row."""
        for row, known in enumerate(self._known):
            if known is command:
                return row
        self.commands.append(to_data(command))
        self._known.append(command)
        return len(self._known) - 1


def _remember(own: Data, station: Station) -> None:
    """Add what the step is measured against: where the plan wanted its parts."""
    parts = own["parts"]
    own["origins"] = {n: to_data(X) for n, X in station.origins.items() if n in parts}
    own["placements"] = {
        name: {"yaw": float(p.yaw), "X_WP": to_data(p.X_WP), "q": to_data(p.q)}
        for name, p in station.placements.items()
        if name in parts
    }


@dataclass
class Program:
    """Steps that are carried out as they were taken down.

    Attributes:
        product: That is assembled.
        data: With "steps" and "commands".
    """

    product: Product
    data: Mapping[str, Any]
    _made: dict[int, Any] = field(default_factory=dict)

    def steps(self) -> list[Step]:
        """Return the steps.

        Raises:
            InputError: An operation or a part does not exist, or the data is no program.
        """
        try:
            return [self._step(own) for own in self.data["steps"]]
        except (KeyError, IndexError, TypeError) as error:
            raise InputError(f"The program is not whole: {error!r} is missing in it.") from error

    def _step(self, own: Mapping[str, Any]) -> Step:
        operation = operation_named(own["operation"])
        for part in (*own["parts"], *own["riders"]):
            if part not in self.product.parts:
                raise InputError(f"The program moves '{part}', which the product does not have.")

        def carry_out(station: Station, step: Step) -> Generator[Phase, Outcome, None]:
            self._recall(own, station)
            for data in own["phases"]:
                hand = [str(name) for name in data["in_hand"]]
                station.held, station.riders = (hand or [None])[0], tuple(hand[1:])
                yield self._phase(data, station)
            station.held, station.riders = None, ()
            if "ends" in own:
                phase, evidence = own["ends"]
                raise RunFailure(evidence) if phase is None else PhaseFailed(phase, evidence)

        joint = None if own["joint"] is None else self.product.joints[own["joint"]]
        return Step(
            own["name"],
            replace(operation, carry_out=carry_out),
            tuple(own["parts"]),
            joint,
            tuple(own["riders"]),
        )

    def _recall(self, own: Mapping[str, Any], station: Station) -> None:
        """Let the station know where the plan wanted the parts, and begin without any servo."""
        self._made.clear()
        plant = station.cell.plant
        for name, data in own["origins"].items():
            X_WP: RigidTransform = from_data(data, plant)
            station.origins[name] = X_WP
        for name, data in own["placements"].items():
            q: np.ndarray = from_data(data["q"], plant)
            station.placements[name] = Placement(data["yaw"], from_data(data["X_WP"], plant), q)

    def _phase(self, data: Mapping[str, Any], station: Station) -> Phase:
        plant = station.cell.plant
        words = {name: from_data(data[name], plant) for name in WORDS}
        return Phase(
            **{name: data[name] for name in PLAIN},
            **words,
            awake=frozenset(data["awake"]),
            mating=frozenset(frozenset(pair) for pair in data["mating"]),
            riding=frozenset(data["riding"]),
            commands={d: self._command(row, station) for d, row in data["commands"].items()},
        )

    def _command(self, row: int, station: Station) -> Any:
        """Return a command; one that goes on from an earlier phase is the same object."""
        if row not in self._made:
            self._made[row] = from_data(self.data["commands"][row], station.cell.plant)
        return self._made[row]
