"""The cases of the place and push experiments, and the verdict on their trials."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field

import numpy as np

from cell.errors import UnknownName
from experiments.paper.postures import POSTURES, PUSHES, Posture, PushSpec, chosen
from experiments.paper.trial import TrialRecord
from experiments.paper.trial_metrics import (
    measure_place,
    measure_push,
    place_succeeded,
    push_succeeded,
)
from experiments.reporting.statistics import wilson


@dataclass(frozen=True)
class Case:
    """One case of an experiment: a posture, with a push or without.

    Attributes:
        posture: In which the part is placed.
        push: None in the place experiment.
    """

    posture: Posture
    push: PushSpec | None = None

    @property
    def label(self) -> str:
        """For example "motor/P2/a"."""
        return self.posture.label if self.push is None else self.push.label

    @property
    def expected(self) -> str:
        """Outcome in the paper: "success" or "failure"; every placement succeeded."""
        return "success" if self.push is None else self.push.expected


@dataclass
class TrialResult:
    """One trial, judged.

    Attributes:
        success: By the paper's criterion.
        measured: Value by quantity; SI units in the names.
        failure: Phase and evidence if the trial stopped early.
        trial: The record of the trial.
    """

    success: bool
    measured: dict[str, float]
    failure: tuple[str, str] | None
    trial: TrialRecord


@dataclass
class CaseResult:
    """All trials of one case."""

    case: Case
    trials: list[TrialResult] = field(default_factory=list)

    @property
    def successes(self) -> int:
        """Number of successful trials."""
        return sum(result.success for result in self.trials)

    @property
    def outcome(self) -> str:
        """The outcome of the majority: "success" or "failure"."""
        return "success" if 2 * self.successes > len(self.trials) else "failure"

    @property
    def agrees(self) -> bool:
        """Whether the case came out as in the paper."""
        return self.outcome == self.case.expected

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the success rate."""
        return wilson(self.successes, len(self.trials))

    def values(self, quantity: str) -> np.ndarray:
        """Return the values (n,) of a quantity over the trials that have it."""
        return np.array(
            [result.measured[quantity] for result in self.trials if quantity in result.measured]
        )

    def means(self) -> dict[str, float]:
        """Return the mean of every quantity over the trials that have it."""
        names = dict.fromkeys(name for result in self.trials for name in result.measured)
        return {name: float(self.values(name).mean()) for name in names}


def cases_of(command: str, label: str | None) -> list[Case]:
    """Return the cases of an experiment that a label selects; None selects all.

    Args:
        command: "place" or "push".
        label: Of a case, a posture or a part.

    Raises:
        UnknownName: No case has this label.
    """
    if command == "place":
        return [Case(posture) for posture in chosen("posture to place", POSTURES, label)]
    return [Case(push.posture, push) for push in chosen("case to push", PUSHES, label)]


def case_named(command: str, label: str) -> Case:
    """Return the one case of an experiment with a label.

    Raises:
        UnknownName: No case has this label.
    """
    found = {case.label: case for case in cases_of(command, None)}
    if label not in found:
        raise UnknownName(f"case to {command}", label, found)
    return found[label]


def case_seed(seed: int, label: str, trial: int) -> np.random.Generator:
    """Return the random generator of one trial, independent of the other cases that are run."""
    return np.random.default_rng([seed, zlib.crc32(label.encode()), trial])


def judged(case: Case, trial: TrialRecord) -> TrialResult:
    """Return a trial with its measurements and whether it succeeded.

    Values that are not finite, after a simulation has diverged, are omitted.
    """
    measured = measure_place(trial)
    if case.push is None:
        success = place_succeeded(trial, measured)
    else:
        measured |= measure_push(trial)
        success = push_succeeded(measured)
    finite = {name: value for name, value in measured.items() if np.isfinite(value)}
    return TrialResult(success, finite, trial.failure, trial)
