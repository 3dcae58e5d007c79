"""CPU time by phase class, and how it is compared with that of another machine or version.

A cost is CPU seconds per simulated second; divided by the CPU seconds of one iteration of the
calibration kernel it is a ratio, about the same on every machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from planning.operations.phase_class import PhaseClass

SLOWER = 0.15  # A ratio that grew by more than this is worth a warning [A]; runs differ by 5 % [M].


@dataclass
class Spent:
    """Time spent.

    Attributes:
        cpu: [s].
        simulated: [s].
    """

    cpu: float = 0.0
    simulated: float = 0.0


@dataclass
class Meter:
    """Time spent by phase class.

    Attributes:
        spent: Classes that occurred.
    """

    spent: dict[PhaseClass, Spent] = field(default_factory=dict)

    def add(self, kind: PhaseClass, cpu: float, simulated: float) -> None:
        """Add CPU and simulated time [s] to a class."""
        spent = self.spent.setdefault(kind, Spent())
        spent.cpu += cpu
        spent.simulated += simulated


def ratios(runs: Iterable[tuple[Meter, float]]) -> dict[str, float]:
    """Return kernel iterations per simulated second over some runs, by the name of the class.

    Args:
        runs: What each spent, and the CPU time of a kernel iteration meanwhile [s].
    """
    total = Meter()
    for meter, kernel in runs:
        for kind, spent in meter.spent.items():
            total.add(kind, spent.cpu / kernel, spent.simulated)
    return {
        kind.value: total.spent[kind].cpu / total.spent[kind].simulated
        for kind in PhaseClass
        if kind in total.spent and total.spent[kind].simulated > 0.0
    }


def changes(stored: Mapping[str, float], now: Mapping[str, float]) -> dict[str, float]:
    """Return the relative change of each ratio that is in both."""
    return {name: now[name] / stored[name] - 1.0 for name in now if name in stored}


def slower(stored: Mapping[str, float], now: Mapping[str, float]) -> list[str]:
    """Return the classes whose ratio grew by more than `SLOWER`."""
    return [name for name, change in changes(stored, now).items() if change > SLOWER]
