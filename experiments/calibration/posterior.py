"""The posterior over the free numbers, by Markov chain Monte Carlo on the emulators.

Logarithms of mean forces are compared. Their covariance is the sum of the measurement's noise, the
unknown zero of the gauge, the scatter of repeats, the emulator's own error, and the error of the
twin as a model; half of the variance of the last, and of the scatter, is common to all forces. The
sampler is the affine-invariant ensemble of Goodman and Weare (Comm. App. Math. Comp. Sci. 5, 2010):
nothing to tune, and ridges of numbers that records decide only together cost it nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, qmc

from experiments.calibration.design import Design
from experiments.calibration.emulator import Emulator, log_force
from experiments.calibration.free_numbers import FreeNumber
from experiments.calibration.record import Record

Array = NDArray[np.float64]

GAUGE_ZERO = 0.01e-3  # Standard deviation of where the displacement is zero [m] [A].
WALKERS = 64
STEPS = 3000
STRETCH = 2.0  # Of the proposals; that of the paper.


@dataclass(frozen=True)
class Observation:
    """The records of a test, with its repeats, beside what the twin can do in it.

    Attributes:
        records: What was measured.
        emulator: Of the forces that all have.
        names: (k,) of these forces.
        forces: (k,) measured, the geometric mean of the repeats [N].
        columns: Which free numbers the test depends on.
        covariance: (k, k) of the logarithms.
    """

    records: Sequence[Record]
    emulator: Emulator
    names: list[str]
    forces: Array
    columns: list[int]
    covariance: Array

    @staticmethod
    def of(
        records: Sequence[Record],
        design: Design,
        numbers: Sequence[FreeNumber],
        model_error: float,
    ) -> Observation:
        """Return the records of a test with an emulator of it.

        Args:
            records: The same test, repeated.
            design: The simulations of its test.
            numbers: All that are free.
            model_error: Standard deviation of the twin's error, relative to the force.
        """
        each = [record.mean_forces for record in records]
        names = [name for name in design.names if all(name in found for found in each)]
        columns = [design.names.index(name) for name in names]
        emulator = Emulator.fit(design.shares, design.forces[:, columns])
        logs = log_force(np.array([[found[name].mean for name in names] for found in each]))
        common = (np.ones((len(names), len(names))) + np.eye(len(names))) / 2
        covariance = emulator.error + model_error**2 * common
        for found, forces in zip(each, np.exp(logs), strict=True):
            noise = np.array([found[name].noise for name in names]) / forces
            zero = np.array([found[name].slope for name in names]) * GAUGE_ZERO / forces
            covariance += (np.diag(noise**2) + np.outer(zero, zero)) / len(records) ** 2
        if len(records) > 1:
            covariance += logs.var(axis=0, ddof=1).mean() / len(records) * common
        where = [numbers.index(number) for number in design.numbers]
        forces = np.exp(logs.mean(axis=0))
        return Observation(records, emulator, names, forces, where, covariance)

    def misfit(self, shares: Array) -> Array:
        """Return the squared distance (m,) of the record from predictions, in its covariance."""
        off = np.log(self.forces) - self.emulator.predict(shares[:, self.columns])
        return np.sum(off * np.linalg.solve(self.covariance, off.T).T, axis=1)

    def predicted(self, shares: Array, rng: np.random.Generator) -> Array:
        """Return draws (m, k) of what would be measured [N], one per row of shares (m, d)."""
        error = rng.multivariate_normal(np.zeros(len(self.names)), self.covariance, len(shares))
        return np.exp(self.emulator.predict(shares[:, self.columns]) + error)

    def plausibility(self, shares: Array) -> float:
        """Return the posterior predictive p-value of the misfit: small where the twin is off."""
        return float(np.mean(chi2.sf(self.misfit(shares), len(self.names))))


@dataclass(frozen=True)
class Posterior:
    """Draws from the posterior.

    Attributes:
        numbers: (d,) that are free.
        shares: (m, d) of their priors, 0 to 1.
        effective: Number of independent draws that they are worth, of the worst number.
    """

    numbers: list[FreeNumber]
    shares: Array
    effective: float

    def quantiles(self, *levels: float) -> Array:
        """Return quantiles (levels, d) of the numbers, in SI."""
        found = np.quantile(self.shares, levels, axis=0)
        return np.column_stack([n.value(found[:, k]) for k, n in enumerate(self.numbers)])

    @property
    def width(self) -> Array:
        """Width (d,) of the 95 % intervals over that of the prior."""
        low, high = np.quantile(self.shares, (0.025, 0.975), axis=0)
        return (high - low) / 0.95

    @property
    def point(self) -> Array:
        """One value (d,) for each number, in SI: they go together, the mean of the shares."""
        return np.array(
            [
                n.value(share)
                for n, share in zip(self.numbers, self.shares.mean(axis=0), strict=True)
            ]
        )


def sample_posterior(
    observations: Sequence[Observation],
    numbers: list[FreeNumber],
    seed: int,
    steps: int = STEPS,
) -> Posterior:
    """Sample the posterior of flat priors.

    Args:
        observations: The records, independent of each other.
        numbers: All that are free.
        seed: Of the chain.
        steps: Of each of the walkers; the first half is thrown away.
    """

    def log_density(shares: Array) -> Array:
        inside = np.all((shares > 0) & (shares < 1), axis=1)
        clipped = np.clip(shares, 0, 1)
        return np.where(inside, -sum(o.misfit(clipped) for o in observations) / 2, -np.inf)

    rng = np.random.default_rng(seed)
    start = qmc.Sobol(len(numbers), rng=rng).random(4096)
    walkers = start[np.argsort(log_density(start))[-WALKERS:]]
    density, half, chain = log_density(walkers), WALKERS // 2, []
    for step in range(steps):
        for moved, others in ((slice(half), slice(half, None)), (slice(half, None), slice(half))):
            z = (1 + (STRETCH - 1) * rng.random(half)) ** 2 / STRETCH
            partner = walkers[others][rng.integers(half, size=half)]
            proposal = partner + z[:, None] * (walkers[moved] - partner)
            found = log_density(proposal)
            gain = (len(numbers) - 1) * np.log(z) + found - density[moved]
            taken = np.log(rng.random(half)) < gain
            walkers[moved] = np.where(taken[:, None], proposal, walkers[moved])
            density[moved] = np.where(taken, found, density[moved])
        if step >= steps // 2:
            chain.append(walkers.copy())
    draws = np.array(chain)
    return Posterior(numbers, draws.reshape(-1, len(numbers)), effective_number(draws))


def effective_number(draws: Array) -> float:
    """Return how many independent draws a chain (steps, walkers, d) is worth, for the worst number.

    By the integrated autocorrelation time of the walkers together, summed up to the first lag that
    is five times it (Goodman and Weare).
    """
    steps, walkers, dimensions = draws.shape
    worst = np.inf
    for k in range(dimensions):
        series = draws[:, :, k] - draws[:, :, k].mean()
        spectrum = np.abs(np.fft.rfft(series, 2 * steps, axis=0)) ** 2
        correlation = np.fft.irfft(spectrum.mean(axis=1))[:steps]
        times = 2 * np.cumsum(correlation / correlation[0]) - 1
        end = int(np.argmax(np.arange(steps) >= 5 * times))
        worst = min(worst, steps * walkers / max(times[end], 1.0))
    return float(worst)
