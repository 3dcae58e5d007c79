"""Sobol indices: which share of the variance of an outcome is due to which parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cell.errors import InputError
from experiments.campaigns.points import Point

Array = NDArray[np.float64]
Ranges = Mapping[str, tuple[float, float]]
RESAMPLES = 500  # For intervals at 2.5 and 97.5 %: a dozen lie beyond each end.


@dataclass(frozen=True)
class Indices:
    """Of one outcome, per parameter, with 95 % intervals from resampling.

    Attributes:
        first: (d,) share of the variance that goes when the parameter alone is known.
        total: (d,) share that stays when all others are known: with all interactions.
        first_interval, total_interval: (d, 2).
    """

    first: Array
    total: Array
    first_interval: Array
    total_interval: Array


def pick_freeze(ranges: Ranges, number: int, seed: int) -> list[Point]:
    """Return the points from which Sobol indices are computed, by Saltelli's design.

    First come N points A, then N points B, then for each parameter the points A with its values
    from B. A and B are the two halves of one scrambled Sobol sequence, as in `scipy.stats`.

    Args:
        ranges: Lower and upper end by name of d parameters, which are independent and uniform.
        number: N, a power of 2.
        seed: Of the scrambling.

    Returns:
        N (d + 2) points.

    Raises:
        InputError: N is no power of 2, or a range is empty.
    """
    from scipy.stats import qmc  # Half a second that workers can do without.

    if number < 2 or number & (number - 1):
        raise InputError(f"--samples must be a power of 2, not {number}.")
    for name, (low, high) in ranges.items():
        if not low < high:
            raise InputError(f"The range of {name} is empty: {low:g} to {high:g}.")
    lows, highs = (np.array(ends) for ends in zip(*ranges.values(), strict=True))
    count = len(ranges)
    unit = qmc.Sobol(2 * count, rng=seed).random(number)
    first, second = (lows + (highs - lows) * half for half in np.split(unit, 2, axis=1))
    blocks = [first, second]
    for k in range(count):
        mixed = first.copy()
        mixed[:, k] = second[:, k]
        blocks.append(mixed)
    return [dict(zip(ranges, row, strict=True)) for row in np.concatenate(blocks).tolist()]


def sobol(values: Sequence[float], parameters: int, seed: int) -> Indices | None:
    """Return the Sobol indices of an outcome; None if it is the same in all points.

    The estimators are Saltelli's of 2010; both can come out a little below 0 or above 1.

    Args:
        values: At the points of `pick_freeze`, in their order, all finite.
        parameters: d, their number.
        seed: Of the resampling.
    """
    from scipy.stats import sobol_indices

    blocks = np.reshape(np.asarray(values, dtype=float), (parameters + 2, -1))
    if np.ptp(blocks[:2]) == 0.0:
        return None
    number = blocks.shape[1]
    functions = {"f_A": blocks[:1], "f_B": blocks[1:2], "f_AB": blocks[2:, None, :]}
    found = sobol_indices(func=functions, n=number)
    rng = np.random.default_rng(seed)
    drawn = [_resampled(functions, rng.integers(number, size=number)) for _ in range(RESAMPLES)]
    first, total = (np.percentile(each, [2.5, 97.5], axis=0).T for each in zip(*drawn, strict=True))
    return Indices(np.ravel(found.first_order), np.ravel(found.total_order), first, total)


def _resampled(functions: Mapping[str, Array], rows: NDArray[np.int_]) -> tuple[Array, Array]:
    # Not SobolResult.bootstrap: it takes no seed, and the same trials must give the same report.
    from scipy.stats import sobol_indices

    drawn = {name: values[..., rows] for name, values in functions.items()}
    found = sobol_indices(func=drawn, n=len(rows))
    return np.ravel(found.first_order), np.ravel(found.total_order)
