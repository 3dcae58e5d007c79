"""Statistics of repeated trials."""

from __future__ import annotations

from collections.abc import Sequence

from scipy.stats import binom, binomtest


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a success rate."""
    interval = binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def median_interval(values: Sequence[float]) -> tuple[float, float] | None:
    """Return a 95 % interval of the median, whatever the distribution; None for less than six.

    Its ends are values themselves: the number of values below the median is binomial with 1/2.
    """
    rank = int(binom.ppf(0.025, len(values), 0.5)) if values else 0
    if rank == 0:
        return None
    ordered = sorted(values)
    return ordered[rank - 1], ordered[-rank]
