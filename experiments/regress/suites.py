"""The cases of a regression: their names, the suites, and their trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cell.configuration.config import CellConfig
from cell.errors import InputError
from experiments.campaigns.points import trials
from experiments.campaigns.trial import Trial
from experiments.jig.holding import SPECIMENS
from experiments.paper.place_push import PRODUCT
from experiments.paper.postures import POSTURES, PUSHES

SEED = 0
LABELS = {"place": tuple(POSTURES), "push": tuple(PUSHES), "hold": SPECIMENS}
NAMES = tuple(f"{experiment}/{label}" for experiment, found in LABELS.items() for label in found)
"""Of all cases: the experiment and the label of what it is done with, ``push/plate/P1/a``."""


@dataclass(frozen=True)
class Suite:
    """The cases of a regression run.

    Attributes:
        cases: Their names.
        trials: Of each case.
    """

    cases: tuple[str, ...]
    trials: int


# Two pushes that succeed and one that fails, the most robust ones of `push_robustness`: cases that
# depend on rounding, such as whether motor P2-a wedges or topples, are in the full suite only.
# Whether a push succeeds hardly depends on vacuum and friction of the frozen bed; what a part
# resists when it is pushed over does.
QUICK = (
    "place/motor/P2", "push/plate/P1/a", "push/plate/P2/b", "push/plate/P2/c", "hold/standing",
    "hold/plate/P2",
)  # fmt: skip
SUITES = {"quick": Suite(QUICK, 1), "full": Suite(NAMES, 3)}


def cases_named(wanted: Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    """Return the cases that names select: of a case, or its first words, as ``push/motor``.

    Args:
        wanted: What selects them.
        known: The cases that there are: all, or those of which something is stored.

    Raises:
        InputError: A name selects none.
    """
    found: list[str] = []
    for name in wanted:
        cases = [case for case in known if f"{case}/".startswith(f"{name.rstrip('/')}/")]
        if not cases:
            raise InputError(f"No case '{name}'. Known: {', '.join(known)}.")
        found += cases
    return tuple(dict.fromkeys(found))


def trials_of(suite: Suite, config: CellConfig) -> dict[str, list[Trial]]:
    """Return the trials of every case by name; nothing in "hold" is random, so it has one."""
    found = {}
    for case in suite.cases:
        experiment, _, label = case.partition("/")
        if experiment == "hold":
            points = [{"specimen": label}]
        else:
            points = [{"case": label, "number": k, "timed": True} for k in range(suite.trials)]
        found[case] = trials(experiment, points, product=PRODUCT, config=config, seeds=[SEED])
    return found
