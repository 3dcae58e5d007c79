"""Run the cases of the place and push experiments, trial after trial, and judge them."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import binomtest

from cell.configuration.config import CellConfig
from cell.products.product import Product
from experiments.paper.postures import Posture, Push
from experiments.paper.rig.stage import Observer
from experiments.paper.rig_hand import RigBench
from experiments.paper.robot_hand import RobotBench
from experiments.paper.trial import Bench, Disturbance, Trial, check_fits, ignore, run_trial
from experiments.paper.trial_metrics import (
    measure_place,
    measure_push,
    place_succeeded,
    push_succeeded,
)


@dataclass(frozen=True)
class Case:
    """One row of an experiment's table: a posture, and a push if there is one.

    Attributes:
        posture: How the part is placed.
        push: None in the place experiment.
    """

    posture: Posture
    push: Push | None = None

    @property
    def label(self) -> str:
        """For example "motor/P2/a"."""
        return self.posture.label if self.push is None else self.push.label

    @property
    def expected(self) -> str:
        """What the paper saw: "success" or "failure"; every placement succeeded."""
        return "success" if self.push is None else self.push.expected


@dataclass
class TrialResult:
    """One trial, judged.

    Attributes:
        success: By the paper's criterion.
        measured: Quantity -> value; SI units in the names.
        failure: Phase and evidence if it stopped early.
        trial: All of it.
    """

    success: bool
    measured: dict[str, float]
    failure: tuple[str, str] | None
    trial: Trial


@dataclass
class CaseResult:
    """All trials of one case."""

    case: Case
    trials: list[TrialResult] = field(default_factory=list)

    @property
    def successes(self) -> int:
        """How many trials succeeded."""
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
        """Return a quantity of every trial that has it (n,)."""
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
    """Return the random numbers of one trial: the same whichever other cases are run."""
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
    """Run every trial of every case; yield each when it is done, with its case so far.

    Args:
        cases: Which.
        product: Where the parts are described.
        config: Every number, the same for all cases.
        trials: Of each case.
        seed: Seeds the disturbances: the same for both hands.
        hand: "rig" or "robot".
        watch: Told of the events of the first trial of each case.

    Raises:
        InputError: Before any trial: a part that has no room on the bag (`BadPart`).
    """
    for case in cases:
        check_fits(config, product.parts[case.posture.part], case.posture)
    for case in cases:
        bench = _bench(case, product, config, hand)
        result = CaseResult(case)
        for k in range(trials):
            disturbance = Disturbance.draw(config, case_seed(seed, case.label, k))
            follow = ignore if watch is None or k > 0 else _bound(watch, case)
            trial = run_trial(bench.begin(disturbance), case.push, follow)
            result.trials.append(judged(case, trial))
            yield result, result.trials[-1]


def _bench(case: Case, product: Product, config: CellConfig, hand: str) -> Bench:
    """Build what a case's trials are run with; cheap beside a trial."""
    if hand == "robot":
        return RobotBench.build(config, product, case.posture, case.push)
    return RigBench.build(config, product, case.posture)


def _bound(watch: Callable[[Case, str, Observer], None], case: Case) -> Callable:
    return lambda event, observer: watch(case, event, observer)


def judged(case: Case, trial: Trial) -> TrialResult:
    """Return a trial with what was measured and whether it succeeded.

    What is not finite, after a simulation has diverged, was not measured.
    """
    measured = measure_place(trial)
    if case.push is None:
        success = place_succeeded(trial, measured)
    else:
        measured |= measure_push(trial)
        success = push_succeeded(measured)
    finite = {name: value for name, value in measured.items() if np.isfinite(value)}
    return TrialResult(success, finite, trial.failure, trial)
