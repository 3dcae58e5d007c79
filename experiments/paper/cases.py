"""Run and judge the cases of the place and push experiments, trial by trial."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.stats import binomtest

from cell.configuration.config import CellConfig
from cell.products.product import Product
from experiments.paper.postures import Posture, PushSpec
from experiments.paper.rig.stage import Observer
from experiments.paper.rig_hand import RigBench
from experiments.paper.robot_hand import RobotBench
from experiments.paper.trial import (
    Bench,
    TrialDisturbance,
    TrialRecord,
    check_fits,
    ignore,
    run_trial,
)
from experiments.paper.trial_metrics import (
    measure_place,
    measure_push,
    place_succeeded,
    push_succeeded,
)


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


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a success rate."""
    interval = binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def case_seed(seed: int, label: str, trial: int) -> np.random.Generator:
    """Return the random generator of one trial, independent of the other cases that are run."""
    return np.random.default_rng([seed, zlib.crc32(label.encode()), trial])


def run_cases(
    cases: Sequence[Case],
    *,
    product: Product,
    config: CellConfig,
    trials: int,
    seed: int,
    hand: str = "rig",
    watch: Callable[[Case, str, Observer], None] | None = None,
) -> Iterator[tuple[CaseResult, TrialResult]]:
    """Run every trial of every case; yield each when it is done, with the results of its case.

    Args:
        cases: To run.
        product: With the parts.
        config: Of the cell, the same for all cases.
        trials: Of each case.
        seed: Of the disturbances, which are the same for both hands.
        hand: "rig" or "robot".
        watch: Called with the events of the first trial of each case.

    Raises:
        BadPart: Before any trial: a part is wider than the bag.
    """
    for case in cases:
        check_fits(config, product.parts[case.posture.part], case.posture)
    for case in cases:
        bench: Bench
        if hand == "robot":
            bench = RobotBench.build(config, product, case.posture, case.push)
        else:
            bench = RigBench.build(config, product, case.posture)
        result = CaseResult(case)
        for k in range(trials):
            disturbance = TrialDisturbance.draw(config, case_seed(seed, case.label, k))
            follow = ignore if watch is None or k > 0 else partial(watch, case)
            trial = run_trial(bench.begin(disturbance), case.push, follow)
            result.trials.append(judged(case, trial))
            yield result, result.trials[-1]


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
