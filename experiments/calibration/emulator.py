"""A stand-in for the twin's bench: Gaussian processes for the logarithms of its mean forces.

Each mean force has a process of its own: a linear trend, plus a squared-exponential kernel with one
length per free number, plus a nugget for the scatter of the simulation. Its hyperparameters are the
most probable ones (Rasmussen and Williams, Gaussian Processes for Machine Learning, ch. 5). What it
is worth is measured by leaving out each simulation in turn and predicting it from the others; the
covariance of these errors over the forces of a test is part of the likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

Array = NDArray[np.float64]

LEAST_FORCE = 0.02  # Below which forces are not told apart: their logarithm is taken [N] [A].
TREND = 10.0  # Variance of the trend's coefficients, in variances of the data: next to flat.
# Prior of the hyperparameters' logarithms, mean and deviation: kernel variance, nugget, lengths in
# shares of the prior [A]. It keeps few points from being explained by one length of zero.
PRIOR = {"variance": (0.0, 1.5), "nugget": (-6.0, 2.0), "length": (0.3, 0.8)}


@dataclass(frozen=True)
class Process:
    """A Gaussian process over shares of the prior, conditioned on n simulations.

    Attributes:
        shares: (n, d) where they are.
        lengths: (d,) of the kernel.
        variance: Of the kernel, in variances of the data.
        weights: (n,) of the simulations.
        mean: Of the data.
        scale: Standard deviation of the data.
        left_out: (n,) error of the prediction of each simulation from the others.
    """

    shares: Array
    lengths: Array
    variance: float
    weights: Array
    mean: float
    scale: float
    left_out: Array

    @staticmethod
    def fit(shares: Array, values: Array) -> Process:
        """Return the process that is conditioned on values (n,) at shares (n, d)."""
        count, dimensions = shares.shape
        mean, scale = float(values.mean()), float(values.std()) or 1.0
        data = (values - mean) / scale
        centre, spread = np.array(
            [PRIOR["variance"], PRIOR["nugget"], *[PRIOR["length"]] * dimensions]
        ).T

        def covariance(logs: Array) -> Array:
            kernel = _kernel(shares, shares, np.exp(logs[2:]), float(np.exp(logs[0])))
            return kernel + np.exp(logs[1]) * np.eye(count)

        def surprise(logs: Array) -> float:
            factor = cho_factor(covariance(logs), lower=True)
            fit = data @ cho_solve(factor, data) / 2 + np.log(np.diag(factor[0])).sum()
            return float(fit + np.sum(((logs - centre) / spread) ** 2) / 2)

        bounds = list(zip(centre - 4 * spread, centre + 4 * spread, strict=True))
        best = minimize(surprise, centre, method="L-BFGS-B", bounds=bounds)
        inverse = np.linalg.inv(covariance(best.x))
        weights = inverse @ data
        left_out = scale * weights / np.diag(inverse)
        lengths, variance = np.exp(best.x[2:]), float(np.exp(best.x[0]))
        return Process(shares, lengths, variance, weights, mean, scale, left_out)

    def predict(self, shares: Array) -> Array:
        """Return the means (m,) at shares (m, d)."""
        kernel = _kernel(shares, self.shares, self.lengths, self.variance)
        return self.mean + self.scale * (kernel @ self.weights)


def _kernel(a: Array, b: Array, lengths: Array, variance: float) -> Array:
    apart = (a[:, None, :] - b[None, :, :]) / lengths
    near = np.exp(-np.einsum("mnd,mnd->mn", apart, apart) / 2)
    return variance * near + TREND * (1 + (a - 0.5) @ (b - 0.5).T)


@dataclass(frozen=True)
class Emulator:
    """The logarithms of the mean forces of a test.

    Attributes:
        processes: (k,) one per force.
        error: (k, k) covariance of its errors, see `error_covariance`.
    """

    processes: list[Process]
    error: Array

    @staticmethod
    def fit(shares: Array, forces: Array) -> Emulator:
        """Return the emulator of forces (n, k) [N] at shares (n, d)."""
        logs = log_force(forces)
        processes = [Process.fit(shares, column) for column in logs.T]
        left_out = np.array([process.left_out for process in processes])
        return Emulator(processes, error_covariance(left_out))

    def predict(self, shares: Array) -> Array:
        """Return the logarithms (m, k) at shares (m, d)."""
        return np.column_stack([process.predict(shares) for process in self.processes])

    @property
    def relative_error(self) -> Array:
        """Root mean square (k,) of the errors that leave one out, relative to the force."""
        return np.sqrt(np.mean([p.left_out**2 for p in self.processes], axis=1))


def error_covariance(errors: Array) -> Array:
    """Return the covariance (k, k) that stands for n errors (k, n) of k forces.

    Larger than that of the errors by n / (n - k - 2): the inverse of a covariance that is estimated
    from few errors is too large by that, and intervals too narrow (Hartlap et al., Astronomy and
    Astrophysics 464, 2007). That is for a mean that is estimated; here it is zero, which is safe.
    """
    forces, count = errors.shape
    return errors @ errors.T / (count - forces - 2)


def log_force(force: Array) -> Array:
    """Return the logarithm of forces [N], of the least one below it."""
    return np.log(np.maximum(force, LEAST_FORCE))
