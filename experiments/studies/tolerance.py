"""Up to which size of an error a step succeeds, from success rates at some sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import isotonic_regression


@dataclass(frozen=True)
class Tolerance:
    """The size at which the success rate falls below a goal.

    Attributes:
        size: In the unit of the sizes; the smallest tried if ``below``, the largest if ``beyond``.
        below: Whether the goal is missed at the smallest size already.
        beyond: Whether it is still met at the largest.
    """

    size: float
    below: bool = False
    beyond: bool = False

    @property
    def sign(self) -> str:
        """What stands before the number: "<", ">" or nothing."""
        return "<" if self.below else ">" if self.beyond else ""


def tolerance(
    sizes: Sequence[float], successes: Sequence[int], trials: Sequence[int], goal: float
) -> Tolerance:
    """Return the size at which the success rate crosses a goal.

    The rates are first made to fall with the size, by isotonic regression weighted by the trials:
    a larger error is not better, and where it seems so that is chance. Between two sizes the rate
    is taken as linear in the logarithm of the size.

    Args:
        sizes: (n,) positive and rising.
        successes: (n,) of the trials.
        trials: (n,) at each size.
        goal: Success rate that is asked for.
    """
    rates = np.asarray(successes, dtype=float) / np.asarray(trials)
    falling = isotonic_regression(rates, weights=np.asarray(trials), increasing=False).x
    met = falling >= goal - 1e-12
    if not met[0]:
        return Tolerance(float(sizes[0]), below=True)
    if met.all():
        return Tolerance(float(sizes[-1]), beyond=True)
    k = int(np.argmin(met))  # The first that misses it.
    share = (falling[k - 1] - goal) / (falling[k - 1] - falling[k])
    ends = np.log([sizes[k - 1], sizes[k]])
    return Tolerance(float(np.exp(ends[0] + share * (ends[1] - ends[0]))))
